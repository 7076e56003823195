// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// `lineament track` on clips of a rendered person who turns the head, leaves the picture, and comes back.
#include "apps/run_program.hpp"
#include "apps/terminal.hpp"
#include "apps/turning_clip.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/frame_selection.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "lineament/vision/video_reader.hpp"
#include "support/gltf_validator.hpp"
#include "support/parsed_glb.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <sstream>

namespace lineament {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::frame_rate;
using test::num_frames;
using test::Outcome;
using test::planted_yaw_deg;
using test::read_all;
using test::run;
using test::save_turning_clip;
using test::shows_the_person;

/// The rows of frames.csv by the names of its header; no cell of a track holds a comma.
std::vector<std::map<std::string, std::string>> read_rows(const std::string& path)
{
    std::istringstream lines(read_all(path));
    std::vector<std::string> names;
    std::vector<std::map<std::string, std::string>> rows;
    for (std::string line; std::getline(lines, line);) {
        std::vector<std::string> cells(1);
        for (const char c : line) {
            c == ',' ? cells.emplace_back() : cells.back() += c;
        }
        if (names.empty()) {
            names = cells;
            continue;
        }
        EXPECT_EQ(cells.size(), names.size()) << line;
        std::map<std::string, std::string>& row = rows.emplace_back();
        for (std::size_t i = 0; i < std::min(cells.size(), names.size()); ++i) {
            row[names[i]] = cells[i];
        }
    }
    return rows;
}

double number(const std::string& text)
{
    double value = std::numeric_limits<double>::quiet_NaN();
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
}

std::vector<double> frame_times(const std::string& path)
{
    VideoReader reader(path);
    std::vector<double> times;
    while (const std::optional<VideoFrame> frame = reader.next()) {
        times.push_back(frame->time_s);
    }
    EXPECT_EQ(reader.problem(), std::nullopt) << path;
    return times;
}

/// The times of the keyframes of every channel, which are the same.
std::vector<double> animation_times(const test::ParsedGlb& glb)
{
    std::vector<double> times;
    for (const json& sampler : glb.gltf["animations"][0]["samplers"]) {
        const Eigen::MatrixXd input = glb.accessor(sampler["input"]);
        const std::vector<double> now(input.data(), input.data() + input.size());
        EXPECT_TRUE(times.empty() || times == now);
        times = now;
    }
    return times;
}

/// What holds of the files of every track that ended by itself or was stopped: a row and a picture of the overlay for
/// each of the clip's first frames, a keyframe for each row with a face. @return The rows.
std::vector<std::map<std::string, std::string>> check_files(const fs::path& folder)
{
    const auto rows = read_rows(folder / "frames.csv");
    const std::vector<double> overlay_times = frame_times(folder / "overlay.mp4");
    EXPECT_EQ(overlay_times.size(), rows.size());
    std::vector<double> times_with_face;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const int frame = static_cast<int>(i);
        EXPECT_EQ(rows[i].at("frame"), std::to_string(frame));
        const double time_s = number(rows[i].at("time_s"));
        EXPECT_NEAR(time_s, frame / frame_rate, 1e-4) << "frame " << frame;
        if (i < overlay_times.size()) {
            EXPECT_NEAR(overlay_times[i], time_s, 1e-4) << "frame " << frame;
        }
        if (!shows_the_person(frame)) {
            EXPECT_EQ(rows[i].at("status"), "no_face") << "frame " << frame;
            EXPECT_EQ(rows[i].at("face"), "") << "frame " << frame;
            EXPECT_EQ(rows[i].at("yaw_deg"), "") << "frame " << frame;
            continue;
        }
        EXPECT_EQ(rows[i].at("status"), "success") << "frame " << frame;
        EXPECT_EQ(rows[i].at("face"), "1") << "frame " << frame;
        EXPECT_NEAR(number(rows[i].at("yaw_deg")), planted_yaw_deg(frame), 5.0) << "frame " << frame;
        times_with_face.push_back(time_s);
    }
    const test::ParsedGlb glb(read_all(folder / "face.glb"));
    EXPECT_THAT(animation_times(glb), testing::Pointwise(testing::DoubleNear(1e-5), times_with_face));
    const json track = json::parse(read_all(folder / "track.json"));
    EXPECT_EQ(track["video"]["frames"], rows.size());
    EXPECT_EQ(read_all(folder / "report.html").rfind("<!DOCTYPE html>", 0), 0U);
    test::expect_no_temporary_files(folder);
    return rows;
}

