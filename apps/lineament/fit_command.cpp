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
#include "lineament/vision/mesh_yaw.hpp"

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <span>

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
    FaceFinder finder;

    explicit Session(const Options& options_)
        : options(options_), model(load_chosen_model(options_.model)), fitters(model, options_.model),
          layout(make_texture_layout(model, options_.files.texture_size)), finder(options_.finder)
    {}
};

/// Where the landmarks of a picture may be: in the file given, or in one with the picture's stem in the folder given.
std::vector<fs::path> landmark_candidates(const fs::path& picture, const std::string& landmarks)
{
    std::error_code ignored;
    if (!fs::is_directory(landmarks, ignored)) {
        return {landmarks};
    }
    std::vector<fs::path> candidates;
    for (const char* extension : {".pts", ".json", ".csv"}) {
        candidates.push_back(fs::path(landmarks) / (picture.stem().string() + extension));
    }
    return candidates;
}

fs::path landmark_file_of(const fs::path& picture, const std::string& landmarks)
{
    const std::vector<fs::path> candidates = landmark_candidates(picture, landmarks);
    if (candidates.size() == 1) {
        return candidates.front();
    }
    std::string tried;
    std::error_code ignored;
    for (const fs::path& candidate : candidates) {
        if (fs::exists(candidate, ignored)) {
            return candidate;
        }
        tried += (tried.empty() ? "" : ", ") + candidate.filename().string();
    }
    throw Failure(system_failed,
                  landmarks + ": no landmark file for " + picture.string() + " (looked for " + tried + ")");
}

std::string size_text(int width, int height)
{
    return std::to_string(width) + " x " + std::to_string(height);
}

/// @throws Failure(bad_input) if the file says that its image has another size than the picture.
void check_image_size(const LandmarkFile& file, const fs::path& path, const fs::path& picture_path,
                      const ImageU8& picture)
{
    const int width = file.image_width.value_or(picture.width);
    const int height = file.image_height.value_or(picture.height);
    if (width != picture.width || height != picture.height) {
        throw Failure(bad_input, path.string() + ":/image: expected the size of " + picture_path.string() + ", " +
                                     size_text(picture.width, picture.height) + ", found " + size_text(width, height) +
                                     "; are these the landmarks of another picture?");
    }
}

/// @throws Failure(no_answer) if more than half of a face's landmarks lie outside the picture.
void check_inside(const LandmarkSet& set, const fs::path& path, const fs::path& picture_path, const ImageU8& picture)
{
    const auto num_outside = std::count_if(set.landmarks.begin(), set.landmarks.end(), [&](const Landmark& landmark) {
        const Eigen::Vector2d& point = landmark.point_px;
        return point.minCoeff() < 0.0 || point.x() > picture.width || point.y() > picture.height;
    });
    if (2 * static_cast<std::size_t>(num_outside) > set.landmarks.size()) {
        throw Failure(no_answer, path.string() + ": " + std::to_string(num_outside) + " of " +
                                     std::to_string(set.landmarks.size()) + " landmarks lie outside " +
                                     picture_path.string() + " (" + size_text(picture.width, picture.height) +
                                     "); are they those of another picture or size?");
    }
}

/// @throws Failure(bad_input) if the faces of a file are seen at different times: rows of a video, not of a picture.
void check_one_time(const LandmarkFile& file, const fs::path& path)
{
    for (const LandmarkFrame& frame : file.frames) {
        const LandmarkFrame& first = file.frames.front();
        if (frame.frame != first.frame || frame.time_s != first.time_s) {
            throw Failure(bad_input, path.string() + ": expected the landmarks of one picture, found the " +
                                         std::to_string(file.frames.size()) +
                                         " rows of a video; keep the rows of the frame that the picture shows");
        }
    }
}

/// Of the box around the landmarks [px^2].
double area_of(const LandmarkSet& set)
{
    Eigen::AlignedBox2d box;
    for (const Landmark& landmark : set.landmarks) {
        box.extend(landmark.point_px);
    }
    return box.isEmpty() ? 0.0 : box.volume();
}

/// The landmarks of one face in a picture.
struct SeenFace
{
    LandmarkSet landmarks;
    std::vector<Eigen::Matrix2d> covariances_px = {}; ///< As JointFitter takes them, or none.
};

/// Warns, or throws Failure(wrong_use), where the noise that a file states is not what the fit goes by.
void check_use_of_covariances(const Options& options, const fs::path& path)
{
    if (options.model.method != "joint") {
        warn_of_input(path.string() + ": its covariances are left out of --method thesis, to which all landmarks are "
                                      "alike");
    } else if (options.model.noise_mm || options.model.outline_noise_mm) {
        throw Failure(wrong_use, "--noise and --outline-noise: " + path.string() +
                                     " itself states the covariance of each landmark");
    } else if (options.finder.outline != "none") {
        throw Failure(wrong_use, "--outline would add landmarks to those of " + path.string() +
                                     " that have no covariance, where each must have one");
    }
}

