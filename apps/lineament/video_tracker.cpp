// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "video_tracker.hpp"

#include "console.hpp"
#include "fit_outputs.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/version.hpp"
#include "lineament/fit/fitted_shape.hpp"
#include "lineament/fit/frame_selection.hpp"
#include "lineament/fit/gaze.hpp"
#include "lineament/io/file.hpp"
#include "lineament/io/glb_file.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/render/texture_completion.hpp"
#include "lineament/report/overlay.hpp"
#include "lineament/vision/short_runs.hpp"
#include "lineament/vision/video_writer.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace lineament::cli {

namespace fs = std::filesystem;

namespace {

bool is_drawable(FitStatus status)
{
    return status != FitStatus::degenerate && status != FitStatus::too_few_correspondences;
}

double now_s()
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Eigen::Vector2d center_of(const VideoInfo& info)
{
    return {0.5 * info.width, 0.5 * info.height};
}

double median(std::vector<double> values)
{
    if (values.empty()) {
        return 0.0;
    }
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// A frame as `lineament track` reports it: the row of frames.csv.
TrackRow make_row(std::size_t index, double time_s, const std::optional<FitResult>& fit, double confidence)
{
    TrackRow row;
    row.frame = static_cast<int>(index);
    row.time_s = time_s;
    row.status = fit ? to_string(fit->status) : "no_face";
    if (fit && is_drawable(fit->status)) {
        row.face = 1;
        row.camera = fit->camera;
        row.rms_px = fit->rms_px;
        row.chi_square = fit->chi_square;
        row.quality = confidence;
        row.expression_coefficients = fit->expression_coefficients;
        if (const std::optional<EyeGaze> gaze = measure_gaze(*fit).mean()) {
            row.gaze_yaw = gaze->yaw;
            row.gaze_pitch = gaze->pitch;
        }
    }
    return row;
}

/// The frames' poses and expressions as an animation.
std::vector<GlbKeyframe> make_animation(const std::vector<TrackRow>& rows)
{
    std::vector<GlbKeyframe> keyframes;
    for (const TrackRow& row : rows) {
        if (row.camera) {
            keyframes.push_back({row.time_s, *row.camera, row.expression_coefficients});
        }
    }
    return keyframes;
}

/// Divides the summed weights of a fused texture by their largest, so that they lie in [0, 1].
void normalize_weights(TextureMap& map)
{
    const float largest = *std::max_element(map.weight.data.begin(), map.weight.data.end());
    for (float& weight : map.weight.data) {
        weight = largest > 0.0f ? weight / largest : 0.0f;
    }
}

/// Weights [0, 1] as grey.
ImageU8 as_grey(const ImageF& weight)
{
    ImageU8 grey(weight.width, weight.height, 1);
    std::transform(weight.data.begin(), weight.data.end(), grey.data.begin(), to_u8);
    return grey;
}

} // namespace

/// What the first pass keeps of a frame: a few kB, since there may be a hundred thousand of them.
struct VideoTracker::SeenFrame
{
    double time_s = 0.0;
    bool has_face = false;
    double confidence = 0.0;
    /// Image point, depth (NaN: none) and confidence of the landmarks, whose names are the same in all frames.
    Eigen::Matrix4Xf landmarks = {};
    FitResult fit = {}; ///< Of this frame alone, without its landmarks.
};

std::vector<std::string> track_file_names()
{
    return {
        "face.glb",  "frames.csv", "frontal.png", "overlay.mp4", "report.html", "texture.png", "texture_confidence.png",
        "track.json"};
}

VideoTracker::VideoTracker(const TrackOptions& options)
    : options_(options), model_(load_chosen_model(options.model)), fitters_(model_, options.model),
      layout_(make_texture_layout(model_, options.texture_size)), finder_(options.finder)
{}

std::vector<VideoTracker::SeenFrame> VideoTracker::watch(const Job& job, VideoInfo& info,
                                                         std::optional<std::string>& problem)
{
    VideoReader reader(job.input.string());
    info = reader.info();
    const Eigen::Vector2d principal_point = center_of(info);
    ProgressBar bar("watch", static_cast<std::size_t>(std::max<std::int64_t>(info.num_frames, 0)));
    std::vector<SeenFrame> seen;
    std::optional<FoundFace> face;
    while (std::optional<VideoFrame> frame = reader.next()) {
        SeenFrame now;
        now.time_s = frame->time_s;
        if (face) {
            face = finder_.follow(frame->picture, *face);
        }
        if (!face) {
            face = finder_.find_one(frame->picture);
        }
        if (face) {
            landmarks_ = fitters_.in_scheme_of_model(face->landmarks);
            now.has_face = true;
            now.confidence = face->confidence;
            now.landmarks.resize(4, static_cast<Eigen::Index>(landmarks_.landmarks.size()));
            for (Eigen::Index i = 0; i < now.landmarks.cols(); ++i) {
                const Landmark& landmark = landmarks_.landmarks[static_cast<std::size_t>(i)];
                now.landmarks.col(i) << landmark.point_px.cast<float>(),
                    static_cast<float>(landmark.depth_px.value_or(std::numeric_limits<double>::quiet_NaN())),
                    static_cast<float>(landmark.confidence);
            }
            now.fit = fitters_.fit_frame(landmarks_, principal_point);
            now.fit.landmarks = {};
        }
        seen.push_back(std::move(now));
        bar.show(seen.size());
        if (signal_exit_code() != 0) {
            break;
        }
    }
    problem = reader.problem();
    std::vector<bool> has_face;
    for (const SeenFrame& frame : seen) {
        has_face.push_back(frame.has_face);
    }
    const std::vector<bool> is_false_alarm = find_short_runs(has_face);
    for (std::size_t i = 0; i < seen.size(); ++i) {
        seen[i].has_face = seen[i].has_face && !is_false_alarm[i];
    }
    return seen;
}

LandmarkSet VideoTracker::landmarks_of(const SeenFrame& frame) const
{
    LandmarkSet set = landmarks_;
    for (std::size_t i = 0; i < set.landmarks.size(); ++i) {
        const Eigen::Vector4d seen = frame.landmarks.col(static_cast<Eigen::Index>(i)).cast<double>();
        set.landmarks[i].point_px = seen.head<2>();
        set.landmarks[i].depth_px = std::isnan(seen[2]) ? std::nullopt : std::optional(seen[2]);
        set.landmarks[i].confidence = seen[3];
    }
    return set;
}

TrackFileFace VideoTracker::fit_person(const std::vector<SeenFrame>& seen, const Eigen::Vector2d& principal_point_px)
{
    std::vector<FitResult> fits;
    std::vector<const SeenFrame*> fitted_frames;
    for (const SeenFrame& frame : seen) {
        if (frame.has_face && frame.fit.status == FitStatus::success) {
            fits.push_back(frame.fit);
            fitted_frames.push_back(&frame);
        }
    }
    FrameSelectionOptions selection;
    selection.max_frames = options_.num_identity_frames;
    std::vector<LandmarkSet> chosen;
    for (const int index : select_spread_frames(fits, selection)) {
        chosen.push_back(landmarks_of(*fitted_frames[static_cast<std::size_t>(index)]));
    }
    if (chosen.empty()) {
        throw Failure(no_answer, "no frame with a trustworthy fit");
    }
    TrackFileFace person;
    person.shape_coefficients = fitters_.fit_identity(chosen, principal_point_px);
    person.unobservable_expressions =
        fitters_.unobservable_expressions(chosen, principal_point_px, person.shape_coefficients);
    return person;
}

TrackSummary VideoTracker::track(const Job& job)
{
    const double begin_s = now_s();
    VideoInfo info;
    std::optional<std::string> problem;
    const std::vector<SeenFrame> seen = watch(job, info, problem);
    const std::string name = job.input.string();
    if (signal_exit_code() != 0) {
        throw Failure(signal_exit_code(), name + ": interrupted while the video was watched; nothing is written");
    }
    if (std::none_of(seen.begin(), seen.end(), [](const SeenFrame& frame) { return frame.has_face; })) {
        if (problem) {
            throw Failure(bad_input, name + ": " + *problem);
        }
        throw Failure(no_answer, name + ": no face found in any of " + std::to_string(seen.size()) + " frames");
    }
    const Eigen::Vector2d principal_point = center_of(info);
    TrackFileFace person = fit_person(seen, principal_point);

    // Second pass: pose and expression of every frame for that identity, overlay and texture.
    make_folder(job.output);
    AtomicFile overlay_file(job.output / "overlay.mp4");
    VideoWriterOptions writer_options;
    writer_options.expected_frame_rate = info.frame_rate > 0.0 ? info.frame_rate : 25.0;
    VideoWriter writer(overlay_file.temporary_path().string(), writer_options);
    TextureAccumulator texture(layout_.size());
    TrackReport report;
    std::vector<TrackRow>& rows = report.rows;
    std::optional<FitResult> previous;
    {
        VideoReader reader(name);
        ProgressBar bar("fit", seen.size());
        constexpr std::size_t num_thumbnails = 8;
        const std::size_t thumbnail_step = std::max<std::size_t>(1, seen.size() / num_thumbnails);
        for (std::size_t i = 0; i < seen.size() && signal_exit_code() == 0; ++i) {
            std::optional<VideoFrame> frame = reader.next();
            if (!frame) {
                break;
            }
            std::optional<FitResult> fit;
            if (seen[i].has_face) {
                fit = fitters_.fit_pose_and_expression(landmarks_of(seen[i]), principal_point,
                                                       person.shape_coefficients, previous ? &*previous : nullptr);
            }
            const bool is_drawn = fit && is_drawable(fit->status);
            rows.push_back(make_row(i, seen[i].time_s, fit, seen[i].confidence));
            ++person.status_counts[rows.back().status];
            ImageU8 picture = std::move(frame->picture);
            if (is_drawn) {
                if (fit->status == FitStatus::success) {
                    const Mesh mesh = model_.mesh_of(shape_of(model_, *fit));
                    const TextureMap seen_texture = extract_face_texture(model_, layout_, mesh, fit->camera, picture);
                    texture.add(seen_texture, sharpness(seen_texture));
                }
                picture = draw_overlay(picture, model_, *fit);
            }
            previous = is_drawn ? fit : std::nullopt;
            writer.write(picture, seen[i].time_s);
            if (i % thumbnail_step == thumbnail_step / 2) {
                report.thumbnails.push_back({seen[i].time_s, std::move(picture)});
            }
            bar.show(i + 1);
        }
        problem = problem ? problem : reader.problem();
    }
    const bool is_interrupted = rows.size() < seen.size() && signal_exit_code() != 0;
    if (!problem && !is_interrupted && rows.size() < seen.size()) {
        problem = "the video gave fewer frames when it was read a second time; did the file change?";
    }
    if (rows.empty()) {
        throw is_interrupted
            ? Failure(signal_exit_code(), name + ": interrupted before the first frame was fitted; nothing is written")
            : Failure(bad_input, name + ": " + *problem + "; nothing is written");
    }
    writer.finish();
    overlay_file.commit();
    write_results(job, info, person, texture, !problem && !is_interrupted, report);

    TrackSummary summary;
    summary.num_frames = static_cast<std::int64_t>(rows.size());
    std::vector<double> rms_px;
    for (const TrackRow& row : rows) {
        if (row.rms_px) {
            rms_px.push_back(*row.rms_px);
        }
    }
    summary.num_tracked = static_cast<std::int64_t>(rms_px.size());
    summary.duration_s = rows.back().time_s - rows.front().time_s;
    summary.median_rms_px = median(std::move(rms_px));
    summary.frames_per_second = static_cast<double>(rows.size()) / (now_s() - begin_s);
    if (is_interrupted) {
        throw Failure(signal_exit_code(), name + ": interrupted; the files written are whole and hold the first " +
                                              std::to_string(rows.size()) + " of " + std::to_string(seen.size()) +
                                              " frames");
    }
    if (problem) {
        throw Failure(bad_input, name + ": " + *problem + "; the results hold the frames up to there");
    }
    return summary;
}

void VideoTracker::write_results(const Job& job, const VideoInfo& info, const TrackFileFace& person,
                                 const TextureAccumulator& texture, bool is_complete, TrackReport& report) const
{
    const std::vector<TrackRow>& rows = report.rows;
    const Blendshapes* expressions = model_.find_expression_set(options_.model.expression_set);
    const std::vector<std::string> expression_names =
        expressions != nullptr ? expressions->names : std::vector<std::string>{};
    save_frames_csv((job.output / "frames.csv").string(), rows, expression_names);

    TrackFile file;
    file.width = info.width;
    file.height = info.height;
    file.num_frames = static_cast<int>(rows.size());
    file.duration_s = rows.back().time_s - rows.front().time_s;
    if (rows.size() > 1 && file.duration_s > 0.0) {
        file.frame_rate = static_cast<double>(rows.size() - 1) / file.duration_s;
    }
    file.is_complete = is_complete;
    report.is_complete = is_complete;
    file.model = model_.name;
    file.method = options_.model.method;
    file.focal_px = fitters_.focal_px();
    file.principal_point_px = center_of(info);
    file.landmark_scheme = landmarks_.scheme;
    file.expression_set = expressions != nullptr ? expressions->name : "";
    file.expression_names = expression_names;
    file.faces.push_back(person);
    save_track_json((job.output / "track.json").string(), file);

    TextureMap map = texture.texture();
    normalize_weights(map);
    const ImageU8 whole_texture = complete_texture(map).color;
    save_png((job.output / "texture.png").string(), mark_holes(map, HoleMark::transparent));
    save_png((job.output / "texture_confidence.png").string(), as_grey(map.weight));
    const Mesh neutral = neutral_mesh(model_, person.shape_coefficients);
    save_png((job.output / "frontal.png").string(), render_frontal(neutral, whole_texture));

    GlbScene scene;
    scene.mesh = neutral;
    scene.texture = png_text(whole_texture);
    scene.morph_targets = make_morph_targets(model_, file.expression_set, {});
    scene.animation = make_animation(rows);
    save_glb((job.output / "face.glb").string(), scene);

    report.title = job.input.filename().string();
    report.width = info.width;
    report.height = info.height;
    report.frame_rate = file.frame_rate;
    report.model_name = model_.name;
    report.program = std::string("lineament ") + version;
    report.expression_names = expression_names;
    FitResult neutral_fit;
    neutral_fit.shape_coefficients = person.shape_coefficients;
    neutral_fit.expression_set = file.expression_set;
    neutral_fit.expression_coefficients = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(expression_names.size()));
    report.faces.push_back({person.id, make_face_view(model_, neutral_fit, whole_texture), as_grey(map.weight),
                            person.unobservable_expressions});
    write_file(job.output / "report.html", std::string_view(format_track_report(report)));
}

} // namespace lineament::cli
