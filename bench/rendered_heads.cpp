// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Heads of another model as pictures: where do the detectors find them, and how near to the truth are pose and identity
// of the faces fitted to what they find?
//
//   bench/ict_heads.py FOLDER heads.safetensors       (ICT-FaceKit: modes of 100 scanned identities)
//   rendered_heads heads.safetensors [--heads 400] [--views 5] [--method thesis] [--outline-mm 4] [--depth-ratio 5]
//   [--distance-mm 0] [--pictures FOLDER]
//
// The heads and first views are those of cross_model (scaled orthographic; --distance-mm: perspective); further views
// of a head are drawn alike. The program paints and renders them, 640 x 480, and fits with default options: the true 68
// landmarks (jaw on the outline), the true 52 without the outline but the chin, 68 of DlibDetector, 52 of MeshDetector
// as ibug68, all 478 as the program fits them.
//
// Tables are of the odd heads that every source has; what is chosen or estimated is so on the even ones. Identity: NoW
// protocol. --pictures: each picture, and beside it the points of MeshDetector (green), of DlibDetector (red) and the
// true ones (white). Pose has two measures, as the axes of the two models differ:
//
//   laid on: the fitted neutral surface is laid on the true head (alignment of the NoW protocol); the angle left;
//   offset:  R_fit^T R_true has a mean on the even heads, for each source; the angle of the rest.
#include "foreign_heads.hpp"
#include "head_pictures.hpp"
#include "options.hpp"
#include "photo_sets.hpp"

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/mesh_detector.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace lineament;
using namespace lineament::bench;

enum Source
{
    exact,
    exact_52, ///< Those that MeshDetector 52 has.
    dlib,
    mesh_52,
    mesh_478,
    num_sources,
};
constexpr std::array<const char*, num_sources> source_names = {"true 68", "true 52", "DlibDetector 68",
                                                               "MeshDetector 52", "MeshDetector 478"};
template <typename Value>
using BySource = std::array<Value, num_sources>;

/// A view of a head with the landmarks of each source that found it.
struct Sighting
{
    View view;
    BySource<std::optional<LandmarkSet>> landmarks;
    std::array<std::optional<double>, 2> error_percent = {}; ///< DlibDetector, MeshDetector; points 18 ... 68.
};

double yaw_deg(const Sighting& sighting)
{
    return degrees(angles_from_rotation(sighting.view.camera.camera_from_model).yaw);
}

struct Subject
{
    Head head;
    std::vector<Sighting> sightings;
    Distance mean_face;

    [[nodiscard]] bool has_all() const
    {
        return std::all_of(sightings[0].landmarks.begin(), sightings[0].landmarks.end(),
                           [](const auto& landmarks) { return landmarks.has_value(); });
    }
};

class Observer
{
public:
    Observer(const std::string& path, std::string picture_folder)
        : pictures_(path), picture_folder_(std::move(picture_folder))
    {}

    [[nodiscard]] Sighting look(const Head& head, const View& view, Random& random)
    {
        const ImageU8 picture = pictures_.render(head.coefficients, view.camera, random);
        Sighting result = {view, {}, {}};
        const LandmarkSet truth = as_ibug68(view.exact_px[static_cast<int>(Jaw::outline)]);
        result.landmarks[exact] = truth;
        result.landmarks[exact_52] = LandmarkSet();
        for (const Landmark& landmark : truth.landmarks) {
            if (const int ibug = std::stoi(landmark.name); ibug == 9 || ibug > 17) {
                result.landmarks[exact_52]->landmarks.push_back(landmark);
            }
        }
        for (const DetectedFace& face : face_detector_.detect(picture)) {
            if (const double error = error_percent(face.landmarks, truth); error < other_face_percent) {
                result.landmarks[dlib] = face.landmarks;
                result.error_percent[0] = error;
            } else {
                ++num_false_alarms[0];
            }
        }
        for (const MeshFace& face : mesh_detector_.detect(picture)) {
            const LandmarkSet as_ibug = ibug68_from_mediapipe(face.landmarks);
            if (const double error = error_percent(as_ibug, truth); error < other_face_percent) {
                result.landmarks[mesh_52] = as_ibug;
                result.landmarks[mesh_478] = face.landmarks;
                result.error_percent[1] = error;
            } else {
                ++num_false_alarms[1];
            }
        }
        if (!picture_folder_.empty()) {
            save(picture, result);
        }
        return result;
    }

