// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// How the fit behaves on planted faces: convergence, kinds of camera, non-negative expressions, contours, noise, number
// of images, yaw, posterior. Prints one CSV table, means and standard errors over the subjects, which
// bench/plot_fit_study.py draws.                                                  docs/fit-in-pictures.md
//
//   fit_study [--model FILE] [--subjects N] [--only PART]
#include "fit_by_parts.hpp"
#include "options.hpp"
#include "planted.hpp"

#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/io/model_file.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace lineament;
using bench::centre;
using bench::Mean;
using bench::outer_eye_px;
using bench::Outline;
using bench::PlantedFaces;
using bench::Protocol;
using bench::Subject;

/// Means by quantity, series and x, printed as rows of one part.
class Table
{
public:
    explicit Table(std::string part) : part_(std::move(part)) {}
    void add(const std::string& quantity, const std::string& series, double x, double value)
    {
        means_[{quantity, series}][x].add(value);
    }
    ~Table()
    {
        for (const auto& [key, line] : means_) {
            for (const auto& [x, mean] : line) {
                std::printf("%s,%s,\"%s\",%g,%.6g,%.3g,%d\n", part_.c_str(), key.first.c_str(), key.second.c_str(), x,
                            mean.mean(), mean.error(), mean.count);
            }
        }
        std::fflush(stdout);
    }
    Table(const Table&) = delete;
    Table& operator=(const Table&) = delete;

private:
    std::string part_;
    std::map<std::pair<std::string, std::string>, std::map<double, Mean>> means_ = {};
};

FitOptions thesis_options(ContourMode contour, int iterations = 5)
{
    FitOptions options;
    options.contour = contour;
    options.iterations = iterations;
    return options;
}

FitOptions published_options()
{
    FitOptions options = FitOptions::published_prior();
    options.contour = ContourMode::fixed;
    return options;
}

JointOptions joint_options(ContourMode contour)
{
    JointOptions options;
    options.contour = contour;
    return options;
}

/// The fit is told the noise, and that landmarks are unbiased.
JointOptions joint_with_noise_known(const PlantedFaces& faces, double noise_px)
{
    JointOptions options = joint_options(ContourMode::fixed);
    options.landmark_sigma_mm = options.contour_sigma_mm = std::max(noise_px, 0.05) / faces.mean_scale();
    options.bias_sigma_mm = 0;
    return options;
}

double mesh_distance_mm(const PlantedFaces& faces, const FitResult& a, const FitResult& b)
{
    const auto shape = [&](const FitResult& fit) {
        return faces.shape_of(fit.shape_coefficients, fit.expression_coefficients);
    };
    const Eigen::VectorXf difference = shape(a) - shape(b);
    return Eigen::Map<const Eigen::Matrix3Xf>(difference.data(), 3, difference.size() / 3).colwise().norm().mean();
}

/// FitResult::chi_square of the thesis's method with a fixed outline, but for the noise at a given scale. Its own has
/// the noise at the scale before the last pose.
double chi_square_at_scale(const FitOptions& options, const FitResult& fit, double scale_px_per_mm)
{
    const double sigma_px = scale_px_per_mm * options.landmark_sigma_mm; // of the landmarks of weight 1
    double sum = options.regularization * fit.shape_coefficients.squaredNorm() +
                 (fit.expression_coefficients / options.expression_sigma).squaredNorm();
    for (const FittedLandmark& landmark : fit.landmarks) {
        sum += landmark.weight * ((landmark.fitted_px - landmark.point_px) / sigma_px).squaredNorm();
    }
    return sum;
}

/// The joint fit's energy above its least after each step of the last round, in which it is one function: of all faces,
/// and of all but the one that takes the most steps.
void joint_energy(const JointFitter& to_the_end, const std::vector<Subject>& subjects, const std::string& series,
                  Table& table)
{
    constexpr int last_step = 15; // more than any face takes
    const int num_rounds_before = to_the_end.options().rounds - 1;
    std::vector<std::vector<EnergyStep>> energies;
    for (const Subject& subject : subjects) {
        energies.push_back(to_the_end.fit(subject.images[0], centre).energies);
    }
    const auto slowest = std::max_element(energies.begin(), energies.end(),
                                          [](const auto& a, const auto& b) { return a.size() < b.size(); });
    for (auto of_face = energies.begin(); of_face != energies.end(); ++of_face) {
        const double least = of_face->back().energy;
        of_face->resize(last_step + num_rounds_before + 1, of_face->back());
        // Each round also lists the energy it begins with, so step n of the last round is entry n + earlier rounds.
        for (int i = 0; i <= last_step + num_rounds_before; ++i) {
            const EnergyStep& taken = (*of_face)[static_cast<std::size_t>(i)];
            const int step = i - num_rounds_before;
            if (taken.round == num_rounds_before && step > 0) {
                table.add("energy", series, step, taken.energy - least);
                if (of_face != slowest) {
                    table.add("energy_but_slowest", series, step, taken.energy - least);
                }
            }
        }
    }
}

