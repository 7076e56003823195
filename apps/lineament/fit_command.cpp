// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"
#include "fit_outputs.hpp"
#include "fitters.hpp"
#include "inputs.hpp"
#include "model_options.hpp"
#include "picture_reader.hpp"

#include "lineament/core/version.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/fit_file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/report/fit_report.hpp"
#include "lineament/report/overlay.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <memory>

namespace lineament::cli {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

struct Options
{
    std::vector<std::string> inputs;
    std::string output = ".";
    PictureOptions pictures;
    FinderOptions finder;
    bool same_person = false;
    bool json = false;
    bool no_obj = false;
    bool no_report = false;
    bool uncertainty = false;
    OutputOptions files;
    ModelOptions model;
};

/// What all pictures of a run share.
struct Session
{
    const Options& options;
    MorphableModel model;
    Fitters fitters;
    TextureLayout layout;
    PictureReader pictures;

    explicit Session(const Options& options_)
        : options(options_), model(load_chosen_model(options_.model)), fitters(model, options_.model),
          layout(make_texture_layout(model, options_.files.texture_size)),
          pictures(options_.pictures, options_.finder, options_.model, model, fitters)
    {}
};

/// Writes the files of a picture's fitted faces; the summary goes to `json`.
/// @throws Failure(no_answer) if a face has no trustworthy fit; what could be drawn is written all the same.
void write_picture(const Session& session, const Job& job, const ImageU8& picture, const std::vector<Fitted>& fits,
                   Json& json)
{
    const Options& options = session.options;
    FitFile file;
    file.width = picture.width;
    file.height = picture.height;
    file.model = session.model.name;
    FitReport report;
    report.title = job.input.filename().string();
    report.overlay = picture;
    if (options.files.report) {
        report.picture = picture;
    }
    report.model_name = session.model.name;
    report.program = std::string("lineament ") + version;

    make_folder(job.output);
    FileBatch written;
    std::string problems;
    json["faces"] = Json::array();
    for (std::size_t i = 0; i < fits.size(); ++i) {
        const int id = options.pictures.face > 0 ? options.pictures.face : static_cast<int>(i) + 1;
        const FitResult& fit = fits[i].result;
        const Eigen::VectorXd& deviations = fits[i].shape_standard_deviations;
        const Eigen::VectorXd& expression_deviations = fits[i].expression_standard_deviations;
        file.method = fit.method;
        file.faces.push_back({id,
                              fit,
                              {deviations.begin(), deviations.end()},
                              fits[i].unobservable_expressions,
                              fits[i].predicted_rms_mm,
                              {expression_deviations.begin(), expression_deviations.end()}});
        Json& face_json = json["faces"].emplace_back();
        face_json["id"] = id;
        face_json["status"] = to_string(fit.status);
        if (fit.status != FitStatus::success) {
            face_json["reason"] = fit.reason;
            problems += (problems.empty() ? "" : "; ") + std::string("face ") + std::to_string(id) + ": " +
                        to_string(fit.status) + (fit.reason.empty() ? "" : " (" + fit.reason + ")");
        }
        if (fit.status == FitStatus::degenerate || fit.status == FitStatus::too_few_correspondences) {
            continue; // there is no face to draw
        }
        if (fit.camera.phi_per_mm > 0) {
            report.focal_px = fit.camera.scale_px_per_mm / fit.camera.phi_per_mm;
        }
        const FittedFace face = make_fitted_face(id, fit, session.model, session.layout, picture);
        const fs::path folder = fits.size() == 1 ? job.output : job.output / ("face_" + std::to_string(id));
        make_folder(folder);
        write_face(written, folder, session.model, face, options.files);
        ImageU8 uncertainty;
        if (options.uncertainty && fits[i].shape_covariance.size() > 0) {
            uncertainty = write_uncertainty(written, folder, session.model, fit,
                                            session.fitters.vertex_deviations_mm(fits[i].shape_covariance));
        }
        report.overlay = draw_overlay(report.overlay, session.model, fit);
        report.faces.push_back({"face_" + std::to_string(id), fit,
                                make_face_view(session.model, fit, face.whole_texture), face.frontal, deviations,
                                fits[i].unobservable_expressions, fits[i].predicted_rms_mm, uncertainty});
        face_json["folder"] = folder.string();
        face_json["rms_px"] = fit.rms_px;
        if (fits[i].predicted_rms_mm) {
            face_json["predicted_rms_mm"] = *fits[i].predicted_rms_mm;
        }
    }
    written.write(job.output / "overlay.png", format_png(report.overlay));
    written.write(job.output / "fit.json", format_fit_json(file));
    if (options.files.report) {
        written.write(job.output / "report.html", format_fit_report(report));
    }
    written.commit();
    if (!problems.empty()) {
        throw Failure(no_answer, job.input.string() + ": " + problems);
    }
}

/// Fits every face of a picture by itself.
void fit_picture(Session& session, const Job& job, Json& json)
{
    const SeenPicture seen = session.pictures.look_at(job.input);
    std::vector<Fitted> fits;
    for (const SeenFace& face : seen.faces) {
        fits.push_back(session.fitters.fit(face.landmarks, seen.center(), face.covariances_px));
    }
    write_picture(session, job, seen.picture, fits, json);
}

/// Runs one job's work and turns what it throws into its entry of the summary. @return The exit code.
template <typename Work>
int run_job(const Options& options, const Job& job, Json& entry, const Work& work)
{
    int code = all_done;
    try {
        work();
        if (!options.json) {
            print_data(printable(job.output.string()));
        }
    } catch (...) {
        const Failure failure = current_failure();
        print_error(failure.what());
        entry["error"] = failure.what();
        code = failure.exit_code();
    }
    entry["exit_code"] = code;
    return code;
}

Json new_entry(const Job& job)
{
    Json entry;
    entry["input"] = job.input.string();
    entry["output"] = job.output.string();
    return entry;
}

/// Each picture by itself. @return The exit codes.
std::vector<int> fit_each(Session& session, const std::vector<Job>& jobs, Json& summary)
{
    std::vector<int> codes;
    ProgressBar bar("fit", jobs.size());
    for (const Job& job : jobs) {
        bar.show(codes.size(), job.input.filename().string());
        Json entry = new_entry(job);
        codes.push_back(run_job(session.options, job, entry, [&] { fit_picture(session, job, entry); }));
        summary.push_back(entry);
        if (signal_exit_code() != 0) {
            break;
        }
    }
    return codes;
}

/// One person, the largest face (or --face) of every picture: first all pictures are looked at, then one identity is
/// fitted, then each picture's files are written. @return The exit codes.
std::vector<int> fit_same_person(Session& session, const std::vector<Job>& jobs, Json& summary)
{
    std::vector<int> codes;
    std::vector<std::size_t> seen_jobs;
    std::vector<LandmarkSet> sets;
    std::vector<std::vector<Eigen::Matrix2d>> covariances_px;
    std::vector<Eigen::Vector2d> centers;
    ProgressBar bar("look", jobs.size());
    for (std::size_t i = 0; i < jobs.size() && signal_exit_code() == 0; ++i) {
        bar.show(i, jobs[i].input.filename().string());
        try {
            const SeenPicture seen = session.pictures.look_at(jobs[i].input);
            sets.push_back(seen.faces.front().landmarks);
            covariances_px.push_back(seen.faces.front().covariances_px);
            centers.push_back(seen.center());
            seen_jobs.push_back(i);
        } catch (...) {
            const Failure failure = current_failure();
            print_error(failure.what());
            Json entry = new_entry(jobs[i]);
            entry["error"] = failure.what();
            entry["exit_code"] = failure.exit_code();
            summary.push_back(entry);
            codes.push_back(failure.exit_code());
        }
    }
    if (sets.empty() || signal_exit_code() != 0) {
        return codes;
    }
    for (const LandmarkSet& set : sets) {
        if (set.scheme != sets.front().scheme) {
            throw Failure(bad_input, "--same-person: all pictures must have landmarks of one scheme, found " +
                                         sets.front().scheme + " and " + set.scheme);
        }
    }
    const std::vector<Fitted> fits = session.fitters.fit_same_person(sets, centers, covariances_px);
    ImageLimits limits;
    limits.max_megapixels = session.options.pictures.max_megapixels;
    for (std::size_t i = 0; i < fits.size() && signal_exit_code() == 0; ++i) {
        const Job& job = jobs[seen_jobs[i]];
        Json entry = new_entry(job);
        codes.push_back(run_job(session.options, job, entry, [&] {
            write_picture(session, job, load_image(job.input.string(), limits), {fits[i]}, entry);
        }));
        summary.push_back(entry);
    }
    return codes;
}

/// @throws Failure(system_failed) if a result would be written over a picture, a landmark file or the model.
void protect_inputs(const Options& options, const std::vector<Job>& jobs)
{
    std::vector<fs::path> read = {model_path_or_default(options.model.model)};
    std::vector<fs::path> written;
    for (const Job& job : jobs) {
        read.push_back(job.input);
        const std::vector<fs::path> landmarks = landmark_candidates(job.input, options.pictures.landmarks);
        read.insert(read.end(), landmarks.begin(), landmarks.end());
        const std::vector<fs::path> results = result_files(job, fit_file_names());
        written.insert(written.end(), results.begin(), results.end());
    }
    refuse_to_overwrite(read, written);
}

int run(const Options& options)
{
    if (options.uncertainty && options.model.method != "joint") {
        throw Failure(wrong_use, "--uncertainty is of --method joint: the thesis's method does not say how sure it is");
    }
    const std::vector<Job> jobs = collect_jobs(options.inputs, options.output, {".jpg", ".jpeg", ".png"});
    protect_inputs(options, jobs);
    Session session(options);
    Json summary = Json::array();
    const std::vector<int> codes =
        options.same_person ? fit_same_person(session, jobs, summary) : fit_each(session, jobs, summary);
    const auto failed = std::count_if(codes.begin(), codes.end(), [](int code) { return code != all_done; });
    if (options.json) {
        print_data(summary.dump(2, ' ', false, Json::error_handler_t::replace));
    }
    if (signal_exit_code() != 0) {
        print_error("interrupted after " + std::to_string(summary.size()) + " of " + std::to_string(jobs.size()) +
                    " inputs; what is written is whole");
        return signal_exit_code();
    }
    if (jobs.size() > 1 && failed > 0) {
        print_error(std::to_string(failed) + " of " + std::to_string(jobs.size()) + " inputs failed");
        return some_failed;
    }
    return codes.empty() ? static_cast<int>(all_done) : codes.back();
}

} // namespace

