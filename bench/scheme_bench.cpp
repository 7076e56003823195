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
#include <optional>

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
    Eigen::Matrix3Xd face;        ///< Neutral, on the face mask.
    Eigen::VectorXd coefficients; ///< Of shape.
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

/// Mean distance of the vertices after alignment, mm.
double distance_of_faces(const Subject& a, const Subject& b)
{
    return (align_points(a.face, b.face) * a.face - b.face).colwise().norm().mean();
}

/// In standard deviations of the model.
double distance_of_coefficients(const Subject& a, const Subject& b)
{
    return (a.coefficients - b.coefficients).norm();
}

/// A pair of photos and how far apart their faces are.
struct Pair
{
    std::size_t first, second;
    bool is_same_person;
    double distance;
};

std::vector<Pair> pairs_of(const std::vector<Subject>& subjects, double (*distance)(const Subject&, const Subject&))
{
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < subjects.size(); ++i) {
        for (std::size_t k = i + 1; k < subjects.size(); ++k) {
            pairs.push_back({i, k, subjects[i].person == subjects[k].person, distance(subjects[i], subjects[k])});
        }
    }
    return pairs;
}

/// The share of a pair of one person and one of two in which the former is nearer.
/// @param left_out  A photo whose pairs do not count, if any.
double area_under_curve(const std::vector<Pair>& pairs, std::optional<std::size_t> left_out = std::nullopt)
{
    std::vector<double> same, different;
    for (const Pair& pair : pairs) {
        if (pair.first != left_out && pair.second != left_out) {
            (pair.is_same_person ? same : different).push_back(pair.distance);
        }
    }
    double num_in_order = 0.0;
    for (const double a : same) {
        for (const double b : different) {
            num_in_order += a < b ? 1.0 : 0.0;
        }
    }
    return num_in_order / static_cast<double>(same.size() * different.size());
}

double mean_distance(const std::vector<Pair>& pairs, bool is_same_person)
{
    double sum = 0.0, count = 0.0;
    for (const Pair& pair : pairs) {
        if (pair.is_same_person == is_same_person) {
            sum += pair.distance;
            ++count;
        }
    }
    return sum / count;
}

void print_consistency(const char* what, const std::vector<Subject>& subjects)
{
    const std::vector<Pair> faces = pairs_of(subjects, distance_of_faces);
    const double same = mean_distance(faces, true), different = mean_distance(faces, false);
    std::printf("%-28s %6zu %9.2f %9.2f %9.3f %9.3f %9.3f\n", what, subjects.size(), same, different, same / different,
                area_under_curve(faces), area_under_curve(pairs_of(subjects, distance_of_coefficients)));
}

/// How much larger the area is by one method than by another, of the same photos, and by the jackknife over these its
/// standard error.
void print_difference(const std::vector<Subject>& one, const std::vector<Subject>& other,
                      double (*distance)(const Subject&, const Subject&))
{
    const std::vector<Pair> pairs = pairs_of(one, distance), other_pairs = pairs_of(other, distance);
    const std::size_t count = one.size();
    Eigen::ArrayXd without(count);
    for (std::size_t i = 0; i < count; ++i) {
        without[static_cast<Eigen::Index>(i)] = area_under_curve(pairs, i) - area_under_curve(other_pairs, i);
    }
    const double n = static_cast<double>(count);
    std::printf("  %7.3f (%.3f)", area_under_curve(pairs) - area_under_curve(other_pairs),
                std::sqrt((n - 1) / n * (without - without.mean()).square().sum()));
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
                method.subjects[l].push_back({person, face_of(model, fit), fit.shape_coefficients});
                method.fit_us += l == 2 ? fit.timing.total_us : 0.0;
            }
        }
    }
    constexpr std::array<const char*, 4> landmark_names = {"68 of dlib", "52 of the mesh as ibug68", "468 of the mesh",
                                                           "these with dlib's outline"};
    for (const Method& method : methods) {
        std::printf(
            "\nNeutral faces of four people, method %s, mean distance after alignment, mm; area under the curve\n"
            "by it and by the distance of the coefficients\n"
            "%-28s %6s %9s %9s %9s %9s %9s\n",
            method.name.c_str(), "landmarks", "photos", "same", "other", "ratio", "AUC, mm", "AUC, sd");
        for (std::size_t l = 0; l < landmark_names.size(); ++l) {
            print_consistency(landmark_names[l], method.subjects[l]);
        }
        std::printf("fit of 468 points: %.2f ms (mean)\n",
                    1e-3 * method.fit_us / static_cast<double>(method.subjects[2].size()));
    }
    std::printf("\nArea under the curve of joint minus that of thesis, standard error by the jackknife over photos\n");
    for (std::size_t l = 0; l < landmark_names.size(); ++l) {
        std::printf("%-28s", landmark_names[l]);
        print_difference(methods[1].subjects[l], methods[0].subjects[l], distance_of_faces);
        print_difference(methods[1].subjects[l], methods[0].subjects[l], distance_of_coefficients);
        std::printf("\n");
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