    std::array<int, 2> num_false_alarms = {};

private:
    /// The picture, and beside it the mesh's points (green), DlibDetector's (red) and the true ones (white).
    void save(const ImageU8& picture, const Sighting& sighting)
    {
        ImageU8 sheet(2 * picture.width, picture.height, 3);
        paste(sheet, picture, 0, 0);
        paste(sheet, picture, picture.width, 0);
        const auto draw = [&](Source source, const Color& color, double radius) {
            if (sighting.landmarks[source]) {
                for (const Landmark& landmark : sighting.landmarks[source]->landmarks) {
                    draw_disc(sheet, landmark.point_px + Eigen::Vector2d(picture.width, 0), radius, color);
                }
            }
        };
        draw(mesh_478, {40, 220, 60}, 1.0);
        draw(exact, {255, 255, 255}, 1.8);
        draw(dlib, {230, 30, 30}, 1.5);
        const std::string name =
            std::to_string(num_saved_++) + "_yaw" + std::to_string(std::lround(yaw_deg(sighting))) + ".png";
        save_png(picture_folder_ + "/" + name, sheet);
    }

    HeadPictures pictures_;
    std::string picture_folder_;
    DlibDetector face_detector_ = DlibDetector();
    MeshDetector mesh_detector_ = MeshDetector();
    int num_saved_ = 0;
};

void print_detections(const std::vector<Subject>& subjects, const Observer& observer)
{
    std::printf("views found, and the detectors' error: median over points 18 to 68, %% of the outer-eye distance\n"
                "|yaw|        views   DlibDetector   error   MeshDetector   error\n");
    for (const auto& [from, to] : {std::pair(0, 15), std::pair(15, 30), std::pair(30, 45), std::pair(0, 45)}) {
        int num_views = 0;
        std::array<std::vector<double>, 2> errors;
        for (const Subject& subject : subjects) {
            for (const Sighting& sighting : subject.sightings) {
                const double yaw = std::abs(yaw_deg(sighting));
                if (yaw >= from && yaw < to) {
                    ++num_views;
                    for (std::size_t d = 0; d < errors.size(); ++d) {
                        if (sighting.error_percent[d]) {
                            errors[d].push_back(*sighting.error_percent[d]);
                        }
                    }
                }
            }
        }
        std::printf("%2d to %2d deg %6d %14zu %7.2f %14zu %7.2f\n", from, to, num_views, errors[0].size(),
                    median(errors[0]), errors[1].size(), median(errors[1]));
    }
    std::printf("found elsewhere: DlibDetector %d, MeshDetector %d\n\n", observer.num_false_alarms[0],
                observer.num_false_alarms[1]);
    std::fflush(stdout);
}

/// One fit to one view or to all views of a head.
struct Fit
{
    Eigen::VectorXd shape_coefficients;
    Eigen::Matrix3d camera_from_model; ///< Of the first view.
    Distance distance;
};

/// The fits of the heads that every source has; the heads keep their parity.
struct Fits
{
    std::vector<const Subject*> subjects = {};
    BySource<std::vector<Fit>> of = {};
};