void add_fit_command(CLI::App& program, Action& action)
{
    auto options = std::make_shared<Options>();
    CLI::App* command = add_command(program, "fit", "The 3D face in each photo: mesh, texture, pose, numbers, report.");
    command->add_option("inputs", options->inputs, "Pictures (PNG, JPEG), folders of pictures, or quoted patterns.")
        ->required();
    command->add_option("-o,--output", options->output, "Folder for the results; each input gets a folder in it.")
        ->capture_default_str();
    command->add_option("--landmarks", options->pictures.landmarks,
                        "Landmark file of the picture, or a folder with <stem>.pts, .json or .csv; no detection then. "
                        "Our JSON may state the covariance of each landmark.");
    command->add_option("--pts-origin", options->pictures.pts_origin, "Where .pts files put the first pixel.")
        ->check(CLI::IsMember({"one", "zero"}))
        ->capture_default_str();
    command->add_flag("--pts-headerless", options->pictures.pts_headerless,
                      "Accept .pts files that lack their header.");
    command
        ->add_option("--landmark-units", options->pictures.landmark_units, "What the numbers of landmark files mean.")
        ->check(CLI::IsMember({"pixels", "normalized"}))
        ->capture_default_str();
    add_finder_options(*command, options->finder, true);
    command->add_option("--face", options->pictures.face, "Only this face (1: the largest); default: all.")
        ->check(CLI::PositiveNumber);
    command->add_flag("--same-person", options->same_person,
                      "All pictures show one person: one identity for all, from the largest face (or --face) of each.");
    command->add_option("--max-megapixels", options->pictures.max_megapixels, "Larger pictures are refused.")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    add_model_options(*command, options->model);
    command->add_option("--texture-size", options->files.texture_size, "Texels a side of the texture.")
        ->check(CLI::Range(16, 8192))
        ->capture_default_str();
    command->add_flag("--ply", options->files.ply, "Write mesh.ply too.");
    command->add_flag("--neutral", options->files.neutral, "Write neutral.obj (no expression) too.");
    command->add_flag("--no-obj", options->no_obj, "Do not write mesh.obj and mesh.mtl.");
    command->add_flag("--uncertainty", options->uncertainty,
                      "Write uncertainty.glb and .png too, the face coloured by each vertex's standard deviation, and "
                      "show it in the report.");
    command->add_flag("--no-report", options->no_report, "Do not write report.html.");
    command->add_flag("--json", options->json, "A summary as JSON on stdout.");
    command->footer("Examples:\n  lineament fit portrait.jpg\n  lineament fit photos/ -o faces --ply\n"
                    "  lineament fit a.png --landmarks a.pts --method thesis --iterations 5\n"
                    "  lineament fit --same-person a.jpg b.jpg c.jpg --uncertainty");
    command->callback([&action, options] {
        options->files.obj = !options->no_obj;
        options->files.report = !options->no_report;
        action = [options] { return run(*options); };
    });
}

} // namespace lineament::cli
