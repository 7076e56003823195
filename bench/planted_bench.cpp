// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Planted faces: identity, expression, camera and noise drawn at random, landmarks made from them, and fitted by the
// thesis's method (FaceFitter, published setting) and jointly (JointFitter). Prints the error of the neutral shape over
// the mask "face" in mm, with means and standard errors, as tables in Markdown.       docs/joint-fit.md
//
//   planted_bench [--model FILE] [--subjects N] [--only WORD]
#include "options.hpp"
#include "planted.hpp"

#include "lineament/fit/identity_filter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace {

using namespace lineament;

using bench::centre;
using bench::Mean;
using bench::outer_eye_px;
using bench::Protocol;
using bench::Subject;

const bench::PlantedFaces* planted = nullptr;
const MorphableModel& model()
{
    return planted->model();
}
std::vector<Subject> draw_subjects(const Protocol& protocol, int count)
{
    return planted->draw_subjects(protocol, count);
}

/// Errors of neutral shapes: similarity Procrustes over the face, mean vertex distance; the same without scale; and the
/// ratio of estimated to true scale of the camera.
struct Errors
{
    Mean aligned, metrical, scale_ratio;
    int num_success = 0, num_fits = 0;
    void add(const Eigen::VectorXd& alpha, const Eigen::VectorXd& truth, FitStatus status, double ratio)
    {
        aligned.add(planted->error_mm(alpha, truth));
        metrical.add(planted->error_mm(alpha, truth, AlignmentScale::fixed));
        scale_ratio.add(ratio);
        num_success += status == FitStatus::success;
        ++num_fits;
    }
    void print(const char* setting, const char* method) const
    {
        std::printf("| %s | %s | %.3f ± %.3f | %.3f ± %.3f | %+.1f ± %.1f %% | %d / %d |\n", setting, method,
                    aligned.mean(), aligned.error(), metrical.mean(), metrical.error(), 100 * (scale_ratio.mean() - 1),
                    100 * scale_ratio.error(), num_success, num_fits);
        std::fflush(stdout);
    }
};

void print_header(const char* title)
{
    std::printf("\n%s\n\n| setting | method | error, mm | without scale, mm | camera scale | success |\n"
                "| --- | --- | --- | --- | --- | --- |\n",
                title);
}

double mean_ratio(const std::vector<Camera>& truth, const std::vector<double>& scales)
{
    double sum = 0;
    for (std::size_t f = 0; f < truth.size(); ++f) {
        sum += scales[f] / truth[f].scale_px_per_mm;
    }
    return sum / static_cast<double>(truth.size());
}

Errors run_thesis(const std::vector<Subject>& subjects, FitOptions options, PriorCount prior_count)
{
    options.contour = ContourMode::fixed;
    const FaceFitter fitter(model(), "ibug68", options);
    Errors errors;
    for (const Subject& subject : subjects) {
        const MultiFrameResult result = fit_frames(fitter, subject.images, centre, prior_count);
        std::vector<double> scales;
        for (const FitResult& frame : result.frames) {
            scales.push_back(frame.camera.scale_px_per_mm);
        }
        errors.add(result.shape_coefficients, subject.alpha, result.status, mean_ratio(subject.cameras, scales));
    }
    return errors;
}

/// Correspondences given, noise known: sigma in mm at the mean face's scale.
JointOptions known_noise(double noise_px)
{
    JointOptions options;
    options.contour = ContourMode::fixed;
    options.landmark_sigma_mm = options.contour_sigma_mm = noise_px / planted->mean_scale();
    options.bias_sigma_mm = 0;
    return options;
}

/// Correspondences given, every other setting at its default.
JointOptions default_noise()
{
    JointOptions options;
    options.contour = ContourMode::fixed;
    return options;
}

/// Shares of 90 % intervals that hold the truth: coefficients, and coordinates of the neutral face's vertices.
struct Coverage
{
    Mean coefficients, coordinates, chi_square;