class Bench
{
public:
    Bench(const std::string& path, const Options& options)
        : foreign_(load_foreign_model(path)), model_(load_model(default_model_path())),
          sparse_(model_, "ibug68", with_outline(options.count("--outline-mm", 4, 1))), dense_(model_, "mediapipe478"),
          num_views_(options.count("--views", 5, 1))
    {
        if (options.text("--method", "thesis") == "joint") {
            const kernels::Kernels& kernels = kernels::dispatched_kernels();
            joint_sparse_.emplace(model_, "ibug68", JointOptions{}, &kernels);
            JointOptions dense;
            dense.bias_depth_ratio = options.count("--depth-ratio", 5, 1);
            joint_dense_.emplace(model_, "mediapipe478", dense, &kernels);
        }
        const int distance_mm = options.count("--distance-mm", 0, 0);
        const double phi_per_mm = distance_mm > 0 ? 1.0 / distance_mm : 0.0;
        Observer observer(path, options.text("--pictures", ""));
        Random random(2026); // of cross_model
        Random others(2027);
        for (int h = 0; h < options.count("--heads", 400, 8); ++h) {
            Subject subject = {make_head(foreign_, random), {}, {}};
            for (int v = 0; v < num_views_; ++v) {
                const View view = make_view(foreign_, subject.head, v == 0 ? random : others, phi_per_mm);
                subject.sightings.push_back(observer.look(subject.head, view, others));
            }
            subject.mean_face = distance_to(subject, model_.shape.mean);
            subjects_.push_back(std::move(subject));
        }
        print_detections(subjects_, observer);
    }

    void run() const
    {
        std::array<Fits, 2> halves;
        std::array<Fits, 2> halves_of_all_views;
        for (std::size_t h = 0; h < subjects_.size(); ++h) {
            if (subjects_[h].has_all()) {
                add(halves[h % 2], subjects_[h], 1);
                if (num_views_ > 1) {
                    add(halves_of_all_views[h % 2], subjects_[h], num_views_);
                }
            }
        }
        print_poses(halves);
        print_identities(halves, "one view");
        print_regions(halves[1]);
        print_stretched(halves, "one view");
        if (num_views_ > 1) {
            const std::string views = std::to_string(num_views_) + " views";
            print_identities(halves_of_all_views, views);
            print_more_views(halves[1], halves_of_all_views[1]);
            print_stretched(halves_of_all_views, views);
        }
        if (!joint_sparse_) {
            print_regularizations(halves[0]);
        }
    }

private:
    static FitOptions with_outline(double sigma_mm)
    {
        FitOptions options;
        options.contour_sigma_mm = sigma_mm;
        return options;
    }

    [[nodiscard]] Distance distance_to(const Subject& subject, const Eigen::VectorXf& shape) const
    {
        return distance(subject.head, foreign_, model_, shape);
    }

    [[nodiscard]] const FaceFitter& fitter(std::size_t source) const { return source == mesh_478 ? dense_ : sparse_; }

    void add(Fits& fits, const Subject& subject, int num_views) const
    {
        fits.subjects.push_back(&subject);
        for (std::size_t s = 0; s < num_sources; ++s) {
            std::vector<LandmarkSet> frames;
            for (int v = 0; v < num_views; ++v) {
                if (const auto& landmarks = subject.sightings[static_cast<std::size_t>(v)].landmarks[s]) {
                    frames.push_back(*landmarks);
                }
            }
            Fit fit;
            if (joint_sparse_) {
                const JointFramesResult result =
                    (s == mesh_478 ? joint_dense_ : joint_sparse_)->fit_frames(frames, principal_point_px);
                fit.shape_coefficients = result.shape_coefficients;
                fit.camera_from_model = result.frames[0].fit.camera.camera_from_model;
            } else if (num_views == 1) {
                const FitResult result = fitter(s).fit(frames[0], principal_point_px);
                fit.shape_coefficients = result.shape_coefficients;
                fit.camera_from_model = result.camera.camera_from_model;
            } else {
                const MultiFrameResult result = fit_frames(fitter(s), frames, principal_point_px);
                fit.shape_coefficients = result.shape_coefficients;
                fit.camera_from_model = result.frames[0].camera.camera_from_model;
            }
            fit.distance = distance_to(subject, model_.shape.instance(fit.shape_coefficients));
            fits.of[s].push_back(std::move(fit));
        }
    }

