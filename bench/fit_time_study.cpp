// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Time of one whole fit with its mesh, by level of the model and number of iterations: FaceFitter, RealtimeFitter,
// JointFitter; beside a calibration kernel (multiply-adds over 4 MB), so that the ratio of the two can be compared
// between machines. Both contours, six expressions (JointFitter at full resolution also with the facing contour alone,
// and with 47); 64 planted faces in turn. Prints the rows of fit_study: median and median absolute deviation of the
// thread's processor time over repetitions in random order.
//
//   fit_time_study [--model FILE] [--repetitions N]
#include "calibration_kernel.hpp"
#include "measures.hpp"
#include "options.hpp"
#include "planted.hpp"

#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace lineament;
using bench::centre;
using bench::median;

float sink = 0; ///< Takes every answer, so that none is left out.

struct Case
{
    std::string series;
    double x = 0;
    int num_runs = 0;
    std::function<void()> run = {};   ///< All of them.
    std::vector<double> time_us = {}; ///< Of one run, of each repetition.
};

FitOptions options_of(int iterations)
{
    FitOptions options;
    options.iterations = iterations;
    return options;
}

std::vector<Case> make_cases(const MorphableModel& model, const std::vector<LandmarkSet>& sets)
{
    const int count = static_cast<int>(sets.size());
    std::vector<Case> cases;
    const auto calibration = std::make_shared<bench::CalibrationKernel>();
    cases.push_back({"calibration", 0, 50, [calibration] {
                         for (int i = 0; i < 50; ++i) {
                             sink += calibration->run();
                         }
                     }});
    for (int level = 0; level < static_cast<int>(model.levels.size()); ++level) {
        const MorphableModel coarse = model.at_level(level);
        const std::string suffix = ", " + std::to_string(coarse.num_vertices()) + " vertices";
        for (const int iterations : {1, 2, 3, 5, 10, 20}) {
            const auto fitter = std::make_shared<RealtimeFitter>(coarse, "ibug68", options_of(iterations),
                                                                 kernels::dispatched_kernels());
            cases.push_back({"FaceFitter" + suffix, static_cast<double>(iterations), count, [fitter, &sets] {
                                 for (const LandmarkSet& set : sets) {
                                     const FitResult fit = fitter->reference().fit(set, centre);
                                     sink += shape_of(fitter->reference().model(), fit)[0];
                                 }
                             }});
            const auto workspace = std::make_shared<RealtimeWorkspace>(fitter->make_workspace());
            cases.push_back({"RealtimeFitter" + suffix, static_cast<double>(iterations), count,
                             [fitter, workspace, &sets, result = FitResult{}]() mutable {
                                 for (const LandmarkSet& set : sets) {
                                     fitter->fit(set, centre, *workspace, result);
                                     sink += fitter->shape_of(result, *workspace)(0, 0);
                                 }
                             }});
        }
        const auto add_joint = [&](const std::string& what, const JointOptions& options) {
            const auto joint = std::make_shared<JointFitter>(coarse, "ibug68", options, &kernels::dispatched_kernels());
            double steps = 0;
            for (const LandmarkSet& set : sets) {
                steps += static_cast<double>(joint->fit(set, centre).fit.iterations) / count;
            }
            const auto workspace = std::make_shared<JointWorkspace>(joint->make_workspace());
            cases.push_back({"JointFitter" + what + suffix, steps, count,
                             [joint, workspace, &sets, result = JointFitResult{}]() mutable {
                                 for (const LandmarkSet& set : sets) {
                                     joint->fit(set, centre, *workspace, result);
                                     sink += shape_of(joint->model(), result.fit, &kernels::dispatched_kernels())[0];
                                 }
                             }});
        };
        add_joint("", JointOptions{});
        if (level + 1 == static_cast<int>(model.levels.size())) {
            JointOptions options;
            options.contour = ContourMode::front_facing;
            add_joint(" facing contour", options);
            options.expression_set = "arkit47";
            add_joint(" facing contour arkit47", options);
        }
    }
    return cases;
}

void print(const std::vector<Case>& cases)
{
    const double calibration_us = median(cases[0].time_us);
    for (const Case& one : cases) {
        const double middle = median(one.time_us);
        std::vector<double> deviations;
        for (const double time : one.time_us) {
            deviations.push_back(std::abs(time - middle));
        }
        const int count = static_cast<int>(one.time_us.size());
        const double spread = median(deviations);
        std::printf("time,median_us,\"%s\",%g,%.6g,%.3g,%d\n", one.series.c_str(), one.x, middle, spread, count);
        std::printf("time,ratio,\"%s\",%g,%.4g,%.3g,%d\n", one.series.c_str(), one.x, middle / calibration_us,
                    spread / calibration_us, count);
    }
}

} // namespace

int main(int argc, char** argv)
{
    const bench::Options given(argc, argv, "fit_time_study [--model FILE] [--repetitions N]");
    const int repetitions = given.count("--repetitions", 15, 1);
    try {
        const bench::PlantedFaces faces(load_model(given.text("--model", default_model_path())));
        bench::Protocol protocol;
        protocol.outline = bench::Outline::visible;
        std::vector<LandmarkSet> sets;
        for (const bench::Subject& subject : faces.draw_subjects(protocol, 64)) {
            sets.push_back(subject.images[0]);
        }
        std::vector<Case> cases = make_cases(faces.model(), sets);
        Random random(1);
        for (int repetition = -1; repetition < repetitions; ++repetition) { // the first one warms up
            std::vector<Case*> order;
            for (Case& one : cases) {
                order.insert(order.begin() + random.index(static_cast<int>(order.size()) + 1), &one);
            }
            for (Case* one : order) {
                const double begin_ms = bench::thread_ms();
                one->run();
                if (repetition >= 0) {
                    one->time_us.push_back(1000 * (bench::thread_ms() - begin_ms) / one->num_runs);
                }
            }
        }
        std::printf("part,quantity,series,x,mean,error,count\n# kernels %s, sum %g\n",
                    kernels::dispatched_kernels().name, static_cast<double>(sink));
        print(cases);
    } catch (const Error& error) {
        std::fprintf(stderr, "fit_time_study: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
