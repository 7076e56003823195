// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How near a detector's landmarks come to annotations of real photos.
#pragma once

#include "lineament/core/image.hpp"
#include "lineament/core/landmarks.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "support/matchers.hpp"

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

namespace lineament::test {

/// Mean distance of the inner landmarks 18 ... 68 of ibug68 in units of the distance of the outer eye corners of `a`.
inline double inner_difference(const LandmarkSet& a, const LandmarkSet& b)
{
    const double eyes = (a.find("37")->point_px - a.find("46")->point_px).norm();
    double sum = 0.0;
    for (int i = 18; i <= 68; ++i) {
        sum += (a.find(std::to_string(i))->point_px - b.find(std::to_string(i))->point_px).norm();
    }
    return sum / (51.0 * eyes);
}

struct AnnotationErrors
{
    int num_photos = 0;
    std::vector<double> errors = {}; ///< Of the photos whose annotated face was found, ascending.

    [[nodiscard]] double median() const { return errors.at(errors.size() / 2); }
};

/// @param find  The landmarks (ibug68) of all faces in a picture.
template <typename Find>
AnnotationErrors annotation_errors(const std::filesystem::path& folder, Find&& find)
{
    constexpr double other_face = 0.35;
    AnnotationErrors result;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        if (entry.path().extension() != ".pts") {
            continue;
        }
        ++result.num_photos;
        std::filesystem::path photo = entry.path();
        const ImageU8 picture = load_image(photo.replace_extension(".jpg").string());
        const LandmarkSet truth =
            load_landmarks(entry.path().string(), {.pts_header = PtsHeader::optional}).frames.front().set;
        double smallest = 1.0;
        for (const LandmarkSet& landmarks : find(picture)) {
            smallest = std::min(smallest, inner_difference(truth, landmarks));
        }
        if (smallest < other_face) {
            result.errors.push_back(smallest);
        }
    }
    std::sort(result.errors.begin(), result.errors.end());
    return result;
}

} // namespace lineament::test