    static void print_poses(const std::array<Fits, 2>& halves)
    {
        std::printf(
            "pose, odd heads, one view: angle between true and fitted [deg]; slopes: of the fitted angle (laid on) "
            "over the true one\n"
            "%-17s %5s   laid on: median   mean  s.e.    90%%    offset: median   mean  s.e.    90%%   the offset"
            "   slopes: yaw  pitch\n",
            "", "heads");
        const auto true_rotation = [](const Subject& subject) {
            return subject.sightings[0].view.camera.camera_from_model;
        };
        for (std::size_t s = 0; s < num_sources; ++s) {
            Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
            for (std::size_t i = 0; i < halves[0].subjects.size(); ++i) {
                sum += halves[0].of[s][i].camera_from_model.transpose() * true_rotation(*halves[0].subjects[i]);
            }
            const Eigen::Matrix3d offset = nearest_rotation(sum);
            std::array<std::vector<double>, 2> errors_deg;
            std::array<std::vector<Eigen::Vector2d>, 2> angles; // yaw, pitch: true and fitted
            for (std::size_t i = 0; i < halves[1].subjects.size(); ++i) {
                const Fit& fit = halves[1].of[s][i];
                const Eigen::Matrix3d truth = true_rotation(*halves[1].subjects[i]);
                const Eigen::Matrix3d laid_on = fit.camera_from_model * fit.distance.foreign_from_model.transpose();
                errors_deg[0].push_back(angle_deg(laid_on.transpose() * truth));
                errors_deg[1].push_back(angle_deg((fit.camera_from_model * offset).transpose() * truth));
                const HeadAngles is = angles_from_rotation(laid_on);
                const HeadAngles should = angles_from_rotation(truth);
                angles[0].emplace_back(should.yaw, is.yaw);
                angles[1].emplace_back(should.pitch, is.pitch);
            }
            std::printf("%-17s %5zu", source_names[s], halves[1].subjects.size());
            for (const std::vector<double>& errors : errors_deg) {
                std::printf(" %17.2f %6.2f %5.2f %6.2f", median(errors), mean(errors), standard_error(errors),
                            quantile(errors, 0.9));
            }
            std::printf(" %12.2f %13.2f %6.2f\n", angle_deg(offset), slope(angles[0]), slope(angles[1]));
        }
        std::printf("\n");
        std::fflush(stdout);
    }

    /// Coefficients base + factor (those of the fit - center).
    struct Stretch
    {
        const char* name;
        Eigen::VectorXd base;
        Eigen::VectorXd center;
    };

    /// The shapes of the fits stretched, against the mean face.
    [[nodiscard]] std::vector<Pair> stretched(const Fits& fits, std::size_t source, const Stretch& stretch,
                                              double factor) const
    {
        std::vector<Pair> pairs;
        for (std::size_t i = 0; i < fits.subjects.size(); ++i) {
            const Subject& subject = *fits.subjects[i];
            const Fit& fit = fits.of[source][i];
            const Eigen::VectorXd shape = stretch.base + factor * (fit.shape_coefficients - stretch.center);
            pairs.push_back({subject.mean_face, distance_to(subject, model_.shape.instance(shape))});
        }
        return pairs;
    }

    /// The mean shape of the fits of a source.
    [[nodiscard]] Eigen::VectorXd common_shape(const Fits& fits, std::size_t source) const
    {
        Eigen::VectorXd sum = Eigen::VectorXd::Zero(model_.shape.num_coefficients());
        for (const Fit& fit : fits.of[source]) {
            sum += fit.shape_coefficients;
        }
        return sum / static_cast<double>(fits.of[source].size());
    }

    /// The change of distance from one kind of fit to another on the same heads.
    static Comparison change(const std::vector<Pair>& from, const std::vector<Pair>& to)
    {
        std::vector<Pair> pairs;
        for (std::size_t i = 0; i < from.size(); ++i) {
            pairs.push_back({from[i].fit, to[i].fit});
        }
        return Comparison(pairs);
    }

    static std::vector<Pair> as_fitted(const Fits& fits, std::size_t source)
    {
        std::vector<Pair> pairs;
        for (std::size_t i = 0; i < fits.subjects.size(); ++i) {
            pairs.push_back({fits.subjects[i]->mean_face, fits.of[source][i].distance});
        }
        return pairs;
    }