    void add(const Eigen::VectorXd& alpha, const Eigen::MatrixXd& covariance, const Eigen::VectorXd& truth)
    {
        const double z = 1.6448536269514722;
        const Eigen::VectorXd deviation = covariance.diagonal().cwiseSqrt();
        coefficients.add(((alpha - truth).array().abs() <= z * deviation.array()).cast<double>().mean());
        const Eigen::Matrix3Xf spread = vertex_standard_deviations(model(), covariance);
        const Eigen::VectorXf offset = model().shape.instance(alpha) - model().shape.instance(truth);
        const Eigen::Map<const Eigen::Matrix3Xf> offsets(offset.data(), 3, model().num_vertices());
        int inside = 0;
        for (const int vertex : planted->face_vertices()) {
            inside += static_cast<int>(
                (offsets.col(vertex).cwiseAbs().array() <= static_cast<float>(z) * spread.col(vertex).array()).count());
        }
        coordinates.add(inside / (3.0 * static_cast<double>(planted->face_vertices().size())));
    }
};

Errors run_joint(const std::vector<Subject>& subjects, const JointOptions& options, Coverage* coverage = nullptr)
{
    const JointFitter fitter(model(), "ibug68", options);
    Errors errors;
    for (const Subject& subject : subjects) {
        const JointFramesResult result = fitter.fit_frames(subject.images, centre);
        std::vector<double> scales;
        for (const JointFitResult& frame : result.frames) {
            scales.push_back(frame.fit.camera.scale_px_per_mm);
        }
        errors.add(result.shape_coefficients, subject.alpha, result.status, mean_ratio(subject.cameras, scales));
        if (coverage != nullptr) {
            coverage->add(result.shape_coefficients, result.shape_covariance, subject.alpha);
            coverage->chi_square.add(result.chi_square / result.degrees_of_freedom);
        }
    }
    return errors;
}

Errors run_mean_face(const std::vector<Subject>& subjects)
{
    Errors errors;
    for (const Subject& subject : subjects) {
        errors.add(Eigen::VectorXd::Zero(subject.alpha.size()), subject.alpha, FitStatus::success, 1.0);
    }
    return errors;
}

void single_image(int num_subjects)
{
    print_header("One image");
    for (const double noise_px : {1.0, 2.8}) {
        Protocol protocol;
        protocol.noise_px = noise_px;
        const std::vector<Subject> subjects = draw_subjects(protocol, num_subjects);
        const std::string setting = "noise " + std::to_string(noise_px).substr(0, 3) + " px";
        run_mean_face(subjects).print(setting.c_str(), "mean face");
        run_thesis(subjects, FitOptions::published_prior(), PriorCount::once).print(setting.c_str(), "thesis");
        FitOptions twenty = FitOptions::published_prior();
        twenty.iterations = 20;
        run_thesis(subjects, twenty, PriorCount::once).print(setting.c_str(), "thesis, 20 iterations");
        run_joint(subjects, known_noise(noise_px)).print(setting.c_str(), "joint, noise known");
        run_joint(subjects, default_noise()).print(setting.c_str(), "joint, default noise");
        JointOptions gaussian = known_noise(noise_px);
        gaussian.loss = RobustLoss::none;
        run_joint(subjects, gaussian).print(setting.c_str(), "joint, noise known, least squares");
    }
}

void ten_images(int num_subjects)
{
    print_header("Ten images, noise 2.8 px");
    Protocol protocol;
    protocol.num_images = 10;
    const std::vector<Subject> subjects = draw_subjects(protocol, num_subjects);
    run_mean_face(subjects).print("ten", "mean face");
    FitOptions options = FitOptions::published_prior();
    run_thesis(subjects, options, PriorCount::per_frame).print("ten", "thesis, prior times ten (usual)");
    options.iterations = 20;
    run_thesis(subjects, options, PriorCount::once).print("ten", "thesis, one prior, 20 iterations");
    run_joint(subjects, known_noise(2.8)).print("ten", "joint, noise known");
    run_joint(subjects, default_noise()).print("ten", "joint, default noise and bias");
}

