// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "measures.hpp"

#include "lineament/core/landmarks.hpp"
#include "lineament/io/landmark_file.hpp"

#include <Eigen/Core>

#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

/// Photo sets with annotated faces, and what the benchmark programs measure on them.
namespace lineament::bench {

namespace fs = std::filesystem;

/// Folders below DATA/images with iBUG .pts files beside the pictures.
inline constexpr const char* photo_sets[] = {"helen_test", "helen_train", "afw", "lfpw_same_person", "aflw2000"};

/// An error above this, % of the outer-eye distance, means that another face was found.
inline constexpr double other_face_percent = 35.0;

/// The picture an annotation belongs to: same stem, or the stem without what follows the first or last "_".
[[nodiscard]] inline fs::path picture_of(const fs::path& annotation)
{
    const std::string stem = annotation.stem().string();
    for (const std::string& name : {stem, stem.substr(0, stem.find('_')), stem.substr(0, stem.rfind('_'))}) {
        for (const char* extension : {".jpg", ".png"}) {
            if (fs::exists(annotation.parent_path() / (name + extension))) {
                return annotation.parent_path() / (name + extension);
            }
        }
    }
    return {};
}

/// The annotated faces of each picture in a folder; annotations of other than 68 points are left out.
/// iBUG counts pixels from 1, the reannotated AFLW2000 points from 0.
[[nodiscard]] inline std::map<fs::path, std::vector<LandmarkSet>> annotated_faces(const fs::path& folder)
{
    std::map<fs::path, std::vector<LandmarkSet>> faces;
    for (const auto& entry : fs::directory_iterator(folder)) {
        const fs::path picture = entry.path().extension() == ".pts" ? picture_of(entry.path()) : fs::path();
        if (!picture.empty()) {
            const bool from_zero = entry.path().stem().string().find("reannotated") != std::string::npos;
            const LandmarkFile file = load_landmarks(
                entry.path().string(), {.pts_origin = from_zero ? PtsOrigin::zero_based : PtsOrigin::one_based,
                                        .pts_header = PtsHeader::optional});
            if (file.frames.front().set.landmarks.size() == 68) {
                faces[picture].push_back(file.frames.front().set);
            }
        }
    }
    return faces;
}

/// Mean distance of the ibug68 points first ... 68, % of the outer-eye distance of the annotation.
[[nodiscard]] inline double error_percent(const LandmarkSet& found, const LandmarkSet& truth, int first = 18)
{
    double sum = 0.0;
    for (int ibug = first; ibug <= 68; ++ibug) {
        const std::string name = std::to_string(ibug);
        sum += (found.find(name)->point_px - truth.find(name)->point_px).norm();
    }
    return 100.0 * sum / ((69 - first) * (truth.find("37")->point_px - truth.find("46")->point_px).norm());
}

} // namespace lineament::bench