/// The thesis's method stopped after some iterations, and the joint fit after some steps, each from the mean face.
/// The joint fit's first round is of two steps, those between it and the last of one, so that n steps are the leading
/// ones of a whole fit, but for the matrix of the third, which is kept where others follow.
void convergence(const PlantedFaces& faces, int num_subjects)
{
    Table table("convergence");
    for (const ContourMode contour : {ContourMode::fixed, ContourMode::both}) {
        const char* const suffix = contour == ContourMode::fixed ? "fixed" : "re-matched";
        Protocol protocol;
        protocol.outline = contour == ContourMode::fixed ? Outline::model_points : Outline::visible;
        const std::vector<Subject> subjects = faces.draw_subjects(protocol, num_subjects);
        const auto note = [&](const char* method, int x, const Subject& subject, const FitResult& fit,
                              const FitResult& limit) {
            const std::string series = std::string(method) + ", outline " + suffix;
            table.add("error_mm", series, x, faces.error_mm(fit.shape_coefficients, subject.alpha));
            table.add("rms_px", series, x, fit.rms_px);
            table.add("to_limit_mm", series, x, mesh_distance_mm(faces, fit, limit));
            table.add("to_limit_but_for_scale_mm", series, x,
                      faces.shape_error_mm(faces.shape_of(fit.shape_coefficients, fit.expression_coefficients),
                                           faces.shape_of(limit.shape_coefficients, limit.expression_coefficients)));
        };
        const FaceFitter thesis_limit(faces.model(), "ibug68", thesis_options(contour, 300));
        JointOptions to_the_end = joint_options(contour);
        to_the_end.tolerance = 1e-9;
        const JointFitter joint_limit(faces.model(), "ibug68", to_the_end);
        std::vector<FitResult> thesis_limits, joint_limits;
        for (const Subject& subject : subjects) {
            thesis_limits.push_back(thesis_limit.fit(subject.images[0], centre));
            joint_limits.push_back(joint_limit.fit(subject.images[0], centre).fit);
        }
        for (const int count : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15, 20, 30, 50, 100, 200}) {
            const FaceFitter fitter(faces.model(), "ibug68", thesis_options(contour, count));
            for (std::size_t s = 0; s < subjects.size(); ++s) {
                const FitResult& limit = thesis_limits[s];
                const FitResult fit = fitter.fit(subjects[s].images[0], centre);
                note("thesis", count, subjects[s], fit, limit);
                if (contour == ContourMode::fixed) { // re-matched: another function in each iteration
                    const auto at_end = [&](const FitResult& result) {
                        return chi_square_at_scale(fitter.options(), result, limit.camera.scale_px_per_mm);
                    };
                    table.add("energy", "thesis, outline fixed", count, fit.chi_square - limit.chi_square);
                    table.add("energy_below", "thesis, outline fixed", count, fit.chi_square < limit.chi_square);
                    table.add("energy_at_end_scale", "thesis, outline fixed", count, at_end(fit) - at_end(limit));
                }
            }
            JointOptions options = to_the_end;
            options.rounds = std::min(JointOptions{}.rounds, std::max(1, count - 1));
            options.max_iterations = options.rounds == 1 ? count : count - options.rounds;
            const JointFitter joint(faces.model(), "ibug68", options);
            for (std::size_t s = 0; s < subjects.size() && count <= 30; ++s) {
                note("joint", count, subjects[s], joint.fit(subjects[s].images[0], centre).fit, joint_limits[s]);
            }
        }
        for (std::size_t s = 0; s < subjects.size(); ++s) {
            const auto error_mm = [&](const FitResult& fit) {
                return faces.error_mm(fit.shape_coefficients, subjects[s].alpha);
            };
            table.add("joint_less_thesis_mm", std::string("outline ") + suffix, 0,
                      error_mm(joint_limits[s]) - error_mm(thesis_limits[s]));
        }
        JointOptions of_energy = to_the_end;
        if (contour == ContourMode::fixed) {
            of_energy.rounds = 1; // one function from the mean face on
        }
        joint_energy(JointFitter(faces.model(), "ibug68", of_energy), subjects, std::string("joint, outline ") + suffix,
                     table);
        const JointFitter shipped(faces.model(), "ibug68", joint_options(contour));
        for (const Subject& subject : subjects) {
            table.add("steps", std::string("joint, outline ") + suffix, 0,
                      shipped.fit(subject.images[0], centre).fit.iterations);
        }
    }
}