void landmark_bias(int num_subjects)
{
    print_header("Landmark bias 3 mm, noise 2.8 px");
    Protocol protocol;
    protocol.bias_mm = 3;
    protocol.num_images = 10;
    const std::vector<Subject> subjects = draw_subjects(protocol, num_subjects);
    std::vector<Subject> first = subjects;
    for (Subject& subject : first) {
        subject.images.resize(1);
        subject.cameras.resize(1);
    }
    JointOptions options = known_noise(2.8);
    options.bias_sigma_mm = 3;
    run_joint(first, options).print("one image", "joint, noise and bias known");
    run_joint(subjects, options).print("ten", "joint, noise and bias known");
    run_joint(subjects, default_noise()).print("ten", "joint, default noise and bias");
    run_joint(subjects, known_noise(2.8)).print("ten", "joint, no bias in the model");
}

void wild_landmarks(int num_subjects)
{
    print_header("Five images, noise 2.8 px, a tenth of the landmarks moved by up to 20 px");
    Protocol protocol;
    protocol.num_images = 5;
    const std::vector<Subject> clean = draw_subjects(protocol, num_subjects);
    protocol.wild_share = 0.1;
    const std::vector<Subject> wild = draw_subjects(protocol, num_subjects);
    for (const auto& [loss, name] : {std::pair{RobustLoss::student_t, "joint, Student t"},
                                     std::pair{RobustLoss::geman_mcclure, "joint, Geman-McClure"},
                                     std::pair{RobustLoss::none, "joint, least squares"}}) {
        JointOptions options = known_noise(2.8);
        options.loss = loss;
        run_joint(clean, options).print("clean", name);
        run_joint(wild, options).print("wild", name);
    }
}

void selfie(int num_subjects)
{
    print_header("Ten selfies at 40 cm, noise 1.5 px");
    Protocol protocol;
    protocol.num_images = 10;
    protocol.noise_px = 1.5;
    protocol.distance_mm = 400;
    protocol.focal_length_px = 400 * planted->mean_scale();
    const std::vector<Subject> subjects = draw_subjects(protocol, num_subjects);
    JointOptions options = known_noise(1.5);
    run_joint(subjects, options).print("40 cm", "joint, scaled orthographic");
    options.focal_length_px = protocol.focal_length_px;
    run_joint(subjects, options).print("40 cm", "joint, focal length known");
    options.focal_length_px.reset();
    options.phi_sigma_per_mm = 0.002;
    run_joint(subjects, options).print("40 cm", "joint, focal length unknown");
}

void intervals(int num_subjects)
{
    std::printf(
        "\n90 %% intervals, noise known\n\n"
        "| expressions | images | noise | loss | coefficients inside | vertex coordinates inside | chi-square / "
        "d.o.f. |\n| --- | --- | --- | --- | --- | --- | --- |\n");
    for (const char* set : {"ekman6", "arkit47"}) {
        for (const int num_images : {1, 10}) {
            for (const double noise_px : {1.0, 2.8}) {
                for (const RobustLoss loss : {RobustLoss::student_t, RobustLoss::none}) {
                    Protocol protocol;
                    protocol.num_images = num_images;
                    protocol.noise_px = noise_px;
                    protocol.expression_set = set;
                    JointOptions options = known_noise(noise_px);
                    options.loss = loss;
                    options.expression_set = set;
                    Coverage coverage;
                    (void)run_joint(draw_subjects(protocol, num_images > 1 ? num_subjects / 4 : num_subjects), options,
                                    &coverage);
                    std::printf("| %s | %d | %.1f px | %s | %.3f ± %.3f | %.3f ± %.3f | %.2f ± %.2f |\n", set,
                                num_images, noise_px, loss == RobustLoss::none ? "least squares" : "Student t",
                                coverage.coefficients.mean(), coverage.coefficients.error(),
                                coverage.coordinates.mean(), coverage.coordinates.error(), coverage.chi_square.mean(),
                                coverage.chi_square.error());
                    std::fflush(stdout);
                }
            }
        }
    }
}

