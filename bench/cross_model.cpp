// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Heads of another model, seen as 68 noisy landmarks, fitted with ours: is the result closer to the truth than the mean
// face? The truth is a mesh of another topology, so nothing of our model's prior is assumed.
//
//   bench/ict_heads.py FOLDER heads.safetensors       (ICT-FaceKit: modes of 100 scanned identities)
//   cross_model heads.safetensors [--heads 200] [--expressions none|ekman6]
//
// Coefficients ~ N(0, 1), yaw uniform in +-45 deg, pitch and roll with sd 8 and 5 deg, outer-eye distance 100 px, noise
// of 0 to 3 px (= 0 to 3 %) per coordinate. Distance: NoW protocol, scan vertex to predicted neutral surface, median
// per head. The regularisation is chosen on the even heads for all noise levels together, the table is of the odd
// heads.
#include "lineament/camera/angles.hpp"
#include "lineament/core/random.hpp"
#include "lineament/evaluation/now.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/io/safetensors.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

namespace lineament {
namespace {

struct ForeignModel
{
    Eigen::VectorXf neutral;   ///< 3V.
    Eigen::MatrixXf identity;  ///< 3V x m.
    Eigen::VectorXi landmarks; ///< 68.
};

template <typename Scalar>
Eigen::Map<const Eigen::VectorX<Scalar>> values_of(const Tensor& tensor)
{
    return {reinterpret_cast<const Scalar*>(tensor.elements.data()), static_cast<Eigen::Index>(tensor.num_elements())};
}

ForeignModel load_foreign_model(const std::string& path)
{
    const std::vector<std::byte> bytes = read_file(path);
    const Safetensors file = parse_safetensors(bytes, path);
    for (const char* name : {"neutral", "identity", "landmarks"}) {
        if (file.find(name) == nullptr) {
            throw IoError(IoErrorKind::content, path, "", std::string("tensor ") + name + " is missing");
        }
    }
    ForeignModel model;
    model.neutral = values_of<float>(*file.find("neutral"));
    const auto identity = values_of<float>(*file.find("identity"));
    model.identity = Eigen::Map<const Eigen::MatrixXf>(identity.data(), model.neutral.size(),
                                                       identity.size() / model.neutral.size());
    model.landmarks = values_of<int>(*file.find("landmarks"));
    return model;
}

struct Head
{
    Eigen::Matrix3Xd vertices;
    NowPoints now_points;
    LandmarkSet exact;           ///< Projected without noise.
    Eigen::Matrix2Xd unit_noise; ///< 2 x 68, N(0, 1): the same draws at every noise level.
};

Head make_head(const ForeignModel& foreign, Random& random)
{
    Eigen::VectorXf coefficients(foreign.identity.cols());
    for (float& coefficient : coefficients) {
        coefficient = static_cast<float>(random.normal());
    }
    const Eigen::VectorXf shape = foreign.neutral + foreign.identity * coefficients;
    Head head;
    head.vertices = Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3).cast<double>();
    const auto point = [&](int ibug) { return Eigen::Vector3d(head.vertices.col(foreign.landmarks[ibug - 1])); };
    for (std::size_t i = 0; i < now_point_names.size(); ++i) {
        head.now_points.col(static_cast<Eigen::Index>(i)) = point(std::stoi(now_point_names[i]));
    }
    Camera camera;
    camera.camera_from_model = rotation_from_angles(
        {radians(random.uniform(-45, 45)), radians(8 * random.normal()), radians(5 * random.normal())});
    camera.scale_px_per_mm = 100.0 / (point(37) - point(46)).norm();
    camera.principal_point_px = Eigen::Vector2d(320, 240);
    head.unit_noise.resize(2, 68);
    for (int ibug = 1; ibug <= 68; ++ibug) {
        head.exact.landmarks.push_back({std::to_string(ibug), camera.project(point(ibug)), 1.0});
        head.unit_noise.col(ibug - 1) << random.normal(), random.normal();
    }
    return head;
}

NowPoints now_points_of(const MorphableModel& model, const Eigen::VectorXf& shape)
{
    const LandmarkMap& map = *model.find_landmark_map("ibug68");
    const Eigen::Matrix3Xf points =
        map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()));
    NowPoints now;
    for (std::size_t i = 0; i < now_point_names.size(); ++i) {
        now.col(static_cast<Eigen::Index>(i)) = points.col(map.index_of(now_point_names[i])).cast<double>();
    }
    return now;
}

double median(std::vector<double> values)
{
    std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

/// Median distance of a head to a shape of our model [mm].
double distance(const Head& head, const MorphableModel& model, const Eigen::VectorXf& shape)
{
    constexpr int every = 5; // scan vertices used; the median of a thousand is enough
    Eigen::Matrix3Xd scan(3, (head.vertices.cols() + every - 1) / every);
    for (Eigen::Index i = 0; i < scan.cols(); ++i) {
        scan.col(i) = head.vertices.col(every * i);
    }
    const Eigen::Matrix3Xd prediction =
        Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()).cast<double>();
    return median(
        evaluate_now(scan, head.now_points, prediction, model.levels.back().triangles, now_points_of(model, shape))
            .distances_mm);
}