/// The rotation in an affine camera: A = K R_2 with K upper triangular; and how far K is from one scale.
struct AffineParts
{
    Eigen::Matrix3d rotation;
    double anisotropy_percent; ///< |scale across / scale along - 1|.
    double skew_deg;           ///< Of the image axes from a right angle.
};
AffineParts parts_of(const Eigen::Matrix<double, 2, 4>& image_from_model)
{
    const Eigen::RowVector3d a = image_from_model.row(0).head<3>(), b = image_from_model.row(1).head<3>();
    AffineParts parts;
    parts.rotation.row(1) = b.normalized();
    const double along = a.dot(parts.rotation.row(1));
    const Eigen::RowVector3d across = a - along * parts.rotation.row(1);
    parts.rotation.row(0) = across.normalized();
    parts.rotation.row(2) = parts.rotation.row(0).cross(parts.rotation.row(1));
    parts.anisotropy_percent = 100 * std::abs(across.norm() / b.norm() - 1);
    parts.skew_deg = degrees(std::abs(std::atan2(along, across.norm())));
    return parts;
}

/// Pose alone, with the true shape's points or the mean face's, at the image centre.
void pose(const PlantedFaces& faces, int num_subjects)
{
    Table table("pose");
    const double far_mm = 1e6;
    const auto run = [&](double noise_px, double distance_mm, const std::string& suffix, double x) {
        for (int i = 0; i < num_subjects; ++i) {
            Protocol protocol;
            Random random(90001ull * static_cast<std::uint64_t>(i + 1));
            const Subject subject = faces.draw_subject(protocol, 1000003ull * static_cast<std::uint64_t>(i + 1));
            Camera truth = subject.cameras[0];
            truth.translation_mm.setZero();
            truth.phi_per_mm = 1 / distance_mm;
            const Eigen::Matrix3Xd shape = faces.landmark_points(faces.shape_of(subject.alpha, subject.psi[0]));
            Eigen::Matrix2Xd seen = truth.project(Eigen::Ref<const Eigen::Matrix3Xd>(shape));
            for (Eigen::Index l = 0; l < seen.cols(); ++l) {
                seen.col(l) += noise_px * Eigen::Vector2d{random.normal(), random.normal()};
            }
            for (const bool is_known : {true, false}) {
                const Eigen::Matrix3Xd points = is_known ? shape : faces.landmark_points(faces.model().shape.mean);
                const std::string quantity = std::string(is_known ? "known" : "mean") + "_" + suffix;
                const auto note = [&](const char* method, const Eigen::Matrix3d& rotation) {
                    const Eigen::AngleAxisd turn(rotation * truth.camera_from_model.transpose());
                    table.add(quantity, method, x, degrees(std::abs(turn.angle())));
                };
                const AffineParts affine = parts_of(estimate_affine_camera(points, seen).image_from_model);
                note("affine", affine.rotation);
                table.add(quantity + "_anisotropy_percent", "affine", x, affine.anisotropy_percent);
                table.add(quantity + "_skew_deg", "affine", x, affine.skew_deg);
                note("scaled orthographic, closed form",
                     estimate_pose(points, seen, {}, centre).camera.camera_from_model);
                note("scaled orthographic, minimiser",
                     estimate_pose_exactly(points, seen, {}, centre).camera.camera_from_model);
                note("perspective, focal length known",
                     estimate_pose_perspective(points, seen, truth.scale_px_per_mm * distance_mm, {}, centre)
                         .camera.camera_from_model);
            }
        }
    };
    for (const double noise_px : {0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0}) {
        run(noise_px, far_mm, "noise", noise_px);
    }
    for (const double distance_mm : {300.0, 400.0, 500.0, 700.0, 1000.0, 1500.0, 2500.0, 5000.0}) {
        run(1.0, distance_mm, "distance", distance_mm);
    }
}

