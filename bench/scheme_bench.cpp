// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How well the default model's scheme mediapipe478 fits what the mesh detector finds, against the scheme ibug68.
//   scheme_bench DATA [MODEL]    DATA/images/<set>/ with iBUG .pts beside the pictures, DATA/images/johns/<person>/
#include "fitters_of_method.hpp"
#include "photo_sets.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/procrustes.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/dlib_outline.hpp"
#include "lineament/vision/mesh_detector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>

namespace {

using namespace lineament;
namespace fs = std::filesystem;
using bench::error_percent;
using bench::FittersOfMethod;

Eigen::Vector2d center_of(const ImageU8& picture)
{
    return {0.5 * picture.width, 0.5 * picture.height};
}

double eye_distance(const LandmarkSet& annotation)
{
    return (annotation.find("37")->point_px - annotation.find("46")->point_px).norm();
}

// Where the detector's points lie on the face that the annotation shows

enum Part
{
    brows,
    nose,
    eyes,
    mouth,
    everything,
};
constexpr std::array<const char*, 5> part_names = {"brows", "nose", "eyes", "mouth", "all 468"};

bool is_in(Part part, int point)
{
    const std::string name = ibug68_name_of_mediapipe_point(point);
    const int number = name.empty() ? 0 : std::stoi(name);
    switch (part) {
    case brows:
        return number >= 18 && number <= 27;
    case nose:
        return number >= 28 && number <= 36;
    case eyes:
        return number >= 37 && number <= 48;
    case mouth:
        return number >= 49;
    case everything:
        break;
    }
    return true;
}

/// Detected minus model point (2 x 468), % of the outer-eye distance, in the picture's axes; the mean of the eyes and
/// lips, a matter of pose, taken out.
Eigen::Matrix2Xd offsets_percent(const MorphableModel& model, const FitResult& fit, const MeshFace& face,
                                 double eye_distance_px)
{
    const Eigen::VectorXf shape = shape_of(model, fit);
    const Eigen::Matrix3Xf points =
        model.find_landmark_map("mediapipe478")
            ->points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3));
    Eigen::Matrix2Xd offsets = face.points.topLeftCorner<2, 468>().cast<double>();
    const Eigen::Matrix3Xd model_points = points.leftCols<468>().cast<double>();
    offsets -= fit.camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(model_points));
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    int count = 0;
    for (int i = 0; i < 468; ++i) {
        if (is_in(eyes, i) || is_in(mouth, i)) {
            mean += offsets.col(i);
            ++count;
        }
    }
    offsets.colwise() -= mean / count;
    return 100.0 / eye_distance_px * offsets;
}

void print_offsets(const char* what, const std::vector<Eigen::Matrix2Xd>& faces)
{
    std::printf("%-28s %5zu", what, faces.size());
    for (const Part part : {brows, nose, eyes, mouth, everything}) {
        double systematic = 0.0;
        double square = 0.0;
        int count = 0;
        for (int i = 0; i < 468; ++i) {
            if (!is_in(part, i)) {
                continue;
            }
            Eigen::Vector2d mean = Eigen::Vector2d::Zero();
            for (const Eigen::Matrix2Xd& face : faces) {
                mean += face.col(i) / static_cast<double>(faces.size());
                square += face.col(i).squaredNorm() / (2.0 * static_cast<double>(faces.size()));
            }
            systematic += mean.norm();
            ++count;
        }
        std::printf("   %5.2f %5.2f", systematic / count, std::sqrt(square / count));
    }
    std::printf("\n");
}

void measure_offsets(const MorphableModel& model, MeshDetector& detector, const fs::path& images)
{
    const FaceFitter fitter(model, "ibug68");
    std::array<std::vector<Eigen::Matrix2Xd>, 2> halves;
    std::size_t num_pictures = 0;
    std::map<fs::path, std::vector<LandmarkSet>> faces_of;
    for (const char* set : bench::photo_sets) {
        faces_of.merge(bench::annotated_faces(images / set));
    }
    for (const auto& [path, annotations] : faces_of) {
        const ImageU8 picture = load_image(path);
        const std::vector<MeshFace> faces = detector.detect(picture);
        bool has_face = false;
        for (const LandmarkSet& annotation : annotations) {
            const auto distance_of = [&](const MeshFace& face) {
                return error_percent(ibug68_from_mediapipe(face.landmarks), annotation);
            };
            const auto nearest =
                std::min_element(faces.begin(), faces.end(),
                                 [&](const MeshFace& a, const MeshFace& b) { return distance_of(a) < distance_of(b); });
            if (nearest == faces.end() || distance_of(*nearest) > bench::other_face_percent) {
                continue;
            }
            has_face = true;
            const FitResult fit = fitter.fit(annotation, center_of(picture));
            const double yaw = angles_from_rotation(fit.camera.camera_from_model).yaw;
            if (std::abs(yaw) < radians(25.0)) {
                halves[num_pictures % 2].push_back(offsets_percent(model, fit, *nearest, eye_distance(annotation)));
            }
        }
        num_pictures += has_face ? 1 : 0;
    }
    std::printf("Detected points minus those of the model fitted to the annotation, yaw below 25 degrees,\n"
                "%% of the outer-eye distance: mean length of each point's mean offset, rms of a coordinate\n"
                "%-28s %5s   %-11s   %-11s   %-11s   %-11s   %-11s\n",
                "", "faces", part_names[0], part_names[1], part_names[2], part_names[3], part_names[4]);
    print_offsets("half that placed the points", halves[0]);
    print_offsets("half held out", halves[1]);
}

