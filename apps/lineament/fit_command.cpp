// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"
#include "face_finder.hpp"
#include "fit_outputs.hpp"
#include "fitters.hpp"
#include "inputs.hpp"
#include "model_options.hpp"

#include "lineament/core/version.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/fit_file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/landmark_file.hpp"
#include "lineament/report/fit_report.hpp"
#include "lineament/report/overlay.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace lineament::cli {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

struct Options
{
    std::vector<std::string> inputs;
    std::string output = ".";
    std::string landmarks;
    std::string pts_origin = "one";
    bool pts_headerless = false;
    std::string landmark_units = "pixels";
    FinderOptions finder;
    int face = 0;
    double max_megapixels = 64.0;
    bool json = false;
    bool no_obj = false;
    bool no_report = false;
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
    FaceFinder finder;

    explicit Session(const Options& options_)
        : options(options_), model(load_chosen_model(options_.model)), fitters(model, options_.model),
          layout(make_texture_layout(model, options_.files.texture_size)), finder(options_.finder)
    {}
};

/// The landmark file of a picture: the file given, or the one with the picture's stem in the folder given.
fs::path landmark_file_of(const fs::path& picture, const std::string& landmarks)
{
    std::error_code ignored;
    if (!fs::is_directory(landmarks, ignored)) {
        return landmarks;
    }
    std::string tried;
    for (const char* extension : {".pts", ".json", ".csv"}) {
        const fs::path candidate = fs::path(landmarks) / (picture.stem().string() + extension);
        if (fs::exists(candidate, ignored)) {
            return candidate;
        }
        tried += (tried.empty() ? "" : ", ") + candidate.filename().string();
    }
    throw Failure(system_failed,
                  landmarks + ": no landmark file for " + picture.string() + " (looked for " + tried + ")");
}

std::vector<LandmarkSet> find_landmarks(Session& session, const fs::path& picture_path, const ImageU8& picture)
{
    const Options& options = session.options;
    std::vector<LandmarkSet> sets;
    if (!options.landmarks.empty()) {
        LandmarkFileOptions file_options;
        file_options.pts_origin = options.pts_origin == "zero" ? PtsOrigin::zero_based : PtsOrigin::one_based;
        file_options.pts_header = options.pts_headerless ? PtsHeader::optional : PtsHeader::required;
        file_options.units = options.landmark_units == "normalized" ? LandmarkUnits::normalized : LandmarkUnits::pixels;
        file_options.image_width = picture.width;
        file_options.image_height = picture.height;
        const fs::path file = landmark_file_of(picture_path, options.landmarks);
        for (const LandmarkFrame& frame : load_landmarks(file.string(), file_options).frames) {
            if (!frame.set.landmarks.empty()) {
                sets.push_back(frame.set);
            }
        }
        if (sets.empty()) {
            throw Failure(no_answer, file.string() + ": the file holds no face");
        }
    } else {
        for (FoundFace& face : session.finder.find(picture)) {
            sets.push_back(std::move(face.landmarks));
        }
        if (sets.empty()) {
            throw Failure(no_answer, "no face found in " + picture_path.string() + " (" +
                                         std::to_string(picture.width) + " x " + std::to_string(picture.height) +
                                         "); give --landmarks, or a picture with a larger, more frontal face");
        }
    }
    if (options.face > 0) {
        if (options.face > static_cast<int>(sets.size())) {
            throw Failure(no_answer, picture_path.string() + ": --face " + std::to_string(options.face) +
                                         ", but only " + std::to_string(sets.size()) +
                                         " found (the largest is number 1)");
        }
        sets = {sets[static_cast<std::size_t>(options.face - 1)]};
    }
    for (LandmarkSet& set : sets) {
        set = session.fitters.in_scheme_of_model(std::move(set));
    }
    return sets;
}