/// Expressions >= 0 or free, and a scaled orthographic or affine camera, in the thesis's sequence. The first is checked
/// against FaceFitter.
void parts(const PlantedFaces& faces, int num_subjects)
{
    Table table("parts");
    const MorphableModel& model = faces.model();
    const Blendshapes* set = model.find_expression_set("ekman6");
    const ModelPoints points =
        landmark_points(model, *model.find_landmark_map("ibug68"), set, model.shape.num_coefficients());
    const FaceFitter reference(model, "ibug68", published_options());
    double largest = 0;
    for (const double noise_px : {0.0, 1.0, 2.0, 2.8, 4.0, 6.0}) {
        Protocol protocol;
        protocol.noise_px = noise_px;
        for (const Subject& subject : faces.draw_subjects(protocol, num_subjects)) {
            const Eigen::Matrix2Xd seen = bench::points_of(subject.images[0]);
            const Eigen::VectorXf truth = faces.shape_of(subject.alpha, subject.psi[0]);
            const double infinite = std::numeric_limits<double>::infinity();
            const auto run = [&](const char* series, const bench::PartsOptions& options) {
                const bench::PartsResult fit = bench::fit_by_parts(points, seen, options);
                table.add("neutral_mm", series, noise_px, faces.error_mm(fit.alpha, subject.alpha));
                table.add("face_mm", series, noise_px, faces.shape_error_mm(faces.shape_of(fit.alpha, fit.psi), truth));
                table.add("psi_rms", series, noise_px, (fit.psi - subject.psi[0]).norm() / std::sqrt(6.0));
                return fit;
            };
            bench::PartsOptions options;
            const bench::PartsResult bounded = run("psi >= 0", options);
            const FitResult fit = reference.fit(subject.images[0], centre);
            largest = std::max(largest, (bounded.alpha - fit.shape_coefficients).cwiseAbs().maxCoeff());
            options.min_expression = -infinite;
            options.max_expression = infinite;
            (void)run("psi free", options);
            options = {};
            options.camera = bench::CameraKind::affine;
            (void)run("psi >= 0, affine camera", options);
        }
    }
    std::printf("# parts: largest difference of a coefficient from FaceFitter %.1e\n", largest);
}

/// Landmarks at the visible outline; what is done with them, over the yaw.
void contours(const PlantedFaces& faces, int num_subjects)
{
    Table table("contour");
    const std::string thesis_rule = "both, thesis's rule"; // every silhouette vertex takes its nearest landmark
    const std::vector<std::pair<std::string, ContourMode>> modes = {
        {"ignored", ContourMode::ignored}, {"fixed", ContourMode::fixed}, {"front-facing", ContourMode::front_facing},
        {"occluding", ContourMode::both},  {"both", ContourMode::both},   {thesis_rule, ContourMode::both}};
    for (const auto& named_mode : modes) {
        const std::string& name = named_mode.first;
        const ContourMode mode = named_mode.second;
        FitOptions options = thesis_options(mode);
        if (name == thesis_rule) {
            options.contour_matching.occluding_match = OccludingMatch::silhouette_to_landmark;
        }
        const FaceFitter thesis(faces.model(), "ibug68", options);
        const JointFitter joint(faces.model(), "ibug68", joint_options(mode));
        for (const int yaw_deg : {0, 10, 20, 30, 40, 50, 60}) {
            Protocol protocol;
            protocol.min_yaw_deg = protocol.max_yaw_deg = yaw_deg;
            protocol.outline = Outline::visible;
            for (Subject& subject : faces.draw_subjects(protocol, num_subjects)) {
                if (name == "occluding") { // only on the side turned away: without the other's landmarks
                    for (int ibug = 1; ibug <= 17; ++ibug) {
                        const bool is_away = yaw_deg > 7.5 && ibug > 9;
                        subject.images[0].landmarks[static_cast<std::size_t>(ibug - 1)].confidence =
                            is_away || ibug == 9 ? 1.0 : 0.0;
                    }
                }
                const auto add = [&](const char* method, const FitResult& fit) {
                    table.add(std::string(method) + "_mm", name, yaw_deg,
                              faces.error_mm(fit.shape_coefficients, subject.alpha));
                };
                add("thesis", thesis.fit(subject.images[0], centre));
                if (name != thesis_rule) {
                    add("joint", joint.fit(subject.images[0], centre).fit);
                }
            }
        }
    }
}