/// Images one by one, each fitted with the earlier ones as prior; beside all of them at once.
void sequence(int num_subjects)
{
    std::printf(
        "\nImages one by one (IdentityFilter), 2.8 px, noise known\n\n"
        "| images | error, mm | coefficients inside | vertex coordinates inside |\n| --- | --- | --- | --- |\n");
    Protocol protocol;
    protocol.num_images = 50;
    const JointFitter fitter(model(), "ibug68", known_noise(2.8), &kernels::dispatched_kernels());
    std::map<std::size_t, Mean> errors;
    std::map<std::size_t, Coverage> coverages;
    Mean at_once;
    for (const Subject& subject : draw_subjects(protocol, num_subjects)) {
        IdentityFilter filter(fitter.num_shape_coefficients());
        for (const LandmarkSet& image : subject.images) {
            const JointFitResult result = fitter.fit(image, centre, nullptr, {}, &filter);
            filter.add(fitter.identity_information(image, result, filter.num_images()));
            const std::size_t count = static_cast<std::size_t>(filter.num_images());
            if (count == 1 || count == 10 || count == 50) {
                errors[count].add(planted->error_mm(filter.mean(), subject.alpha));
                coverages[count].add(filter.mean(), filter.covariance(), subject.alpha);
            }
        }
        const std::span<const LandmarkSet> ten = std::span(subject.images).first(10);
        at_once.add(planted->error_mm(fitter.fit_frames(ten, centre).shape_coefficients, subject.alpha));
    }
    for (const auto& [count, coverage] : coverages) {
        std::printf("| %d | %.3f ± %.3f | %.3f ± %.3f | %.3f ± %.3f |\n", static_cast<int>(count), errors[count].mean(),
                    errors[count].error(), coverage.coefficients.mean(), coverage.coefficients.error(),
                    coverage.coordinates.mean(), coverage.coordinates.error());
    }
    std::printf("\nTen at once: %.3f ± %.3f mm\n", at_once.mean(), at_once.error());
}

/// Rounds of matching, with landmarks on the visible outline.
void matching_rounds(int num_subjects)
{
    std::printf("\nRounds of matching, outline where it is seen, default options\n\n"
                "| yaw | noise | rounds | error, mm | rotation, degrees |\n| --- | --- | --- | --- | --- |\n");
    for (const auto& [min_yaw_deg, max_yaw_deg] : {std::pair(-20.0, 20.0), std::pair(50.0, 75.0)}) {
        for (const double noise_px : {1.0, 2.8}) {
            Protocol protocol;
            protocol.noise_px = noise_px;
            protocol.min_yaw_deg = min_yaw_deg;
            protocol.max_yaw_deg = max_yaw_deg;
            protocol.outline = bench::Outline::visible;
            const std::vector<Subject> subjects = draw_subjects(protocol, num_subjects);
            for (const int rounds : {1, 2, 3, 4, 8}) {
                JointOptions options;
                options.rounds = rounds;
                const JointFitter fitter(model(), "ibug68", options, &kernels::dispatched_kernels());
                Mean error, rotation_deg;
                for (const Subject& subject : subjects) {
                    const FitResult fit = fitter.fit(subject.images[0], centre).fit;
                    error.add(planted->error_mm(fit.shape_coefficients, subject.alpha));
                    const Eigen::Matrix3d turn =
                        fit.camera.camera_from_model * subject.cameras[0].camera_from_model.transpose();
                    rotation_deg.add(degrees(Eigen::AngleAxisd(turn).angle()));
                }
                std::printf("| %g to %g | %.1f px | %d | %.3f ± %.3f | %.2f ± %.2f |\n", min_yaw_deg, max_yaw_deg,
                            noise_px, rounds, error.mean(), error.error(), rotation_deg.mean(), rotation_deg.error());
            }
        }
    }
}