TEST(Track, ATurningHeadThatLeavesAndComesBack)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4");
    const Outcome outcome = run(folder, "track clip.mp4 -o out --texture-size 128");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    EXPECT_EQ(outcome.out, "out/clip\n");
    EXPECT_NE(outcome.error.find("clip.mp4: 30 frames, face in 23, "), std::string::npos) << outcome.error;
    EXPECT_EQ(check_files(folder / "out/clip").size(), static_cast<std::size_t>(num_frames));

    const json track = json::parse(read_all(folder / "out/clip/track.json"));
    EXPECT_EQ(track["format"], "lineament-track");
    ASSERT_EQ(track["faces"].size(), 1U) << "one person";
    EXPECT_EQ(track["faces"][0]["status_counts"], (json{{"no_face", 7}, {"success", num_frames - 7}}));
    EXPECT_NEAR(track["video"]["frame_rate"].get<double>(), frame_rate, 0.01);
    EXPECT_EQ(track["landmark_scheme"], "mediapipe478");

    // The mesh that moves is that one identity: mean + B alpha of the model, in metres.
    const MorphableModel model = load_model(default_model_path());
    const auto alpha = track["faces"][0]["shape_coefficients"].get<std::vector<double>>();
    const Eigen::VectorXf shape =
        model.shape.instance(Eigen::Map<const Eigen::VectorXd>(alpha.data(), static_cast<Eigen::Index>(alpha.size())));
    const Eigen::Matrix3Xf vertices = Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices());
    const test::ParsedGlb glb(read_all(folder / "out/clip/face.glb"));
    const Eigen::MatrixXd points = glb.accessor(glb.gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"]);
    EXPECT_THAT(1000.0 * points.rowwise().minCoeff(), test::IsNear(vertices.rowwise().minCoeff(), 1e-3));
    EXPECT_THAT(1000.0 * points.rowwise().maxCoeff(), test::IsNear(vertices.rowwise().maxCoeff(), 1e-3));
    EXPECT_EQ(glb.gltf["meshes"][0]["extras"]["targetNames"], track["expression"]["names"]);
    if (!test::gltf_validator_modules().empty()) {
        EXPECT_THAT(test::validate_glb(folder / "out/clip/face.glb"), testing::HasSubstr("errors 0 warnings 0\n"));
    }
}

/// The points of the clip's face, where there is one.
std::vector<LandmarkSet> landmarks_of_clip(const std::string& path)
{
    MeshDetector detector;
    MeshDetectionOptions one;
    one.max_faces = 1;
    std::optional<MeshFace> face;
    std::vector<LandmarkSet> sets;
    VideoReader reader(path);
    while (const std::optional<VideoFrame> frame = reader.next()) {
        face = face ? detector.follow(frame->picture, face->landmarks) : std::nullopt;
        if (!face) {
            const std::vector<MeshFace> found = detector.detect(frame->picture, one);
            face = found.empty() ? std::nullopt : std::optional(found.front());
        }
        if (face) {
            sets.push_back(face->landmarks);
        }
    }
    return sets;
}