// Whether fits of one person's photos agree

struct Subject
{
    std::string person;
    Eigen::Matrix3Xd face; ///< Neutral, on the face mask.
};

Eigen::Matrix3Xd face_of(const MorphableModel& model, const FitResult& fit)
{
    const Eigen::VectorXf shape = neutral_shape_of(model, fit);
    const Eigen::VectorXf& mask = model.masks.at("face");
    Eigen::Matrix3Xd face(3, (mask.array() > 0.5f).count());
    Eigen::Index column = 0;
    for (Eigen::Index v = 0; v < mask.size(); ++v) {
        if (mask[v] > 0.5f) {
            face.col(column++) = shape.segment<3>(3 * v).cast<double>();
        }
    }
    return face;
}

void print_consistency(const char* what, const std::vector<Subject>& subjects)
{
    std::vector<double> same;
    std::vector<double> different;
    for (std::size_t i = 0; i < subjects.size(); ++i) {
        for (std::size_t k = i + 1; k < subjects.size(); ++k) {
            const Eigen::Matrix3Xd& target = subjects[k].face;
            const Eigen::Matrix3Xd aligned = align_points(subjects[i].face, target) * subjects[i].face;
            const double distance = (aligned - target).colwise().norm().mean();
            (subjects[i].person == subjects[k].person ? same : different).push_back(distance);
        }
    }
    const auto mean = [](const std::vector<double>& values) {
        double sum = 0.0;
        for (const double value : values) {
            sum += value;
        }
        return sum / static_cast<double>(values.size());
    };
    double num_in_order = 0.0;
    for (const double a : same) {
        for (const double b : different) {
            num_in_order += a < b ? 1.0 : 0.0;
        }
    }
    std::printf("%-28s %6zu %9.2f %9.2f %9.3f %9.3f\n", what, subjects.size(), mean(same), mean(different),
                mean(same) / mean(different), num_in_order / static_cast<double>(same.size() * different.size()));
}

void measure_consistency(const MorphableModel& model, MeshDetector& mesh_detector, const fs::path& images)
{
    std::vector<std::pair<std::string, fs::path>> pictures;
    for (const auto& entry : fs::directory_iterator(images / "lfpw_same_person")) {
        if (entry.path().extension() != ".pts") {
            pictures.emplace_back("woman of lfpw", entry.path());
        }
    }
    for (const auto& person : fs::directory_iterator(images / "johns")) {
        for (const auto& entry : fs::directory_iterator(person.path())) {
            pictures.emplace_back(person.path().filename().string(), entry.path());
        }
    }
    std::sort(pictures.begin(), pictures.end());
    DlibDetector detector;
    struct Method
    {
        std::string name;
        FittersOfMethod fitters;
        std::array<std::vector<Subject>, 4> subjects = {}; ///< By landmarks.
        double fit_us = 0.0;                               ///< To all points of the mesh.
    };
    std::vector<Method> methods;
    methods.push_back({"thesis", FittersOfMethod(model, "thesis")});
    methods.push_back({"joint", FittersOfMethod(model, "joint")});
    for (const int iterations : {1, 100}) {
        methods.push_back(
            {"thesis, iterations: " + std::to_string(iterations), FittersOfMethod(model, "thesis", iterations)});
    }
    for (const auto& [person, path] : pictures) {
        const ImageU8 picture = load_image(path);
        const std::vector<DetectedFace> faces = detector.detect(picture);
        const std::vector<MeshFace> meshes = mesh_detector.detect(picture);
        if (faces.empty() || meshes.empty()) {
            std::printf("not found by both: %s\n", path.filename().c_str());
            continue;
        }
        const LandmarkSet& mesh = meshes[0].landmarks;
        LandmarkSet with_outline = mesh;
        add_dlib_outline(with_outline, detector, picture);
        const std::array<LandmarkSet, 4> landmarks = {faces[0].landmarks, ibug68_from_mediapipe(mesh), mesh,
                                                      with_outline};
        for (Method& method : methods) {
            for (std::size_t l = 0; l < landmarks.size(); ++l) {
                const FitResult fit = method.fitters.fit(landmarks[l], center_of(picture));
                method.subjects[l].push_back({person, face_of(model, fit)});
                method.fit_us += l == 2 ? fit.timing.total_us : 0.0;
            }
        }
    }
    for (const Method& method : methods) {
        std::printf("\nNeutral faces of four people, method %s, mean distance after alignment, mm\n"
                    "%-28s %6s %9s %9s %9s %9s\n",
                    method.name.c_str(), "landmarks", "photos", "same", "other", "ratio", "AUC");
        print_consistency("68 of dlib", method.subjects[0]);
        print_consistency("52 of the mesh as ibug68", method.subjects[1]);
        print_consistency("468 of the mesh", method.subjects[2]);
        print_consistency("these with dlib's outline", method.subjects[3]);
        std::printf("fit of 468 points: %.2f ms (mean)\n",
                    1e-3 * method.fit_us / static_cast<double>(method.subjects[2].size()));
    }
}

} // namespace

int main(int count, char** arguments)
{
    if (count != 2 && count != 3) {
        std::fprintf(stderr, "usage: scheme_bench DATA [MODEL.safetensors]\n");
        return 2;
    }
    try {
        const fs::path images = fs::path(arguments[1]) / "images";
        const MorphableModel model = count == 3 ? load_model(arguments[2]) : load_model(default_model_path());
        MeshDetector detector;
        measure_offsets(model, detector, images);
        measure_consistency(model, detector, images);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "scheme_bench: error: %s\n", error.what());
        return 1;
    }
}