    /// The gain against the mean face, and what of it is the same for all heads.
    void print_identities(const std::array<Fits, 2>& halves, const std::string& views) const
    {
        std::printf(
            "identity, odd heads, %s: distance [mm]; common: mean shape of the even heads' fits\n"
            "%-17s %5s  mean face     fit    gain    s.e.   gain   s.e.  better  common  fit - common    s.e.\n",
            views.c_str(), "", "heads");
        for (std::size_t s = 0; s < num_sources; ++s) {
            const std::vector<Pair> fitted = as_fitted(halves[1], s);
            const Comparison c(fitted);
            const Eigen::VectorXd common = common_shape(halves[0], s);
            const Comparison from_common = change(stretched(halves[1], s, {"", common, common}, 0.0), fitted);
            std::printf("%-17s %5zu %10.3f %7.3f %7.3f %7.3f %5.1f%% %5.1f%% %7td %7.3f %13.3f %7.3f\n",
                        source_names[s], fitted.size(), c.mean_face_mm, c.fit_mm, c.gain_mm(), c.standard_error_mm,
                        c.percent(c.gain_mm()), c.percent(c.standard_error_mm), num_better(fitted),
                        from_common.mean_face_mm, -from_common.gain_mm(), from_common.standard_error_mm);
        }
        std::printf("distance of MeshDetector 478 minus that of:");
        for (std::size_t s = 0; s < mesh_478; ++s) {
            const Comparison c = change(as_fitted(halves[1], s), as_fitted(halves[1], mesh_478));
            std::printf("  %s %.3f (s.e. %.3f)", source_names[s], -c.gain_mm(), c.standard_error_mm);
        }
        std::printf("\n\n");
        std::fflush(stdout);
    }

    /// Whether the fits lie too near to the mean face, or to what is common to them, and whether that is true of the
    /// heads.
    void print_stretched(const std::array<Fits, 2>& halves, const std::string& views) const
    {
        constexpr std::array<double, 5> factors = {0.0, 0.5, 1.0, 1.5, 2.0};
        std::printf("displacement stretched, even heads, %s: distance [mm] by factor; odd heads with the best\n%-32s",
                    views.c_str(), "");
        for (const double factor : factors) {
            std::printf(" %6.2f", factor);
        }
        std::printf("   best: odd  change    s.e.\n");
        for (std::size_t s = 0; s < num_sources; ++s) {
            const Eigen::VectorXd common = common_shape(halves[0], s);
            const Eigen::VectorXd mean_face = Eigen::VectorXd::Zero(common.size());
            for (const Stretch& stretch :
                 {Stretch{"about the mean", mean_face, mean_face}, Stretch{"about common", common, common},
                  Stretch{"less common", mean_face, common}}) {
                double best = 0.0;
                double least_mm = std::numeric_limits<double>::infinity();
                std::printf("%-17s %-14s", source_names[s], stretch.name);
                for (const double factor : factors) {
                    const double mm = Comparison(stretched(halves[0], s, stretch, factor)).fit_mm;
                    std::printf(" %6.3f", mm);
                    if (mm < least_mm) {
                        least_mm = mm;
                        best = factor;
                    }
                }
                const Comparison c = change(as_fitted(halves[1], s), stretched(halves[1], s, stretch, best));
                std::printf("  %4.2f: %6.3f %7.3f %7.3f\n", best, c.fit_mm, -c.gain_mm(), c.standard_error_mm);
            }
        }
        std::printf("\n");
        std::fflush(stdout);
    }

    static void print_regions(const Fits& odd)
    {
        std::printf("gain by region (nearest landmark), mean distance, odd heads, one view\n%-17s", "");
        for (const Region& region : regions) {
            std::printf(" %7s", region.name);
        }
        std::printf("\n");
        for (std::size_t s = 0; s < num_sources; ++s) {
            std::printf("%-17s", source_names[s]);
            for (std::size_t r = 0; r < regions.size(); ++r) {
                double mean_face = 0.0;
                double fitted = 0.0;
                for (std::size_t i = 0; i < odd.subjects.size(); ++i) {
                    mean_face += odd.subjects[i]->mean_face.region_mean_mm[r];
                    fitted += odd.of[s][i].distance.region_mean_mm[r];
                }
                std::printf(" %6.1f%%", 100.0 * (mean_face - fitted) / mean_face);
            }
            std::printf("\n");
        }
        std::printf("\n");
    }