/// Those that JointFitter calls unobservable in every frame that an identity is fitted from.
std::set<std::string> unobservable_in_all(const std::vector<LandmarkSet>& frames, const std::string& method,
                                          const std::string& expression_set, const Eigen::VectorXd& shape_coefficients)
{
    const MorphableModel model = load_model(default_model_path());
    FitOptions options;
    JointOptions joint_options;
    options.expression_set = joint_options.expression_set = expression_set;
    const FaceFitter fitter(model, "mediapipe478", options);
    const JointFitter joint(model, "mediapipe478", joint_options);
    const Eigen::Vector2d center(240, 180);
    std::vector<FitResult> fits;
    for (const LandmarkSet& frame : frames) {
        fits.push_back(fitter.fit(frame, center));
    }
    const std::vector<int> chosen = select_spread_frames(fits);
    EXPECT_GE(chosen.size(), 3U);
    std::map<std::string, std::size_t> num_hidden;
    for (const int i : chosen) {
        const LandmarkSet& frame = frames[static_cast<std::size_t>(i)];
        const FitResult fit = method == "joint" ? joint.fit_pose_and_expression(frame, center, shape_coefficients).fit
                                                : fitter.fit_pose_and_expression(frame, center, shape_coefficients);
        for (const std::string& name : joint.unobservable_expressions(frame, fit)) {
            ++num_hidden[name];
        }
    }
    std::set<std::string> names;
    for (const auto& [name, hidden_in] : num_hidden) {
        if (hidden_in == chosen.size()) {
            names.insert(name);
        }
    }
    EXPECT_EQ(names.size() < num_hidden.size(), expression_set == "arkit47") << "some frames tell what others do not";
    return names;
}

TEST(Track, NamesTheExpressionsThatNoFrameTells)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4");
    const std::vector<LandmarkSet> frames = landmarks_of_clip(folder / "clip.mp4");
    for (const std::string method : {"joint", "thesis"}) {
        for (const std::string set : {"arkit47", "ekman6", "none"}) {
            const std::string arguments = "--texture-size 16 --method " + method + " --expressions " + set;
            const Outcome outcome = run(folder, "track clip.mp4 -o out " + arguments);
            ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
            const json face = json::parse(read_all(folder / "out/clip/track.json"))["faces"][0];
            const auto alpha = face["shape_coefficients"].get<std::vector<double>>();
            const auto names = face["unobservable_expressions"].get<std::set<std::string>>();
            if (set != "none") {
                const Eigen::Map<const Eigen::VectorXd> shape(alpha.data(), static_cast<Eigen::Index>(alpha.size()));
                EXPECT_EQ(names, unobservable_in_all(frames, method, set, shape)) << arguments;
            }
            EXPECT_EQ(names.count("mouthDimpleLeft"), set == "arkit47" ? 1U : 0U) << arguments;
            EXPECT_EQ(names.count("jawOpen"), 0U) << arguments;
            EXPECT_EQ(names.empty(), set != "arkit47") << arguments;
            const std::string page = read_all(folder / "out/clip/report.html");
            EXPECT_EQ(page.find("Not observable: ") == std::string::npos, names.empty()) << arguments;
        }
    }
}

std::vector<std::string> names_of_expressions(const std::string& set)
{
    return load_model(default_model_path()).find_expression_set(set)->names;
}

Eigen::VectorXd expressions_of(const std::map<std::string, std::string>& row, const std::vector<std::string>& names)
{
    Eigen::VectorXd values(static_cast<Eigen::Index>(names.size()));
    std::transform(names.begin(), names.end(), values.begin(),
                   [&](const std::string& name) { return number(row.at(name)); });
    return values;
}

/// @param fit_frame  From landmarks and the last frame's result, nullptr where that shows no face, to a result.
template <typename FitFrame>
void expect_frames(const fs::path& folder, const std::vector<LandmarkSet>& landmarks, const std::string& expression_set,
                   const FitFrame& fit_frame)
{
    const std::vector<std::string> names = names_of_expressions(expression_set);
    std::optional<FitResult> last;
    std::size_t next = 0;
    for (const std::map<std::string, std::string>& row : read_rows(folder / "frames.csv")) {
        if (row.at("face").empty()) {
            last.reset();
            continue;
        }
        ASSERT_LT(next, landmarks.size());
        last = fit_frame(landmarks[next++], last ? &*last : nullptr);
        const std::string where = "frame " + row.at("frame");
        const HeadAngles angles = angles_from_rotation(last->camera.camera_from_model);
        EXPECT_THAT(expressions_of(row, names), test::IsNear(last->expression_coefficients, 2e-3)) << where;
        EXPECT_NEAR(number(row.at("yaw_deg")), degrees(angles.yaw), 0.01) << where;
        EXPECT_NEAR(number(row.at("pitch_deg")), degrees(angles.pitch), 0.01) << where;
        EXPECT_NEAR(number(row.at("rms_px")), last->rms_px, 1e-3) << where;
        EXPECT_EQ(row.at("z_mm").empty(), last->camera.phi_per_mm == 0.0) << where;
    }
    EXPECT_EQ(next, landmarks.size());
}