struct Comparison
{
    double fit_mm = 0.0;
    double mean_mm = 0.0;
    double paired_gain_mm = 0.0;
    double standard_error_mm = 0.0;
};

/// Fits the heads first, first + 2, ... at one noise level.
Comparison compare(const std::vector<Head>& heads, const std::vector<double>& mean_distances, std::size_t first,
                   const MorphableModel& model, const FitOptions& options, double noise_px)
{
    const FaceFitter fitter(model, "ibug68", options);
    Comparison result;
    double squares = 0.0;
    int count = 0;
    for (std::size_t h = first; h < heads.size(); h += 2) {
        LandmarkSet noisy = heads[h].exact;
        for (std::size_t i = 0; i < noisy.landmarks.size(); ++i) {
            noisy.landmarks[i].point_px += noise_px * heads[h].unit_noise.col(static_cast<Eigen::Index>(i));
        }
        const FitResult fit = fitter.fit(noisy, Eigen::Vector2d(320, 240));
        const double fitted = distance(heads[h], model, model.shape.instance(fit.shape_coefficients));
        const double gain = mean_distances[h] - fitted;
        result.fit_mm += fitted;
        result.mean_mm += mean_distances[h];
        result.paired_gain_mm += gain;
        squares += gain * gain;
        ++count;
    }
    result.fit_mm /= count;
    result.mean_mm /= count;
    result.paired_gain_mm /= count;
    result.standard_error_mm =
        std::sqrt((squares / count - result.paired_gain_mm * result.paired_gain_mm) / (count - 1));
    return result;
}

int run(const std::string& path, int num_heads, const std::string& expression_set, const std::string& contour)
{
    const ForeignModel foreign = load_foreign_model(path);
    const MorphableModel model = load_model(default_model_path());
    Random random(2026);
    std::vector<Head> heads;
    std::vector<double> mean_distances;
    for (int h = 0; h < num_heads; ++h) {
        heads.push_back(make_head(foreign, random));
        mean_distances.push_back(distance(heads.back(), model, model.shape.mean));
    }
    FitOptions options;
    options.expression_set = expression_set == "none" ? "" : expression_set;
    options.contour = contour == "off"     ? ContourMode::off
                      : contour == "front" ? ContourMode::front_facing
                                           : ContourMode::both;
    const std::vector<double> noise_levels_px = {0.0, 0.5, 1.0, 2.0, 3.0};

    std::printf("even heads: distance [mm] by regularisation and noise\n%-8s", "weight");
    for (const double noise : noise_levels_px) {
        std::printf(" %6.1f%%", noise);
    }
    std::printf("    all\n");
    double best = 0.0;
    double best_sum = std::numeric_limits<double>::infinity();
    for (const double regularization : {0.5, 1.0, 2.0, 4.0, 8.0}) {
        options.regularization = regularization;
        double sum = 0.0;
        std::printf("%-8.2f", regularization);
        for (const double noise : noise_levels_px) {
            const Comparison c = compare(heads, mean_distances, 0, model, options, noise);
            std::printf(" %7.3f", c.fit_mm);
            sum += c.fit_mm;
        }
        std::printf(" %7.3f\n", sum / static_cast<double>(noise_levels_px.size()));
        std::fflush(stdout);
        if (sum < best_sum) {
            best_sum = sum;
            best = regularization;
        }
    }
    std::printf("\nodd heads (%zu), regularisation %.2f, expressions %s, contour %s\n", heads.size() / 2, best,
                expression_set.c_str(), contour.c_str());
    std::printf("%-8s %9s %9s %9s %9s %9s\n", "noise", "mean face", "fit", "gain", "s.e.", "gain/mean");
    options.regularization = best;
    for (const double noise : noise_levels_px) {
        const Comparison c = compare(heads, mean_distances, 1, model, options, noise);
        std::printf("%5.1f %%  %8.3f  %8.3f  %8.3f  %8.3f  %7.1f %%\n", noise, c.mean_mm, c.fit_mm, c.paired_gain_mm,
                    c.standard_error_mm, 100.0 * c.paired_gain_mm / c.mean_mm);
    }
    return 0;
}

} // namespace
} // namespace lineament

int main(int argc, char** argv)
{
    std::string path;
    std::string expressions = "none";
    std::string contour = "both";
    int num_heads = 200;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument == "--heads" && i + 1 < argc) {
            num_heads = std::stoi(argv[++i]);
        } else if (argument == "--expressions" && i + 1 < argc) {
            expressions = argv[++i];
        } else if (argument == "--contour" && i + 1 < argc) {
            contour = argv[++i];
        } else {
            path = argument;
        }
    }
    if (path.empty() || num_heads < 4) {
        std::fprintf(stderr, "usage: cross_model heads.safetensors [--heads 200] [--expressions none|ekman6|arkit47] "
                             "[--contour off|front|both]\n");
        return 2;
    }
    try {
        return lineament::run(path, num_heads, expressions, contour);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "cross_model: %s\n", error.what());
        return 1;
    }
}