/// Of frames of a known identity, means over the frames of a subject.
struct FrameErrors
{
    Mean expression_mm, rotation_deg;
    double largest = 0; ///< Of all coefficients.
    int num_success = 0, num_fits = 0;

    void add(const Subject& subject, const std::vector<FitResult>& frames, const std::string& expression_set)
    {
        double expression_sum = 0, rotation_sum = 0;
        for (std::size_t f = 0; f < frames.size(); ++f) {
            const Eigen::VectorXd difference = frames[f].expression_coefficients - subject.psi[f];
            expression_sum += planted->displacement_mm(difference, expression_set);
            rotation_sum += degrees(Eigen::AngleAxisd(Eigen::Matrix3d(frames[f].camera.camera_from_model *
                                                                      subject.cameras[f].camera_from_model.transpose()))
                                        .angle());
            largest = std::max(largest, frames[f].expression_coefficients.maxCoeff());
            num_success += frames[f].status == FitStatus::success;
            ++num_fits;
        }
        expression_mm.add(expression_sum / static_cast<double>(frames.size()));
        rotation_deg.add(rotation_sum / static_cast<double>(frames.size()));
    }
    void print(const std::string& setting, const char* method) const
    {
        std::printf("| %s | %s | %.3f ± %.3f | %.2f ± %.2f | %.2f | %d / %d |\n", setting.c_str(), method,
                    expression_mm.mean(), expression_mm.error(), rotation_deg.mean(), rotation_deg.error(), largest,
                    num_success, num_fits);
        std::fflush(stdout);
    }
};

/// As `lineament track` fits them: one joint identity of all frames, then each frame by either method.
void print_frames(const std::string& setting, const Protocol& protocol, int num_subjects)
{
    JointOptions joint_options;
    FitOptions thesis_options;
    joint_options.expression_set = thesis_options.expression_set = protocol.expression_set;
    const JointFitter joint(model(), "ibug68", joint_options, &kernels::dispatched_kernels());
    const RealtimeFitter thesis(model(), "ibug68", thesis_options, kernels::dispatched_kernels());
    RealtimeWorkspace workspace = thesis.make_workspace();
    JointWorkspace joint_workspace = joint.make_workspace();
    JointFitResult result;
    FrameErrors of_joint, of_thesis;
    for (const Subject& subject : draw_subjects(protocol, num_subjects)) {
        const JointFramesResult person = joint.fit_frames(subject.images, centre);
        const KnownIdentity identity = joint.freeze(person.shape_coefficients);
        const FrozenIdentity frozen = thesis.freeze(person.shape_coefficients);
        std::vector<FitResult> joint_frames, thesis_frames;
        for (const LandmarkSet& image : subject.images) {
            joint.fit_pose_and_expression(image, centre, identity, joint_workspace, result);
            joint_frames.push_back(result.fit);
            thesis.fit_pose_and_expression(image, centre, frozen, workspace, thesis_frames.emplace_back());
        }
        of_joint.add(subject, joint_frames, protocol.expression_set);
        of_thesis.add(subject, thesis_frames, protocol.expression_set);
    }
    of_thesis.print(setting, "thesis");
    of_joint.print(setting, "joint");
}

