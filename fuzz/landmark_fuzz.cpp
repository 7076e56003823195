// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Hostile landmark files: what is accepted is sane, and a set comes back from our own JSON as it was. The first byte
// chooses the options, the rest is the file.
#include "lineament/core/error.hpp"
#include "lineament/io/landmark_file.hpp"

#include <algorithm>
#include <cstdlib>
#include <set>

namespace {

using namespace lineament;

// What our own JSON said, whose numbers are all in the range of the reader, written and read again.
void check_round_trip(const LandmarkFrame& frame)
{
    LandmarkFileOptions options; // normalised to one pixel: any numbers are taken, as they are
    options.units = LandmarkUnits::normalized;
    options.image_width = 1;
    options.image_height = 1;
    const std::string text = format_landmarks(frame.set, 640, 480, frame.covariances_px);
    const LandmarkFrame again = parse_landmarks(text, "again", options).frames.at(0);
    if (!(again.set == frame.set) || again.covariances_px != frame.covariances_px) {
        std::abort();
    }
}

void check(const LandmarkFile& file)
{
    for (const LandmarkFrame& frame : file.frames) {
        std::set<std::string> names;
        double largest = 0.0;
        for (const Landmark& landmark : frame.set.landmarks) {
            const bool is_sane = landmark.point_px.allFinite() && landmark.confidence >= 0.0 &&
                                 landmark.confidence <= 1.0 && !landmark.name.empty();
            if (!is_sane || !names.insert(landmark.name).second) {
                std::abort();
            }
            largest = std::max(largest, landmark.point_px.cwiseAbs().maxCoeff());
        }
        if (file.format == LandmarkFormat::json && largest <= 1e7) {
            check_round_trip(frame);
        }
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    if (size == 0) {
        return 0;
    }
    LandmarkFileOptions options;
    options.pts_header = (data[0] & 1) != 0 ? PtsHeader::optional : PtsHeader::required;
    options.units = (data[0] & 2) != 0 ? LandmarkUnits::normalized : LandmarkUnits::pixels;
    options.image_width = 640;
    options.image_height = 480;
    const std::vector<char> file(data + 1, data + size); // a block of exact size
    try {
        check(parse_landmarks({file.data(), file.size()}, "fuzz", options));
    } catch (const IoError&) {
    }
    return 0;
}