/// Fits every face of a picture and writes its files; the summary goes to `json`.
/// @throws Failure(no_answer) if no face has a trustworthy fit; what could be drawn is written all the same.
void fit_picture(Session& session, const Job& job, Json& json)
{
    const Options& options = session.options;
    ImageLimits limits;
    limits.max_megapixels = options.max_megapixels;
    const ImageU8 picture = load_image(job.input.string(), limits);
    const std::vector<LandmarkSet> sets = find_landmarks(session, job.input, picture);
    const Eigen::Vector2d principal_point(0.5 * picture.width, 0.5 * picture.height);

    FitFile file;
    file.width = picture.width;
    file.height = picture.height;
    file.model = session.model.name;
    FitReport report;
    report.title = job.input.filename().string();
    report.picture = picture;
    report.overlay = picture;
    report.model_name = session.model.name;
    report.program = std::string("lineament ") + version;
    report.focal_px = options.model.focal_px > 0 ? std::optional(options.model.focal_px) : std::nullopt;

    make_folder(job.output);
    std::string problems;
    json["faces"] = Json::array();
    for (std::size_t i = 0; i < sets.size(); ++i) {
        const int id = options.face > 0 ? options.face : static_cast<int>(i) + 1;
        const FitResult fit = session.fitters.fit(sets[i], principal_point);
        file.method = fit.method;
        file.faces.push_back({id, fit, {}, {}});
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
        const FittedFace face = make_fitted_face(id, fit, session.model, session.layout, picture);
        const fs::path folder = sets.size() == 1 ? job.output : job.output / ("face_" + std::to_string(id));
        make_folder(folder);
        write_face(folder, session.model, face, options.files);
        report.overlay = draw_overlay(report.overlay, session.model, fit);
        report.faces.push_back({"face_" + std::to_string(id),
                                fit,
                                make_face_view(session.model, fit, face.whole_texture),
                                face.frontal,
                                {},
                                {}});
        face_json["folder"] = folder.string();
        face_json["rms_px"] = fit.rms_px;
    }
    save_png((job.output / "overlay.png").string(), report.overlay);
    save_fit_json((job.output / "fit.json").string(), file);
    if (options.files.report) {
        write_file(job.output / "report.html", std::string_view(format_fit_report(report)));
    }
    if (!problems.empty()) {
        throw Failure(no_answer, job.input.string() + ": " + problems);
    }
}

int run(const Options& options)
{
    const std::vector<Job> jobs = collect_jobs(options.inputs, options.output, {".jpg", ".jpeg", ".png"});
    Session session(options);
    Json summary = Json::array();
    int failed = 0;
    int last_code = all_done;
    ProgressBar bar("fit", jobs.size());
    for (std::size_t i = 0; i < jobs.size(); ++i) {
        bar.show(i, jobs[i].input.filename().string());
        Json entry;
        entry["input"] = jobs[i].input.string();
        entry["output"] = jobs[i].output.string();
        try {
            fit_picture(session, jobs[i], entry);
            entry["exit_code"] = static_cast<int>(all_done);
            if (!options.json) {
                print_data(printable(jobs[i].output.string()));
            }
        } catch (...) {
            const Failure failure = current_failure();
            print_error(failure.what());
            entry["exit_code"] = failure.exit_code();
            entry["error"] = failure.what();
            last_code = failure.exit_code();
            ++failed;
        }
        summary.push_back(entry);
        if (signal_exit_code() != 0) {
            break;
        }
    }
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
    return last_code;
}

} // namespace

void add_fit_command(CLI::App& program, Action& action)
{
    auto options = std::make_shared<Options>();
    CLI::App* command =
        program.add_subcommand("fit", "The 3D face in each photo: mesh, texture, pose, numbers, report.");
    command->add_option("inputs", options->inputs, "Pictures (PNG, JPEG), folders of pictures, or quoted patterns.")
        ->required();
    command->add_option("-o,--output", options->output, "Folder for the results; each input gets a folder in it.")
        ->capture_default_str();
    command->add_option("--landmarks", options->landmarks,
                        "Landmark file of the picture, or a folder with <stem>.pts, .json or .csv; no detection then.");
    command->add_option("--pts-origin", options->pts_origin, "Where .pts files put the first pixel.")
        ->check(CLI::IsMember({"one", "zero"}))
        ->capture_default_str();
    command->add_flag("--pts-headerless", options->pts_headerless, "Accept .pts files that lack their header.");
    command->add_option("--landmark-units", options->landmark_units, "What the numbers of landmark files mean.")
        ->check(CLI::IsMember({"pixels", "normalized"}))
        ->capture_default_str();
    add_finder_options(*command, options->finder);
    command->add_option("--face", options->face, "Only this face (1: the largest); default: all.")
        ->check(CLI::PositiveNumber);
    command->add_option("--max-megapixels", options->max_megapixels, "Larger pictures are refused.")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    add_model_options(*command, options->model);
    command->add_option("--texture-size", options->files.texture_size, "Texels a side of the texture.")
        ->check(CLI::Range(16, 8192))
        ->capture_default_str();
    command->add_flag("--ply", options->files.ply, "Write mesh.ply too.");
    command->add_flag("--neutral", options->files.neutral, "Write neutral.obj (no expression) too.");
    command->add_flag("--no-obj", options->no_obj, "Do not write mesh.obj and mesh.mtl.");
    command->add_flag("--no-report", options->no_report, "Do not write report.html.");
    command->add_flag("--json", options->json, "A summary as JSON on stdout.");
    command->footer("Examples:\n  lineament fit portrait.jpg\n  lineament fit photos/ -o faces --ply\n"
                    "  lineament fit a.png --landmarks a.pts --method thesis --iterations 5");
    command->callback([&action, options] {
        options->files.obj = !options->no_obj;
        options->files.report = !options->no_report;
        action = [options] { return run(*options); };
    });
}

} // namespace lineament::cli
