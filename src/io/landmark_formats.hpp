// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/io/landmark_file.hpp"

#include <string>
#include <string_view>

namespace lineament::detail {

// The text has no byte order mark and no zero bytes.
[[nodiscard]] LandmarkFile parse_pts(std::string_view text, const std::string& path,
                                     const LandmarkFileOptions& options);
[[nodiscard]] LandmarkFile parse_landmark_csv(std::string_view text, const std::string& path,
                                              const LandmarkFileOptions& options);
[[nodiscard]] LandmarkFile parse_landmark_json(std::string_view text, const std::string& path,
                                               const LandmarkFileOptions& options);

/// A point of the file in image space.
/// @param shift  From the file's origin to image space [px]; not applied to normalised points.
[[nodiscard]] Eigen::Vector2d to_image_space(double x, double y, double shift, const LandmarkFileOptions& options);

/// A coordinate in pixels beyond this is refused: no picture is so large.
inline constexpr double max_coordinate_px = 1e7;

/// "a number within +-1e7" or what was found instead; for messages.
[[nodiscard]] bool is_coordinate(double value);

} // namespace lineament::detail