std::vector<SeenFace> find_faces(Session& session, const fs::path& picture_path, const ImageU8& picture)
{
    const Options& options = session.options;
    std::vector<SeenFace> faces;
    fs::path landmark_path;
    if (!options.landmarks.empty()) {
        LandmarkFileOptions file_options;
        file_options.pts_origin = options.pts_origin == "zero" ? PtsOrigin::zero_based : PtsOrigin::one_based;
        file_options.pts_header = options.pts_headerless ? PtsHeader::optional : PtsHeader::required;
        file_options.units = options.landmark_units == "normalized" ? LandmarkUnits::normalized : LandmarkUnits::pixels;
        file_options.mediapipe_points = session.model.find_landmark_map("mediapipe478") != nullptr
                                            ? MediapipePoints::mediapipe478
                                            : MediapipePoints::ibug68;
        file_options.image_width = picture.width;
        file_options.image_height = picture.height;
        landmark_path = landmark_file_of(picture_path, options.landmarks);
        const LandmarkFile file = load_landmarks(landmark_path.string(), file_options);
        check_image_size(file, landmark_path, picture_path, picture);
        check_one_time(file, landmark_path);
        for (const LandmarkFrame& frame : file.frames) {
            if (!frame.set.landmarks.empty()) {
                faces.push_back({frame.set, frame.covariances_px});
            }
        }
        std::stable_sort(faces.begin(), faces.end(), [](const SeenFace& a, const SeenFace& b) {
            return area_of(a.landmarks) > area_of(b.landmarks);
        });
        if (faces.empty()) {
            throw Failure(no_answer, landmark_path.string() + ": the file holds no face");
        }
    } else {
        for (FoundFace& face : session.finder.find(picture)) {
            faces.push_back({std::move(face.landmarks)});
        }
        if (faces.empty()) {
            throw Failure(no_answer, "no face found in " + picture_path.string() + " (" +
                                         size_text(picture.width, picture.height) +
                                         "); give --landmarks, or a picture with a larger, more frontal face");
        }
    }
    if (options.face > 0) {
        if (options.face > static_cast<int>(faces.size())) {
            throw Failure(no_answer, picture_path.string() + ": --face " + std::to_string(options.face) +
                                         ", but only " + std::to_string(faces.size()) +
                                         " found (the largest is number 1)");
        }
        faces = {faces[static_cast<std::size_t>(options.face - 1)]};
    }
    for (SeenFace& face : faces) {
        LandmarkSet& set = face.landmarks;
        if (!face.covariances_px.empty()) {
            check_use_of_covariances(options, landmark_path);
        }
        if (!options.landmarks.empty()) {
            check_inside(set, landmark_path, picture_path, picture);
            if (set.scheme == "mediapipe478") {
                session.finder.add_outline(picture, set);
                doubt_folded_points(set);
            } else if (options.finder.outline != "none") {
                throw Failure(wrong_use, "--outline adds to the points of mediapipe; those of " +
                                             landmark_path.string() + " are of the scheme " + set.scheme);
            }
        }
        const std::string scheme = set.scheme;
        set = session.fitters.in_scheme_of_model(std::move(set));
        if (set.scheme != scheme && !face.covariances_px.empty()) {
            throw Failure(bad_input, landmark_path.string() + ": covariances of landmarks of " + scheme +
                                         ", which this model does not have; give those of " + set.scheme);
        }
    }
    return faces;
}

/// A picture with the faces found in it.
struct SeenPicture
{
    ImageU8 picture;
    std::vector<SeenFace> faces;

    [[nodiscard]] Eigen::Vector2d center() const { return {0.5 * picture.width, 0.5 * picture.height}; }
};

/// Warns of a name that belongs to another format than the picture's.
void check_extension(const fs::path& path, std::span<const std::byte> bytes)
{
    const std::optional<ContentGuess> guess = guess_content(bytes);
    const std::string extension = lower_extension(path);
    const bool is_png = guess && guess->kind == "a PNG image";
    const bool fits = is_png ? extension == ".png" : extension == ".jpg" || extension == ".jpeg";
    if (guess && !fits && !extension.empty()) {
        warn_of_input(path.string() + ": the name ends in " + extension + ", but the file is " + guess->kind +
                      " and is read as such");
    }
}

SeenPicture look_at(Session& session, const fs::path& path)
{
    ImageLimits limits;
    limits.max_megapixels = session.options.max_megapixels;
    SeenPicture seen;
    const std::vector<std::byte> bytes = read_file(path);
    seen.picture = parse_image(bytes, path.string(), limits);
    check_extension(path, bytes);
    seen.faces = find_faces(session, path, seen.picture);
    return seen;
}

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
        const int id = options.face > 0 ? options.face : static_cast<int>(i) + 1;
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
    const SeenPicture seen = look_at(session, job.input);
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
            const SeenPicture seen = look_at(session, jobs[i].input);
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
    limits.max_megapixels = session.options.max_megapixels;
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
        const std::vector<fs::path> landmarks = landmark_candidates(job.input, options.landmarks);
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
    command->add_option("--landmarks", options->landmarks,
                        "Landmark file of the picture, or a folder with <stem>.pts, .json or .csv; no detection then. "
                        "Our JSON may state the covariance of each landmark.");
    command->add_option("--pts-origin", options->pts_origin, "Where .pts files put the first pixel.")
        ->check(CLI::IsMember({"one", "zero"}))
        ->capture_default_str();
    command->add_flag("--pts-headerless", options->pts_headerless, "Accept .pts files that lack their header.");
    command->add_option("--landmark-units", options->landmark_units, "What the numbers of landmark files mean.")
        ->check(CLI::IsMember({"pixels", "normalized"}))
        ->capture_default_str();
    add_finder_options(*command, options->finder, true);
    command->add_option("--face", options->face, "Only this face (1: the largest); default: all.")
        ->check(CLI::PositiveNumber);
    command->add_flag("--same-person", options->same_person,
                      "All pictures show one person: one identity for all, from the largest face (or --face) of each.");
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