    static void print_more_views(const Fits& one, const Fits& all)
    {
        std::printf("distance with all views minus that with one, odd heads [mm]\n");
        for (std::size_t s = 0; s < num_sources; ++s) {
            const Comparison c = change(as_fitted(one, s), as_fitted(all, s));
            std::printf("%-17s %6.3f  s.e. %.3f\n", source_names[s], -c.gain_mm(), c.standard_error_mm);
        }
        std::printf("\n");
    }

    /// Whether a weaker or stronger prior suits the detected points better.
    void print_regularizations(const Fits& even) const
    {
        constexpr std::array<double, 3> weights = {0.5, 1.0, 2.0};
        std::printf("even heads, one view: distance [mm] by regularisation\n%-17s", "");
        for (const double weight : weights) {
            std::printf(" %6.2f", weight);
        }
        std::printf("\n");
        for (std::size_t s = 0; s < num_sources; ++s) {
            std::printf("%-17s", source_names[s]);
            for (const double weight : weights) {
                FitOptions options;
                options.regularization = weight;
                const FaceFitter weighted(model_, fitter(s).scheme(), options);
                std::vector<Pair> pairs;
                for (const Subject* subject : even.subjects) {
                    const FitResult fit = weighted.fit(*subject->sightings[0].landmarks[s], principal_point_px);
                    pairs.push_back(
                        {subject->mean_face, distance_to(*subject, model_.shape.instance(fit.shape_coefficients))});
                }
                std::printf(" %6.3f", Comparison(pairs).fit_mm);
                std::fflush(stdout);
            }
            std::printf("\n");
        }
    }

    /// Of a sum of rotations that are not far from each other.
    static Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& sum)
    {
        const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
        return svd.matrixU() * svd.matrixV().transpose();
    }

    static double angle_deg(const Eigen::Matrix3d& rotation) { return degrees(Eigen::AngleAxisd(rotation).angle()); }

    static double mean(const std::vector<double>& values)
    {
        double sum = 0.0;
        for (const double value : values) {
            sum += value;
        }
        return sum / static_cast<double>(values.size());
    }

    /// Of the straight line through points (x, y).
    static double slope(const std::vector<Eigen::Vector2d>& points)
    {
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        Eigen::Matrix2d products = Eigen::Matrix2d::Zero();
        for (const Eigen::Vector2d& point : points) {
            sum += point;
            products += point * point.transpose();
        }
        products -= sum * sum.transpose() / static_cast<double>(points.size());
        return products(0, 1) / products(0, 0);
    }

    /// Of the mean.
    static double standard_error(const std::vector<double>& values)
    {
        const double center = mean(values);
        double squares = 0.0;
        for (const double value : values) {
            squares += (value - center) * (value - center);
        }
        const double count = static_cast<double>(values.size());
        return std::sqrt(squares / (count * (count - 1.0)));
    }

    ForeignModel foreign_;
    MorphableModel model_;
    FaceFitter sparse_;
    FaceFitter dense_;
    std::optional<JointFitter> joint_sparse_ = std::nullopt; ///< With --method joint, instead.
    std::optional<JointFitter> joint_dense_ = std::nullopt;
    int num_views_;
    std::vector<Subject> subjects_ = {};
};

} // namespace

int main(int argc, char** argv)
{
    const lineament::bench::Options options(
        argc, argv,
        "rendered_heads heads.safetensors [--heads 400] [--views 5] [--method "
        "thesis] [--outline-mm 4] [--depth-ratio 5] [--distance-mm 0] [--pictures FOLDER]",
        1);
    try {
        Bench(argv[1], options).run();
    } catch (const std::exception& error) {
        std::fprintf(stderr, "rendered_heads: error: %s\n", error.what());
        return 1;
    }
}
