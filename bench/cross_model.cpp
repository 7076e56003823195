// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Heads of another model, seen as 68 noisy landmarks, fitted with ours: is the result closer to the truth than the mean
// face? The truth is a mesh of another topology, whose landmarks another hand placed, so neither our prior nor our
// landmark vertices are assumed.
//
//   bench/ict_heads.py FOLDER heads.safetensors       (ICT-FaceKit: modes of 100 scanned identities)
//   cross_model heads.safetensors [--heads 400] [--expressions none|ekman6|arkit47]
//
// Coefficients ~ N(0, 1), yaw uniform in +-45 deg, pitch and roll with sd 8 and 5 deg, outer-eye distance 100 px, noise
// of 0 to 3 px (= 0 to 3 %) per coordinate. Distance: NoW protocol, scan vertex to predicted neutral surface, median
// per head. The regularisation is judged on the even heads, for all noise levels together; the tables are of the odd
// heads with the default one, the best on the even heads.
//
// The other model's jaw landmarks are fixed vertices on its cheeks, people and detectors mark the visible outline. So
// the jaw is given in two ways: on the outline, where the ray from the nose base through the fixed vertex leaves the
// face (nose excepted); and at the fixed vertices.
#include "lineament/camera/angles.hpp"
#include "lineament/core/closest_point.hpp"
#include "lineament/core/random.hpp"
#include "lineament/evaluation/now.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/io/safetensors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace lineament {
namespace {

const Eigen::Vector2d principal_point_px(320, 240);

/// Regions of a face, as ranges of ibug68 landmarks.
struct Region
{
    const char* name;
    int first;
    int last;
};
constexpr std::array<Region, 5> regions = {
    {{"jaw", 1, 17}, {"brows", 18, 27}, {"nose", 28, 36}, {"eyes", 37, 48}, {"mouth", 49, 68}}};

struct ForeignModel
{
    Eigen::VectorXf neutral;                   ///< 3V.
    Eigen::MatrixXf identity;                  ///< 3V x m.
    Eigen::VectorXi landmarks;                 ///< 68.
    Eigen::Matrix3Xi triangles;                ///< 3 x T.
    std::vector<std::size_t> region_of_vertex; ///< V, by the nearest landmark.
};

/// The region of each vertex.
std::vector<std::size_t> regions_of(const Eigen::VectorXf& shape, const Eigen::VectorXi& landmarks)
{
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(shape.data(), 3, shape.size() / 3);
    std::vector<std::size_t> result;
    for (const auto& vertex : vertices.colwise()) {
        Eigen::Index nearest = 0;
        (vertices(Eigen::all, landmarks).colwise() - vertex).colwise().squaredNorm().minCoeff(&nearest);
        std::size_t region = 0;
        while (nearest + 1 > regions[region].last) {
            ++region;
        }
        result.push_back(region);
    }
    return result;
}

template <typename Scalar>
Eigen::Map<const Eigen::VectorX<Scalar>> values_of(const Tensor& tensor)
{
    return {reinterpret_cast<const Scalar*>(tensor.elements.data()), static_cast<Eigen::Index>(tensor.num_elements())};
}

ForeignModel load_foreign_model(const std::string& path)
{
    const std::vector<std::byte> bytes = read_file(path);
    const Safetensors file = parse_safetensors(bytes, path);
    for (const char* name : {"neutral", "identity", "landmarks", "triangles"}) {
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
    const auto triangles = values_of<int>(*file.find("triangles"));
    model.triangles = Eigen::Map<const Eigen::Matrix3Xi>(triangles.data(), 3, triangles.size() / 3);
    model.region_of_vertex = regions_of(model.neutral, model.landmarks);
    return model;
}

enum class Jaw
{
    outline,  ///< On the visible outline of the face.
    vertices, ///< At fixed vertices.
};

struct Head
{
    Eigen::Matrix3Xd vertices;
    NowPoints now_points;
    Eigen::Matrix2Xd exact_px[2]; ///< 2 x 68, projected without noise, by Jaw.
    Eigen::Matrix2Xd unit_noise;  ///< 2 x 68, N(0, 1): the same draws at every noise level.
};

/// The last point of the edges on the ray from `origin` through `through`, or `through` if none lies on it.
Eigen::Vector2d leave_edges(const Eigen::Matrix2Xd& points, const std::vector<std::array<int, 2>>& edges,
                            const Eigen::Vector2d& origin, const Eigen::Vector2d& through)
{
    const Eigen::Vector2d direction = (through - origin).normalized();
    double last = 0.0;
    for (const auto& [a, b] : edges) {
        const Eigen::Vector2d p = points.col(a) - origin;
        const Eigen::Vector2d q = points.col(b) - origin;
        const double side_p = direction.x() * p.y() - direction.y() * p.x();
        const double side_q = direction.x() * q.y() - direction.y() * q.x();
        if ((side_p < 0.0) != (side_q < 0.0)) {
            last = std::max(last, direction.dot(p + side_p / (side_p - side_q) * (q - p)));
        }
    }
    return last > 0.0 ? Eigen::Vector2d(origin + last * direction) : through;
}

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
    camera.principal_point_px = principal_point_px;

    constexpr double nose_radius_mm = 35.0; // about the tip: in a half profile the nose reaches beyond the cheek
    std::vector<std::array<int, 2>> edges;
    for (const auto& triangle : foreign.triangles.colwise()) {
        for (int k = 0; k < 3; ++k) {
            const std::array<int, 2> edge = {triangle[k], triangle[(k + 1) % 3]};
            if ((head.vertices.col(edge[0]) - point(31)).norm() > nose_radius_mm) {
                edges.push_back(edge);
            }
        }
    }
    const Eigen::Matrix2Xd vertices_px = camera.project(Eigen::Ref<const Eigen::Matrix3Xd>(head.vertices));
    Eigen::Matrix2Xd& outline = head.exact_px[static_cast<int>(Jaw::outline)];
    Eigen::Matrix2Xd& vertices = head.exact_px[static_cast<int>(Jaw::vertices)];
    vertices.resize(2, 68);
    head.unit_noise.resize(2, 68);
    for (int ibug = 1; ibug <= 68; ++ibug) {
        vertices.col(ibug - 1) = vertices_px.col(foreign.landmarks[ibug - 1]);
        head.unit_noise.col(ibug - 1) << random.normal(), random.normal();
    }
    outline = vertices;
    for (int ibug = 1; ibug <= 17; ++ibug) {
        if (ibug != 9) { // the chin
            outline.col(ibug - 1) = leave_edges(vertices_px, edges, vertices.col(33), vertices.col(ibug - 1));
        }
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

double quantile(std::vector<double> values, double part)
{
    const auto nth = values.begin() + std::lround(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
}

struct Distance
{
    double median_mm = 0.0;
    std::array<double, regions.size()> region_mean_mm = {};
};

/// Distances of a head to a shape of our model.
Distance distance(const Head& head, const ForeignModel& foreign, const MorphableModel& model,
                  const Eigen::VectorXf& shape)
{
    constexpr Eigen::Index every = 15; // scan vertices used: 400 in the crop, enough for a median
    Eigen::Matrix3Xd scan(3, (head.vertices.cols() + every - 1) / every);
    for (Eigen::Index i = 0; i < scan.cols(); ++i) {
        scan.col(i) = head.vertices.col(every * i);
    }
    const Eigen::Matrix3Xd prediction =
        Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()).cast<double>();
    const Eigen::Matrix3Xi& triangles = model.levels.back().triangles;
    const NowResult now = evaluate_now(scan, head.now_points, prediction, triangles, now_points_of(model, shape));
    Distance result;
    result.median_mm = quantile(now.distances_mm, 0.5);

    const ClosestPointTree surface(now.scan_from_prediction * prediction, triangles);
    std::array<int, regions.size()> counts = {};
    for (Eigen::Index i = 0; i < scan.cols(); ++i) {
        const std::size_t region = foreign.region_of_vertex[static_cast<std::size_t>(every * i)];
        result.region_mean_mm[region] += surface.closest(scan.col(i)).distance;
        ++counts[region];
    }
    for (std::size_t r = 0; r < regions.size(); ++r) {
        result.region_mean_mm[r] /= counts[r];
    }
    return result;
}

/// One head, the mean face against the fit.
struct Pair
{
    Distance mean_face;
    Distance fit;
};

struct Comparison
{
    double mean_face_mm = 0.0;
    double fit_mm = 0.0;
    double standard_error_mm = 0.0; ///< Of the mean paired difference.

    explicit Comparison(const std::vector<Pair>& pairs)
    {
        double squares = 0.0;
        const double count = static_cast<double>(pairs.size());
        for (const Pair& pair : pairs) {
            mean_face_mm += pair.mean_face.median_mm / count;
            fit_mm += pair.fit.median_mm / count;
            squares += std::pow(pair.mean_face.median_mm - pair.fit.median_mm, 2) / count;
        }
        standard_error_mm = std::sqrt((squares - gain_mm() * gain_mm()) / (count - 1));
    }

    [[nodiscard]] double gain_mm() const { return mean_face_mm - fit_mm; }
    [[nodiscard]] double percent(double mm) const { return 100.0 * mm / mean_face_mm; }
};

using FitFunction = std::function<FitResult(const LandmarkSet&)>;

class Experiment
{
public:
    Experiment(const std::string& path, int num_heads)
        : foreign_(load_foreign_model(path)), model_(load_model(default_model_path()))
    {
        Random random(2026);
        for (int h = 0; h < num_heads; ++h) {
            heads_.push_back(make_head(foreign_, random));
            mean_distances_.push_back(distance(heads_.back(), foreign_, model_, model_.shape.mean));
        }
    }

    [[nodiscard]] const MorphableModel& model() const { return model_; }

    /// The thesis's fit with these options.
    [[nodiscard]] FitFunction fit_with(const FitOptions& options) const
    {
        return [fitter = FaceFitter(model_, "ibug68", options)](const LandmarkSet& landmarks) {
            return fitter.fit(landmarks, principal_point_px);
        };
    }

    /// The joint fit with these options.
    [[nodiscard]] FitFunction fit_with(const JointOptions& options) const
    {
        return [fitter = JointFitter(model_, "ibug68", options)](const LandmarkSet& landmarks) {
            return fitter.fit(landmarks, principal_point_px).fit;
        };
    }

    /// Fits the heads first, first + 2, ... at one noise level.
    [[nodiscard]] std::vector<Pair> compare(std::size_t first, Jaw jaw, const FitFunction& fit, double noise_px) const
    {
        std::vector<Pair> pairs;
        for (std::size_t h = first; h < heads_.size(); h += 2) {
            const Eigen::Matrix2Xd points = heads_[h].exact_px[static_cast<int>(jaw)] + noise_px * heads_[h].unit_noise;
            LandmarkSet landmarks;
            for (int i = 0; i < 68; ++i) {
                landmarks.landmarks.push_back({std::to_string(i + 1), points.col(i), 1.0});
            }
            const FitResult result = fit(landmarks);
            pairs.push_back({mean_distances_[h],
                             distance(heads_[h], foreign_, model_, model_.shape.instance(result.shape_coefficients))});
        }
        return pairs;
    }

private:
    ForeignModel foreign_;
    MorphableModel model_;
    std::vector<Head> heads_ = {};
    std::vector<Distance> mean_distances_ = {};
};

constexpr std::array<double, 5> noise_levels_px = {0.0, 0.5, 1.0, 2.0, 3.0};

void print_noise_heading(const char* title, const char* row)
{
    std::printf("\neven heads, jaw on the outline, %s: distance [mm] by noise\n%-8s", title, row);
    for (const double noise : noise_levels_px) {
        std::printf(" %6.1f%%", noise);
    }
    std::printf("     all\n");
}

/// One row: mean distance of the even heads at each level, and their mean.
void print_even_heads(const Experiment& experiment, double row, const FitFunction& fit)
{
    double sum = 0.0;
    std::printf("%-8.1f", row);
    for (const double noise : noise_levels_px) {
        const Comparison comparison(experiment.compare(0, Jaw::outline, fit, noise));
        std::printf(" %7.3f", comparison.fit_mm);
        sum += comparison.fit_mm;
    }
    std::printf(" %7.3f\n", sum / static_cast<double>(noise_levels_px.size()));
    std::fflush(stdout);
}

/// What the default noise of FitOptions was chosen by.
void print_regularizations(const Experiment& experiment, FitOptions options)
{
    print_noise_heading("FaceFitter", "weight");
    for (const double regularization : {0.5, 0.7, 1.0, 1.4, 2.0}) {
        options.regularization = regularization;
        print_even_heads(experiment, regularization, experiment.fit_with(options));
    }
}

/// What the default noise of JointOptions was chosen by.
void print_outline_noise(const Experiment& experiment, JointOptions options)
{
    print_noise_heading("JointFitter", "outline");
    for (const double sigma_mm : {4.0, 6.0, 8.0, 10.0, 12.0, 16.0}) {
        options.contour_sigma_mm = sigma_mm;
        print_even_heads(experiment, sigma_mm, experiment.fit_with(options));
    }
}

void print_by_noise(const Experiment& experiment, const char* title, Jaw jaw, const FitFunction& fit)
{
    std::printf("\nodd heads, %s\n", title);
    std::printf("noise   mean face       fit      gain      s.e.   gain    s.e.   heads better\n");
    for (const double noise : noise_levels_px) {
        const std::vector<Pair> pairs = experiment.compare(1, jaw, fit, noise);
        const Comparison c(pairs);
        const auto better = std::count_if(
            pairs.begin(), pairs.end(), [](const Pair& pair) { return pair.fit.median_mm < pair.mean_face.median_mm; });
        std::printf("%.1f %%   %6.3f mm %6.3f mm %6.3f mm %6.3f mm %4.1f %%  %4.1f %%   %td of %zu\n", noise,
                    c.mean_face_mm, c.fit_mm, c.gain_mm(), c.standard_error_mm, c.percent(c.gain_mm()),
                    c.percent(c.standard_error_mm), better, pairs.size());
        std::fflush(stdout);
    }
}

/// Where the fit gains and loses, and how much the worst heads lose, at 1 % noise.
void print_regions(const Experiment& experiment, const FitFunction& fit)
{
    const std::vector<Pair> pairs = experiment.compare(1, Jaw::outline, fit, 1.0);
    std::printf("\nodd heads, jaw on the outline, 1 %% noise: mean distance by region (nearest landmark)\n");
    for (std::size_t r = 0; r < regions.size(); ++r) {
        double mean_face = 0.0;
        double fitted = 0.0;
        for (const Pair& pair : pairs) {
            mean_face += pair.mean_face.region_mean_mm[r] / static_cast<double>(pairs.size());
            fitted += pair.fit.region_mean_mm[r] / static_cast<double>(pairs.size());
        }
        std::printf("%-6s mean face %6.3f mm, fit %6.3f mm, gain %5.1f %%\n", regions[r].name, mean_face, fitted,
                    100.0 * (mean_face - fitted) / mean_face);
    }
    std::vector<double> gains;
    for (const Pair& pair : pairs) {
        gains.push_back(pair.mean_face.median_mm - pair.fit.median_mm);
    }
    std::printf("gain of a head [mm]: worst %.2f, 10 %% %.2f, median %.2f, 90 %% %.2f, best %.2f\n",
                quantile(gains, 0.0), quantile(gains, 0.1), quantile(gains, 0.5), quantile(gains, 0.9),
                quantile(gains, 1.0));
}

int run(const std::string& path, int num_heads, const std::string& expressions)
{
    const Experiment experiment(path, num_heads);
    FitOptions options;
    options.expression_set = expressions == "none" ? "" : expressions;
    JointOptions joint_options;
    joint_options.expression_set = options.expression_set;
    print_regularizations(experiment, options);
    print_outline_noise(experiment, joint_options);
    print_by_noise(experiment, "jaw on the outline", Jaw::outline, experiment.fit_with(options));
    print_regions(experiment, experiment.fit_with(options));
    print_by_noise(experiment, "jaw at fixed vertices", Jaw::vertices, experiment.fit_with(options));
    print_by_noise(experiment, "jaw on the outline, JointFitter", Jaw::outline, experiment.fit_with(joint_options));
    options.contour = ContourMode::ignored;
    print_by_noise(experiment, "jaw ignored but for the chin", Jaw::outline, experiment.fit_with(options));
    return 0;
}

} // namespace
} // namespace lineament

int main(int argc, char** argv)
{
    std::string path;
    std::string expressions = lineament::FitOptions().expression_set;
    int num_heads = 400;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument == "--heads" && i + 1 < argc) {
            num_heads = std::atoi(argv[++i]);
        } else if (argument == "--expressions" && i + 1 < argc) {
            expressions = argv[++i];
        } else {
            path = argument;
        }
    }
    if (path.empty() || num_heads < 4) {
        std::fprintf(stderr,
                     "usage: cross_model heads.safetensors [--heads 400] [--expressions none|ekman6|arkit47]\n");
        return 2;
    }
    try {
        return lineament::run(path, num_heads, expressions);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "cross_model: error: %s\n", error.what());
        return 1;
    }
}
