// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Landmarks of both detectors and the faces fitted to them, against the annotation of real photos.
//
//   bench/aflw2000_angles.py DATA/images/aflw2000 angles.csv           (optional; needs scipy)
//   photo_accuracy DATA [--angles angles.csv] [--method thesis]
//                                        DATA/images/<set>/ with iBUG .pts beside the pictures
//
// Errors are mean distances of the inner points 18 ... 68 from the annotation, in % of its outer-eye distance; medians
// over the faces of a set. A fit has the default options. Rows of a set: the annotation itself, 68 points of
// DlibDetector, 52 of MeshDetector as ibug68 (no outline but the chin), all 478 of MeshDetector; the fit's error is
// that of the model's projected landmarks.
#include "fitters_of_method.hpp"
#include "lineament/camera/angles.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "options.hpp"
#include "photo_sets.hpp"

#include <array>
#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>

namespace {

using namespace lineament;
using namespace lineament::bench;

/// Angles of AFLW2000-3D, H = R_x(-pitch) R_y(-yaw) R_z(-roll) [deg], H as in HeadAngles.
using SetAngles = Eigen::Vector3d; // pitch, yaw, roll

Eigen::Matrix3d head_from_set_angles(const SetAngles& angles)
{
    return (Eigen::AngleAxisd(-radians(angles[0]), Eigen::Vector3d::UnitX()) *
            Eigen::AngleAxisd(-radians(angles[1]), Eigen::Vector3d::UnitY()) *
            Eigen::AngleAxisd(-radians(angles[2]), Eigen::Vector3d::UnitZ()))
        .toRotationMatrix();
}

/// R_x(a) R_y(b) R_z(c) = [cb cc, -cb sc, sb; ..., -sa cb; ..., ca cb].
SetAngles set_angles_from_head(const Eigen::Matrix3d& head)
{
    return {degrees(std::atan2(head(1, 2), head(2, 2))), degrees(-std::asin(std::clamp(head(0, 2), -1.0, 1.0))),
            degrees(std::atan2(head(0, 1), head(0, 0)))};
}

/// Lines "stem,pitch,yaw,roll".
std::map<std::string, SetAngles> load_angles(const std::string& path)
{
    std::map<std::string, SetAngles> result;
    std::ifstream file(path);
    std::string line;
    std::getline(file, line); // names of the columns
    while (std::getline(file, line)) {
        std::replace(line.begin(), line.end(), ',', ' ');
        std::istringstream fields(line);
        std::string stem;
        SetAngles angles;
        if (fields >> stem >> angles[0] >> angles[1] >> angles[2]) {
            result[stem] = angles;
        }
    }
    return result;
}

struct PoseError
{
    double rotation_deg = 0.0; ///< Geodesic.
    double angles_deg = 0.0;   ///< Mean of the three in the set's own angles.
    double yaw_deg = 0.0;      ///< True, in the set's own angles.
};

PoseError pose_error(const Eigen::Matrix3d& camera_from_model, const SetAngles& truth)
{
    const Eigen::Matrix3d head = Eigen::Vector3d(1, -1, -1).asDiagonal() * camera_from_model;
    const Eigen::Matrix3d difference = head.transpose() * head_from_set_angles(truth);
    return {degrees(Eigen::AngleAxisd(difference).angle()), (set_angles_from_head(head) - truth).cwiseAbs().mean(),
            truth[1]};
}

/// What one source of landmarks gives on many faces.
struct Source
{
    const char* name;
    std::vector<double> landmark_percent = {};
    std::vector<double> fit_percent = {};
    std::vector<PoseError> poses = {};
    int not_success = 0; ///< Fits with another status than success.
};
using Sources = std::array<Source, 4>;

Sources no_values()
{
    return {{{"annotation"}, {"DlibDetector"}, {"MeshDetector, 52"}, {"MeshDetector"}}};
}

/// A face as found: its points as ibug68, to be compared, and in the scheme that it is fitted in.
struct Face
{
    LandmarkSet as_ibug68;
    LandmarkSet landmarks;
};

/// The face nearest to the annotation, unless it is another face.
const Face* nearest_face(const std::vector<Face>& faces, const LandmarkSet& truth)
{
    const Face* nearest = nullptr;
    double least = other_face_percent;
    for (const Face& face : faces) {
        if (error_percent(face.as_ibug68, truth) < least) {
            least = error_percent(face.as_ibug68, truth);
            nearest = &face;
        }
    }
    return nearest;
}

/// The ibug68 points of the fitted face.
LandmarkSet project_ibug68(const MorphableModel& model, const FitResult& fit)
{
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    const Eigen::VectorXf shape = shape_of(model, fit);
    const Eigen::Matrix3Xf points =
        map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3));
    LandmarkSet projected;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
        const Eigen::Vector3d point = points.col(i).cast<double>();
        projected.landmarks.push_back({map.names[static_cast<std::size_t>(i)], fit.camera.project(point), 1.0});
    }
    return projected;
}

