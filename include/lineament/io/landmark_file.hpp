// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/landmarks.hpp"

#include <Eigen/Core>

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace lineament {

/// Where a `.pts` file puts the centre of the top-left pixel.
enum class PtsOrigin
{
    one_based,  ///< At (1, 1), as the iBUG annotations do: image point = file - 0.5.
    zero_based, ///< At (0, 0): image point = file + 0.5.
};

/// Whether a `.pts` file may lack its `version`, `n_points` and braces.
enum class PtsHeader
{
    required,
    optional, ///< A file of bare "x y" lines is taken too; it must then hold exactly 68 points.
};

/// What the numbers of a `.pts`, CSV or Lineament JSON file mean. MediaPipe's results say it themselves.
enum class LandmarkUnits
{
    pixels,
    normalized, ///< Parts of the image's width and height; needs the image size.
};

/// Which landmarks the points of a MediaPipe result become.
enum class MediapipePoints
{
    ibug68,       ///< Those with a counterpart in ibug68, under its names.
    mediapipe478, ///< All 468 or 478 of the file, named "0" ... "477".
};

struct LandmarkFileOptions
{
    PtsOrigin pts_origin = PtsOrigin::one_based;
    PtsHeader pts_header = PtsHeader::required;
    LandmarkUnits units = LandmarkUnits::pixels;
    MediapipePoints mediapipe_points = MediapipePoints::ibug68;
    int image_width = 0;  ///< [px], 0: unknown. Needed for normalised points.
    int image_height = 0; ///< [px], 0: unknown.
};

enum class LandmarkFormat
{
    pts,
    csv,       ///< OpenFace and Py-Feat: columns x_0 ... x_67, y_0 ... y_67.
    json,      ///< Ours, "lineament-landmarks".
    mediapipe, ///< A MediaPipe face landmark result stored as JSON.
};

/// The landmarks of one face in one frame.
struct LandmarkFrame
{
    LandmarkSet set = {};                        ///< Without landmarks if the file says that the face was not found.
    std::optional<double> time_s = std::nullopt; ///< Time stamp [s].
    std::optional<int> frame = std::nullopt;     ///< As numbered by the file.
    std::optional<int> face_id = std::nullopt;   ///< As numbered by the file.
    /// Of the noise of each landmark, in the order of the set [px^2]; empty: the file says nothing of it. As
    /// JointFitter takes them.
    std::vector<Eigen::Matrix2d> covariances_px = {};
};

struct LandmarkFile
{
    LandmarkFormat format = LandmarkFormat::pts;
    std::vector<LandmarkFrame> frames = {}; ///< In the order of the file.
    std::optional<int> image_width = {};    ///< [px], if the file says it.
    std::optional<int> image_height = {};   ///< [px], if the file says it.
};

/// The landmarks in the bytes of a file, moved to image space (pixel centres at +0.5). The format is told by content.
///
/// @param path  Name for messages.
/// @throws IoError naming line and column (or byte), what was expected, what was found and what to do: a row that is
///         not two numbers, counts that disagree, an unknown or repeated name, a decimal comma, points that look
///         normalised, a covariance that is none.
/// @throws InvalidArgument if the image size is needed and missing.                              docs/formats.md
[[nodiscard]] LandmarkFile parse_landmarks(std::string_view bytes, const std::string& path,
                                           const LandmarkFileOptions& options = {});

/// parse_landmarks of a file's content.
[[nodiscard]] LandmarkFile load_landmarks(const std::string& path, const LandmarkFileOptions& options = {});

/// The set as Lineament landmark JSON; parse_landmarks gives it back bit for bit.
/// @param covariances_px  One for each landmark [px^2], or none.
/// @throws InvalidArgument on a name that is empty or repeated, a number that is not finite, a size < 1, a covariance
///         that is not symmetric positive definite, or another number of them.
[[nodiscard]] std::string format_landmarks(const LandmarkSet& set, int image_width, int image_height,
                                           std::span<const Eigen::Matrix2d> covariances_px = {});

/// format_landmarks into a file, which is replaced only when all of it is written.
void save_landmarks(const std::string& path, const LandmarkSet& set, int image_width, int image_height,
                    std::span<const Eigen::Matrix2d> covariances_px = {});

/// The name in the scheme ibug68 of a point of MediaPipe's 468- or 478-point face mesh, or an empty text. Of the
/// outline only the chin has a counterpart; the other outline points of ibug68 mark the visible edge, which no fixed
/// point does.
[[nodiscard]] std::string ibug68_name_of_mediapipe_point(int index);

} // namespace lineament
