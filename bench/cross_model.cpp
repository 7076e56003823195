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
// the jaw is given in two ways: where the face ends at the height of the fixed vertex (nose and underside of the jaw
// excepted); and at the fixed vertices.
#include "foreign_heads.hpp"

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/io/model_file.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

namespace lineament {
namespace {

using namespace bench;

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
            views_.push_back(make_view(foreign_, heads_.back(), random));
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
            const View& view = views_[h];
            const FitResult result = fit(as_ibug68(view.exact_px[static_cast<int>(jaw)] + noise_px * view.unit_noise));
            pairs.push_back({mean_distances_[h],
                             distance(heads_[h], foreign_, model_, model_.shape.instance(result.shape_coefficients))});
        }
        return pairs;
    }

private:
    ForeignModel foreign_;
    MorphableModel model_;
    std::vector<Head> heads_ = {};
    std::vector<View> views_ = {};
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

/// What the default noise of the outline was chosen by, of either fitter's options.
template <typename FitterOptions>
void print_outline_noise(const Experiment& experiment, const char* fitter, FitterOptions options)
{
    print_noise_heading(fitter, "outline");
    for (const double sigma_mm : {2.5, 4.0, 6.0, 8.0, 10.0, 14.0}) {
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
        std::printf("%.1f %%   %6.3f mm %6.3f mm %6.3f mm %6.3f mm %4.1f %%  %4.1f %%   %td of %zu\n", noise,
                    c.mean_face_mm, c.fit_mm, c.gain_mm(), c.standard_error_mm, c.percent(c.gain_mm()),
                    c.percent(c.standard_error_mm), num_better(pairs), pairs.size());
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
    print_outline_noise(experiment, "FaceFitter", options);
    print_outline_noise(experiment, "JointFitter", joint_options);
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