/// The neutral shape's error of all methods for one protocol.
void compare(const PlantedFaces& faces, const Protocol& protocol, int num_subjects, const char* quantity, double x,
             Table& table)
{
    const FaceFitter thesis(faces.model(), "ibug68", thesis_options(ContourMode::fixed));
    const FaceFitter published(faces.model(), "ibug68", published_options());
    const JointFitter joint(faces.model(), "ibug68", joint_options(ContourMode::fixed));
    const JointFitter informed(faces.model(), "ibug68", joint_with_noise_known(faces, protocol.noise_px));
    for (const Subject& subject : faces.draw_subjects(protocol, num_subjects)) {
        const auto add = [&](const char* series, const Eigen::VectorXd& alpha) {
            table.add(quantity, series, x, faces.error_mm(alpha, subject.alpha));
        };
        add("mean face", Eigen::VectorXd::Zero(subject.alpha.size()));
        add("thesis, default", fit_frames(thesis, subject.images, centre).shape_coefficients);
        add("thesis, published setting",
            fit_frames(published, subject.images, centre, PriorCount::per_frame).shape_coefficients);
        add("joint, default", joint.fit_frames(subject.images, centre).shape_coefficients);
        add("joint, noise known", informed.fit_frames(subject.images, centre).shape_coefficients);
    }
}

void errors(const PlantedFaces& faces, int num_subjects)
{
    Table table("error");
    for (const double noise_px : {0.0, 0.5, 1.0, 2.0, 2.8, 4.0, 6.0, 8.0}) {
        Protocol protocol;
        protocol.noise_px = noise_px;
        compare(faces, protocol, num_subjects, "noise", noise_px, table);
    }
    for (const int num_images : {1, 2, 3, 5, 10, 20}) {
        Protocol protocol;
        protocol.num_images = num_images;
        compare(faces, protocol, num_subjects / 2, "images", num_images, table);
    }
    for (const int yaw_deg : {0, 10, 20, 30, 40, 50, 60, 75, 90}) {
        Protocol protocol;
        protocol.min_yaw_deg = protocol.max_yaw_deg = yaw_deg;
        compare(faces, protocol, num_subjects, "yaw", yaw_deg, table);
    }
}

/// Predicted root mean square error of the face's vertices beside the one made, in model space, nothing aligned.
void posterior(const PlantedFaces& faces, int num_subjects)
{
    Table table("posterior");
    for (const int num_images : {1, 2, 5, 10}) {
        Protocol protocol;
        protocol.num_images = num_images;
        const std::vector<Subject> subjects = faces.draw_subjects(protocol, num_subjects / 2);
        for (const auto& [suffix, options] : {std::pair{"noise known", joint_with_noise_known(faces, 2.8)},
                                              std::pair{"default", joint_options(ContourMode::fixed)}}) {
            const JointFitter joint(faces.model(), "ibug68", options);
            for (const Subject& subject : subjects) {
                const JointFramesResult fit = joint.fit_frames(subject.images, centre);
                const Eigen::Matrix3Xf spread = vertex_standard_deviations(faces.model(), fit.shape_covariance);
                const Eigen::VectorXf difference =
                    faces.model().shape.instance(fit.shape_coefficients) - faces.model().shape.instance(subject.alpha);
                const Eigen::Map<const Eigen::Matrix3Xf> offset(difference.data(), 3, spread.cols());
                const auto mean_square = [&](const auto& columns) {
                    return static_cast<double>(
                        columns(Eigen::all, faces.face_vertices()).colwise().squaredNorm().mean());
                };
                table.add("predicted_mm2", suffix, num_images, mean_square(spread));
                table.add("made_mm2", suffix, num_images, mean_square(offset));
            }
        }
    }
}

} // namespace

int main(int argc, char** argv)
{
    const bench::Options given(argc, argv, "fit_study [--model FILE] [--subjects N] [--only PART]");
    const std::string only = given.text("--only", "");
    const int num_subjects = given.count("--subjects", 200, 8);
    try {
        const PlantedFaces faces(load_model(given.text("--model", default_model_path())));
        std::printf("# %s, %d subjects (half of them for several images)\npart,quantity,series,x,mean,error,count\n",
                    faces.model().name.c_str(), num_subjects);
        const auto run = [&](const char* name, void (*part)(const PlantedFaces&, int)) {
            if (only.empty() || only == name) {
                part(faces, num_subjects);
            }
        };
        run("convergence", convergence);
        run("pose", pose);
        run("parts", parts);
        run("contour", contours);
        run("error", errors);
        run("posterior", posterior);
    } catch (const Error& error) {
        std::fprintf(stderr, "fit_study: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
