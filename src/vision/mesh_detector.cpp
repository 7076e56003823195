// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/mesh_detector.hpp"

#include "face_boxes.hpp"
#include "lineament/core/checks.hpp"
#include "lineament/vision/mesh_yaw.hpp"
#include "mesh_network.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

namespace lineament {
namespace {

/// Above, a followed face needs no detector to confirm it.
constexpr double sure_presence = 0.9;
/// Of a followed face and the detection that confirms it, as intersection / union.
constexpr double min_confirming_overlap = 0.1;
/// Two meshes that overlap more are the same face.
constexpr double max_mesh_overlap = 0.5;

std::filesystem::path find_network_folder(const std::string& option)
{
    if (!option.empty()) {
        return option;
    }
    const char* variable = std::getenv("LINEAMENT_NETWORKS");
    if (variable != nullptr && *variable != '\0') {
        return variable;
    }
    for (const std::filesystem::path folder : {LINEAMENT_INSTALLED_MODELS, LINEAMENT_SOURCE_MODELS}) {
        std::error_code ignored;
        if (std::filesystem::is_regular_file(folder / network::landmark_network.file, ignored)) {
            return folder;
        }
    }
    throw IoError(IoErrorKind::system, std::string(network::landmark_network.file), "",
                  std::string("the face detection networks are not there; looked at LINEAMENT_NETWORKS (not set), ") +
                      LINEAMENT_INSTALLED_MODELS + ", " + LINEAMENT_SOURCE_MODELS +
                      "; set LINEAMENT_NETWORKS or give their folder");
}

// Written out instead of `require`, whose texts are allocated whether they are needed or not.
void require_picture(const ImageU8& picture, const char* function)
{
    if (picture.channels != 3 && !picture.empty()) {
        throw InvalidArgument(function, "picture", "3 channels", std::to_string(picture.channels));
    }
    if (picture.data.size() != static_cast<std::size_t>(picture.width) * picture.height * picture.channels) {
        throw InvalidArgument(function, "picture", "width * height * 3 values", std::to_string(picture.data.size()));
    }
}

void require_mesh(const Eigen::Matrix3Xf& points, const char* function)
{
    if (points.cols() < num_surface_points) {
        throw InvalidArgument(function, "points", "at least 468 points", std::to_string(points.cols()));
    }
    require_finite(points.topLeftCorner<2, num_surface_points>(), function, "points");
    if (!(window_of(points).side > 0.0)) {
        throw InvalidArgument(function, "points", "points at different places", "all of them at one");
    }
}

Eigen::AlignedBox2d box_around(const Eigen::Ref<const Eigen::Matrix3Xf>& points)
{
    const auto surface = points.topLeftCorner<2, num_surface_points>();
    return {Eigen::Vector2d(surface.rowwise().minCoeff().cast<double>()),
            Eigen::Vector2d(surface.rowwise().maxCoeff().cast<double>())};
}

SquareWindow window_of(const BoxedFace& face)
{
    const Eigen::Vector2d eyes = face.left_eye - face.right_eye;
    return {.center = face.box.center(),
            .side = 1.5 * face.box.sizes().maxCoeff(),
            .angle = std::atan2(eyes.y(), eyes.x())};
}

/// Whether a face in the window would be seen: it touches the picture and is neither tiny nor much larger.
bool is_usable(const SquareWindow& window, const ImageU8& picture)
{
    const double reach = 0.75 * window.side; // from its centre to beyond any corner
    return window.side >= 4.0 && window.side <= 8.0 * std::max(picture.width, picture.height) &&
           window.center.x() > -reach && window.center.y() > -reach && window.center.x() < picture.width + reach &&
           window.center.y() < picture.height + reach;
}

/// Writes the estimate into the face, in memory it has already if there is any.
void store(const MeshEstimate& estimate, double score, MeshFace& face)
{
    face.points = estimate.points;
    face.presence = estimate.presence;
    const Eigen::AlignedBox2d box = box_around(estimate.points);
    face.box = {.left = box.min().x(),
                .top = box.min().y(),
                .width = box.sizes().x(),
                .height = box.sizes().y(),
                .score = score};
    face.landmarks.scheme = "mediapipe478";
    face.landmarks.landmarks.resize(num_mesh_points);
    for (int i = 0; i < num_mesh_points; ++i) {
        Landmark& landmark = face.landmarks.landmarks[i];
        landmark.name = std::to_string(i); // short enough for no allocation
        landmark.point_px = estimate.points.col(i).head<2>().cast<double>();
        landmark.confidence = 1.0;
        landmark.depth_px = estimate.points(2, i);
    }
    doubt_folded_points(face.landmarks);
}

} // namespace

struct MeshDetector::Implementation
{
    Implementation(const std::filesystem::path& folder, NetworkTrust trust)
        : short_range(load(folder, network::short_range_network, trust)),
          full_range(load(folder, network::full_range_network, trust)),
          mesh(load(folder, network::landmark_network, trust))
    {
        near_faces.reserve(short_range.max_faces());
        far_faces.reserve(full_range.max_faces());
    }