void add(Source& source, const Face& face, const FitResult& fit, const MorphableModel& model, const LandmarkSet& truth,
         const std::optional<SetAngles>& angles)
{
    source.landmark_percent.push_back(error_percent(face.as_ibug68, truth));
    source.fit_percent.push_back(error_percent(project_ibug68(model, fit), truth));
    source.not_success += fit.status == FitStatus::success ? 0 : 1;
    if (angles) {
        source.poses.push_back(pose_error(fit.camera.camera_from_model, *angles));
    }
}

void print_accuracy(const char* set, const Sources& sources)
{
    for (const Source& source : sources) {
        std::printf("%-18s %-16s %5zu %12.2f %12.2f %10.2f %14d\n", set, source.name, source.fit_percent.size(),
                    median(source.landmark_percent), median(source.fit_percent), quantile(source.fit_percent, 0.9),
                    source.not_success);
    }
}

void print_poses(const Sources& sources)
{
    std::printf("\nAFLW2000 pose     faces  largest_|yaw|  rotation_deg: median   mean    max   angles_mae_deg\n");
    for (const Source& source : sources) {
        std::vector<double> rotation;
        double mean_rotation = 0.0;
        double mean_angles = 0.0;
        double largest_yaw = 0.0;
        for (const PoseError& pose : source.poses) {
            rotation.push_back(pose.rotation_deg);
            mean_rotation += pose.rotation_deg / static_cast<double>(source.poses.size());
            mean_angles += pose.angles_deg / static_cast<double>(source.poses.size());
            largest_yaw = std::max(largest_yaw, std::abs(pose.yaw_deg));
        }
        std::printf("%-16s %6zu %14.0f %21.2f %6.2f %6.2f %16.2f\n", source.name, source.poses.size(), largest_yaw,
                    median(rotation), mean_rotation, quantile(rotation, 1.0), mean_angles);
    }
}

void measure(const fs::path& data, const std::map<std::string, SetAngles>& angles_of, const std::string& method)
{
    DlibDetector face_detector;
    MeshDetector mesh_detector;
    const MorphableModel model = load_model(default_model_path());
    const FittersOfMethod fitters(model, method);
    Sources all = no_values();
    std::printf(
        "set                landmarks of     faces  landmarks_%%        fit_%%   fit_p90_%%  fits_not_success\n");
    for (const char* set : photo_sets) {
        Sources sources = no_values();
        for (const auto& [path, truths] : annotated_faces(data / "images" / set)) {
            const ImageU8 picture = load_image(path);
            std::array<std::vector<Face>, 3> found;
            for (const DetectedFace& face : face_detector.detect(picture)) {
                found[0].push_back({face.landmarks, face.landmarks});
            }
            for (const MeshFace& face : mesh_detector.detect(picture)) {
                const LandmarkSet as_ibug68 = ibug68_from_mediapipe(face.landmarks);
                found[1].push_back({as_ibug68, as_ibug68});
                found[2].push_back({as_ibug68, face.landmarks});
            }
            const auto known = angles_of.find(path.stem().string());
            const std::optional<SetAngles> angles =
                known != angles_of.end() ? std::optional(known->second) : std::nullopt;
            for (const LandmarkSet& truth : truths) {
                const Face annotated = {truth, truth};
                const std::array<const Face*, 4> faces = {&annotated, nearest_face(found[0], truth),
                                                          nearest_face(found[1], truth), nearest_face(found[2], truth)};
                for (std::size_t s = 0; s < faces.size(); ++s) {
                    if (faces[s]) {
                        const Eigen::Vector2d centre_px = 0.5 * Eigen::Vector2d(picture.width, picture.height);
                        const FitResult fit = fitters.fit(faces[s]->landmarks, centre_px);
                        add(sources[s], *faces[s], fit, model, truth, angles);
                        add(all[s], *faces[s], fit, model, truth, angles);
                    }
                }
            }
        }
        print_accuracy(set, sources);
        std::fflush(stdout);
    }
    print_accuracy("all", all);
    if (!angles_of.empty()) {
        print_poses(all);
    }
}

} // namespace

int main(int argc, char** argv)
{
    const Options options(argc, argv, "photo_accuracy DATA [--angles angles.csv] [--method thesis]", 1);
    try {
        const std::string angles = options.text("--angles", "");
        measure(argv[1], angles.empty() ? std::map<std::string, SetAngles>() : load_angles(angles),
                options.text("--method", "thesis"));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "photo_accuracy: error: %s\n", error.what());
        return 1;
    }
}