/// A way to fit frames, on the command line and in the library.
struct FrameCase
{
    std::string arguments;
    std::string expression_set = "ekman6";
    RobustLoss loss = RobustLoss::student_t; ///< Of the joint method.
    std::optional<double> focal_px = std::nullopt;
};

/// Runs the program on the clip. @return The identity.
Eigen::VectorXd track_clip(const test::TemporaryFolder& folder, const std::string& arguments)
{
    const Outcome outcome = run(folder, "track clip.mp4 -o out --texture-size 16 " + arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
    const json face = json::parse(read_all(folder / "out/clip/track.json"))["faces"][0];
    const auto alpha = face["shape_coefficients"].get<std::vector<double>>();
    return Eigen::Map<const Eigen::VectorXd>(alpha.data(), static_cast<Eigen::Index>(alpha.size()));
}

TEST(Track, FramesOfTheJointMethodAreJointFitsEachFromTheLast)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4");
    const std::vector<LandmarkSet> landmarks = landmarks_of_clip(folder / "clip.mp4");
    const MorphableModel model = load_model(default_model_path());
    for (const FrameCase& how :
         {FrameCase{""}, FrameCase{"--loss none --expressions arkit47", "arkit47", RobustLoss::none},
          FrameCase{"--focal 900", "ekman6", RobustLoss::student_t, 900.0}}) {
        const Eigen::VectorXd identity = track_clip(folder, how.arguments);
        JointOptions options;
        options.expression_set = how.expression_set;
        options.loss = how.loss;
        options.focal_length_px = how.focal_px;
        const JointFitter fitter(model, "mediapipe478", options);
        SCOPED_TRACE(how.arguments);
        expect_frames(folder / "out/clip", landmarks, how.expression_set,
                      [&](const LandmarkSet& seen, const FitResult* last) {
                          return fitter.fit_pose_and_expression(seen, {240, 180}, identity, last).fit;
                      });
    }
}

TEST(Track, FramesOfTheThesisMethodAreItsFitsEachFromTheLast)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4");
    const std::vector<LandmarkSet> landmarks = landmarks_of_clip(folder / "clip.mp4");
    const MorphableModel model = load_model(default_model_path());
    for (const FrameCase& how : {FrameCase{""}, FrameCase{"--expressions arkit47", "arkit47"},
                                 FrameCase{"--focal 900", "ekman6", RobustLoss::student_t, 900.0}}) {
        const Eigen::VectorXd identity = track_clip(folder, "--method thesis " + how.arguments);
        FitOptions options;
        options.expression_set = how.expression_set;
        options.focal_length_px = how.focal_px;
        const FaceFitter fitter(model, "mediapipe478", options);
        SCOPED_TRACE(how.arguments);
        expect_frames(folder / "out/clip", landmarks, how.expression_set,
                      [&](const LandmarkSet& seen, const FitResult* last) {
                          return fitter.fit_pose_and_expression(seen, {240, 180}, identity, last);
                      });
    }
}

bool hides_the_mouth(int frame)
{
    return frame >= 6 && frame < 9;
}

/// The person turns the head; a bar before the mouth hides it in some frames, if it is to.
void save_clip_with_bar(const std::string& path, bool has_bar)
{
    const test::RenderedPerson person(5);
    VideoWriter writer(path);
    for (int i = 0; i < 12; ++i) {
        ImageU8 picture = person.picture(planted_yaw_deg(i + 16), 480, 360);
        for (int y = 200; y < 260 && has_bar && hides_the_mouth(i); ++y) {
            std::fill_n(picture.pixel(150, y), 3 * 200, std::uint8_t{60});
        }
        writer.write(picture, i / frame_rate);
    }
    writer.finish();
}