    static network::Network load(const std::filesystem::path& folder, const network::KnownNetwork& known,
                                 NetworkTrust trust)
    {
        return network::load_network((folder / known.file).string(),
                                     trust == NetworkTrust::known_only ? known.sha256 : std::string_view());
    }

    BoxDetector short_range;
    BoxDetector full_range;
    MeshNetwork mesh;
    std::vector<BoxedFace> near_faces = {};
    std::vector<BoxedFace> far_faces = {};
    MeshEstimate first = {};
    MeshEstimate second = {};
    int num_left_out = 0;

    /// Adds the meshes of the boxed faces that pass the presence threshold and are not there yet; the boxes that fail
    /// are erased.
    void add_meshes(const ImageU8& picture, std::vector<BoxedFace>& boxed, double presence_threshold,
                    std::vector<MeshFace>& faces)
    {
        std::erase_if(boxed, [&](const BoxedFace& candidate) {
            const SquareWindow window = window_of(candidate);
            if (!is_usable(window, picture)) {
                return true;
            }
            mesh.estimate(picture, window, first);
            if (!(first.presence >= presence_threshold)) {
                return true;
            }
            const auto twin = std::find_if(faces.begin(), faces.end(), [&](const MeshFace& face) {
                return intersection_over_union(box_around(face.points), box_around(first.points)) > max_mesh_overlap;
            });
            if (twin == faces.end()) {
                store(first, candidate.score, faces.emplace_back());
            } else if (first.presence > twin->presence) {
                store(first, candidate.score, *twin);
            }
            return false;
        });
    }

    /// The faces of both networks.
    void add_merged(const ImageU8& picture, double presence_threshold, std::vector<MeshFace>& faces)
    {
        merge_faces(near_faces, far_faces);
        add_meshes(picture, near_faces, presence_threshold, faces);
        // Where the better box of two is a false alarm, the other one may still hold a face.
        std::erase_if(far_faces, [&](const BoxedFace& loser) {
            return std::any_of(near_faces.begin(), near_faces.end(),
                               [&](const BoxedFace& passed) { return are_rivals(passed, loser); });
        });
        add_meshes(picture, far_faces, presence_threshold, faces);
    }

    /// The boxed face that overlaps the box most, if any does enough.
    static const BoxedFace* confirming(const std::vector<BoxedFace>& boxed, const Eigen::AlignedBox2d& box)
    {
        const BoxedFace* best = nullptr;
        double best_overlap = min_confirming_overlap;
        for (const BoxedFace& face : boxed) {
            const double overlap = intersection_over_union(face.box, box);
            if (overlap > best_overlap) {
                best_overlap = overlap;
                best = &face;
            }
        }
        return best;
    }