void frames_of_known_identity(int num_subjects)
{
    std::printf("\nFrames of a known identity, that of ten frames by the joint fit; default options, outline where it "
                "is seen\n\n"
                "| expressions, noise | method | expression, mm | rotation, degrees | largest psi | success |\n"
                "| --- | --- | --- | --- | --- | --- |\n");
    struct Setting
    {
        const char* name;
        double noise_px, bias_mm, wild_share;
    };
    for (const std::string expression_set : {"ekman6", "arkit47"}) {
        for (const Setting& setting :
             {Setting{"1.0 px", 1.0, 0, 0}, Setting{"2.8 px", 2.8, 0, 0}, Setting{"2.8 px, bias 2 mm", 2.8, 2, 0},
              Setting{"2.8 px, bias 2 mm, a tenth wild", 2.8, 2, 0.1}}) {
            Protocol protocol;
            protocol.num_images = 10;
            protocol.noise_px = setting.noise_px;
            protocol.bias_mm = setting.bias_mm;
            protocol.wild_share = setting.wild_share;
            protocol.expression_set = expression_set;
            protocol.outline = bench::Outline::visible;
            print_frames(expression_set + ", " + setting.name, protocol, num_subjects);
        }
    }
}

/// 20 to 68 of the landmarks, yaw within 60 degrees, noise of 0 to 2 px: all of it well posed.
void statuses(int num_fits)
{
    const JointFitter joint(model(), "ibug68", JointOptions{}, &kernels::dispatched_kernels()); // outline re-matched
    const RealtimeFitter realtime(model(), "ibug68", FitOptions{}, kernels::dispatched_kernels());
    RealtimeWorkspace workspace = realtime.make_workspace();
    std::map<std::string, int> joint_counts, realtime_counts;
    Random random(99);
    for (int i = 0; i < num_fits; ++i) {
        Protocol protocol;
        protocol.min_yaw_deg = -60;
        protocol.max_yaw_deg = 60;
        protocol.noise_px = random.uniform(0, 2);
        const Subject subject = planted->draw_subject(protocol, 77777ull * static_cast<std::uint64_t>(i + 1));
        LandmarkSet set = subject.images[0];
        const std::size_t num_seen = 20 + static_cast<std::size_t>(random.index(49));
        while (set.landmarks.size() > num_seen) {
            set.landmarks.erase(set.landmarks.begin() + random.index(static_cast<int>(set.landmarks.size())));
        }
        ++joint_counts[to_string(joint.fit(set, centre).fit.status)];
        FitResult result;
        realtime.fit(set, centre, workspace, result);
        ++realtime_counts[to_string(result.status)];
    }
    const auto print = [num_fits](const char* method, const std::map<std::string, int>& counts) {
        std::printf("\nStatuses of %d fits, default options, %s:", num_fits, method);
        for (const auto& [status, count] : counts) {
            std::printf(" %s %d", status.c_str(), count);
        }
        std::printf("\n");
    };
    print("joint", joint_counts);
    print("thesis, in real time", realtime_counts);
}

} // namespace

int main(int argc, char** argv)
{
    const bench::Options given(argc, argv, "planted_bench [--model FILE] [--subjects N] [--only WORD]");
    const std::string only = given.text("--only", "");
    const int num_subjects = given.count("--subjects", 200, 8);
    try {
        const bench::PlantedFaces faces(load_model(given.text("--model", default_model_path())));
        planted = &faces;
        std::printf(
            "model %s, %d face vertices, %d subjects (a quarter of them for ten images), yaw within 45 degrees, "
            "outer eye corners %g px = %.1f mm apart\n",
            model().name.c_str(), static_cast<int>(faces.face_vertices().size()), num_subjects, outer_eye_px,
            outer_eye_px / faces.mean_scale());
        const auto run = [&](const char* name, void (*part)(int), int count) {
            if (only.empty() || only == name) {
                part(count);
            }
        };
        run("one", single_image, num_subjects);
        run("ten", ten_images, num_subjects / 4);
        run("bias", landmark_bias, num_subjects / 4);
        run("wild", wild_landmarks, num_subjects / 2);
        run("selfie", selfie, num_subjects / 4);
        run("intervals", intervals, num_subjects);
        run("sequence", sequence, num_subjects / 4);
        run("rounds", matching_rounds, num_subjects);
        run("frames", frames_of_known_identity, num_subjects / 4);
        run("status", statuses, 50 * num_subjects);
    } catch (const Error& error) {
        std::fprintf(stderr, "planted_bench: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