TEST(Track, WildPointsPullJointFramesLess)
{
    const test::TemporaryFolder folder;
    const std::vector<std::string> names = names_of_expressions("arkit47");
    std::map<std::string, double> largest;   // of all values
    std::map<std::string, double> mean_pull; // of the bar, on the values of the frames with it
    for (const std::string method : {"joint", "thesis"}) {
        std::vector<std::vector<std::map<std::string, std::string>>> rows;
        for (const bool has_bar : {false, true}) {
            save_clip_with_bar(folder / "clip.mp4", has_bar);
            (void)track_clip(folder, "--expressions arkit47 --method " + method);
            rows.push_back(read_rows(folder / "out/clip/frames.csv"));
            ASSERT_EQ(rows.back().size(), 12U);
        }
        for (std::size_t i = 0; i < rows[0].size(); ++i) {
            const Eigen::VectorXd values = expressions_of(rows[1][i], names);
            EXPECT_GE(values.minCoeff(), 0.0);
            largest[method] = std::max(largest[method], values.maxCoeff());
            if (hides_the_mouth(static_cast<int>(i))) {
                mean_pull[method] += (values - expressions_of(rows[0][i], names)).cwiseAbs().mean() / 3;
            }
        }
    }
    EXPECT_LE(largest["joint"], 1.0);
    EXPECT_GT(largest["thesis"], 1.0);
    EXPECT_LT(mean_pull["joint"], 0.7 * mean_pull["thesis"]);
}

TEST(Track, AnUnknownFocalLengthIsOneForAllFrames)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4", 8);
    const auto focal_px = [&](const std::string& options) {
        const Outcome outcome = run(folder, "track clip.mp4 -o out --texture-size 128 " + options);
        EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
        check_files(folder / "out/clip");
        return json::parse(read_all(folder / "out/clip/track.json"))["camera"]["focal_px"];
    };
    EXPECT_TRUE(focal_px("").is_null());
    // The clip has no perspective, so the answer is a long one: the head farther away than 0.4 m.
    const json found = focal_px("--focal unknown");
    EXPECT_TRUE(found.is_null() || found.get<double>() > 400.0) << found;
    EXPECT_EQ(run(folder, "track clip.mp4 -o out --focal unknown --method thesis").exit_code, 2);
}

TEST(Track, QuietSaysNothingButTheData)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4", 3);
    const Outcome outcome = test::run_at_terminal(folder, "track clip.mp4 -o out --texture-size 64 --quiet");
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_EQ(outcome.out, "out/clip\n");
    EXPECT_EQ(outcome.error, "");
}

TEST(Track, AClipOfNothingIsNoAnswer)
{
    const test::TemporaryFolder folder;
    VideoWriter writer(folder / "clip.mp4");
    for (int i = 0; i < num_frames; ++i) {
        writer.write(ImageU8(480, 360, 3, 246), i / frame_rate);
    }
    writer.finish();
    const Outcome outcome = run(folder, "track clip.mp4 -o out");
    EXPECT_EQ(outcome.exit_code, 6) << outcome.error;
    EXPECT_NE(outcome.error.find("clip.mp4: no face found in any of 30 frames"), std::string::npos) << outcome.error;
    EXPECT_EQ(outcome.out, "");
    EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST(Track, StoppedWhileItWatchesItLeavesNoHalfFile)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4");
    const Outcome outcome =
        test::run_at_terminal(folder, "track clip.mp4 -o out --texture-size 128", {"watch [", "\x03"});
    EXPECT_EQ(outcome.exit_code, 130) << outcome.error;
    EXPECT_NE(outcome.error.find("interrupted"), std::string::npos) << outcome.error;
    EXPECT_FALSE(fs::exists(folder / "out/clip/frames.csv")) << "before the identity is known there is nothing to say";
    test::expect_no_temporary_files(folder.path());
}

TEST(Track, StoppedWhileItFitsItKeepsTheFramesUntilThen)
{
    const test::TemporaryFolder folder;
    save_turning_clip(folder / "clip.mp4");
    const Outcome outcome = test::run_at_terminal(folder, "track clip.mp4 -o out", {"fit [", "\x03"});
    EXPECT_EQ(outcome.exit_code, 130) << outcome.error;
    EXPECT_NE(outcome.error.find("interrupted"), std::string::npos) << outcome.error;
    const std::size_t num_rows = check_files(folder / "out/clip").size();
    EXPECT_GE(num_rows, 1U);
    EXPECT_LT(num_rows, static_cast<std::size_t>(num_frames));
}

} // namespace
} // namespace lineament