    /// The face that had these points in the previous frame, in `first`; false if it is lost.
    bool follow(const ImageU8& picture, const Eigen::Matrix3Xf& previous)
    {
        const SquareWindow window = lineament::window_of(previous);
        if (!is_usable(window, picture)) {
            return false;
        }
        mesh.estimate(picture, window, first);
        if (first.presence >= sure_presence) {
            return true;
        }
        const MeshDetectionOptions options;
        const Eigen::AlignedBox2d box = box_around(previous);
        short_range.detect(picture, options.score_threshold, near_faces);
        const BoxedFace* found = confirming(near_faces, box);
        if (found == nullptr) {
            full_range.detect(picture, options.score_threshold, far_faces);
            found = confirming(far_faces, box);
        }
        if (found == nullptr || !is_usable(window_of(*found), picture)) {
            return false;
        }
        mesh.estimate(picture, window_of(*found), second);
        if (second.presence > first.presence) {
            std::swap(first, second);
        }
        return first.presence >= options.presence_threshold;
    }
};

MeshDetector::MeshDetector(const MeshDetectorOptions& options)
    : implementation_(std::make_unique<Implementation>(find_network_folder(options.network_folder), options.trust))
{}

MeshDetector::~MeshDetector() = default;
MeshDetector::MeshDetector(MeshDetector&&) noexcept = default;
MeshDetector& MeshDetector::operator=(MeshDetector&&) noexcept = default;

std::vector<MeshFace> MeshDetector::detect(const ImageU8& picture, const MeshDetectionOptions& options)
{
    const char* const function = "MeshDetector::detect";
    require_picture(picture, function);
    require(options.max_faces >= 1, function, "max_faces", "a number >= 1", std::to_string(options.max_faces));
    require(options.score_threshold > 0.0 && options.score_threshold < 1.0, function, "score_threshold",
            "a number in (0, 1)", to_text(options.score_threshold));
    require(options.presence_threshold >= 0.0 && options.presence_threshold <= 1.0, function, "presence_threshold",
            "a number in [0, 1]", to_text(options.presence_threshold));
    std::vector<MeshFace> faces;
    implementation_->num_left_out = 0;
    if (picture.empty()) {
        return faces;
    }
    Implementation& parts = *implementation_;
    parts.short_range.detect(picture, options.score_threshold, parts.near_faces);
    if (options.max_faces == 1) {
        parts.add_meshes(picture, parts.near_faces, options.presence_threshold, faces);
    }
    if (faces.empty()) {
        parts.full_range.detect(picture, options.score_threshold, parts.far_faces);
        parts.add_merged(picture, options.presence_threshold, faces);
    }
    const auto area = [](const MeshFace& face) { return face.box.width * face.box.height; };
    std::stable_sort(faces.begin(), faces.end(),
                     [&](const MeshFace& a, const MeshFace& b) { return area(a) > area(b); });
    if (faces.size() > static_cast<std::size_t>(options.max_faces)) {
        parts.num_left_out = static_cast<int>(faces.size()) - options.max_faces;
        faces.resize(static_cast<std::size_t>(options.max_faces));
    }
    return faces;
}

int MeshDetector::num_left_out() const
{
    return implementation_->num_left_out;
}

std::optional<MeshFace> MeshDetector::follow(const ImageU8& picture, const LandmarkSet& previous)
{
    const char* const function = "MeshDetector::follow";
    require(previous.scheme == "mediapipe478", function, "previous.scheme", "mediapipe478", previous.scheme);
    MeshFace face;
    face.points.setZero(3, num_mesh_points);
    for (int i = 0; i < num_surface_points; ++i) {
        const std::string name = std::to_string(i);
        const std::vector<Landmark>& listed = previous.landmarks;
        // In the order of their names as a rule.
        const std::optional<Landmark> landmark =
            i < static_cast<int>(listed.size()) && listed[i].name == name ? listed[i] : previous.find(name);
        require(landmark.has_value(), function, "previous", "points 0 ... 467", "none named " + name);
        face.points.col(i).head<2>() = landmark->point_px.cast<float>();
    }
    if (!follow_in_place(picture, face)) {
        return std::nullopt;
    }
    return face;
}

bool MeshDetector::follow_in_place(const ImageU8& picture, MeshFace& face)
{
    const char* const function = "MeshDetector::follow";
    require_picture(picture, function);
    if (picture.empty()) {
        throw InvalidArgument(function, "picture", "a picture", "an empty one");
    }
    require_mesh(face.points, function);
    if (!implementation_->follow(picture, face.points)) {
        return false;
    }
    store(implementation_->first, 0.0, face);
    return true;
}

} // namespace lineament
