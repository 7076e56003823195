// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "apps/run_program.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <set>

namespace lineament {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::read_all;
using test::run;
using test::save_synthetic_picture;
using test::save_text;
using testing::HasSubstr;
using testing::Not;

/// Runs a shell script, in which "$lineament" is the program, inside a folder.
Outcome run_script(const test::TemporaryFolder& folder, const std::string& script)
{
    save_text(folder / "script.sh", "lineament='" LINEAMENT_PROGRAM "'\n" + script);
    const std::string command = "cd '" + folder.path().string() + "' && sh script.sh > stdout.txt 2> stderr.txt";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_all(folder / "stdout.txt"),
            read_all(folder / "stderr.txt")};
}

std::set<std::string> file_names_in(const std::string& folder)
{
    std::set<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
        names.insert(entry.path().filename().string());
    }
    return names;
}

std::size_t num_temporary_files(const test::TemporaryFolder& folder)
{
    std::size_t count = 0;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder.path())) {
        count += entry.path().filename().string().starts_with(".lineament-") ? 1 : 0;
    }
    return count;
}

/// Expects that a command refuses to write over the file at `path`, naming it, and leaves all as it was.
void expect_refuses_to_replace(const test::TemporaryFolder& folder, const std::string& path,
                               const std::string& arguments)
{
    const std::string bytes = read_all(folder / path);
    const std::set<std::string> names = file_names_in(fs::path(folder / path).parent_path());
    const Outcome outcome = run(folder, arguments);
    EXPECT_EQ(outcome.exit_code, 4) << arguments << "\n" << outcome.error;
    EXPECT_THAT(outcome.error, HasSubstr(path + ": would be written over the input")) << arguments;
    EXPECT_EQ(outcome.out, "") << arguments;
    EXPECT_EQ(read_all(folder / path), bytes) << arguments;
    EXPECT_EQ(file_names_in(fs::path(folder / path).parent_path()), names) << arguments;
}

TEST(BadInput, NoFileThatFitWritesMayBeOneItReads)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    fs::copy_file(default_model_path(), folder / "model.safetensors");
    const std::string fit = "fit face.png --landmarks face.json --model model.safetensors ";
    ASSERT_EQ(run(folder, fit + "--method joint --uncertainty --ply --neutral -o all").exit_code, 0);
    const std::set<std::string> written = file_names_in(folder / "all/face");
    ASSERT_GE(written.size(), 13U);
    fs::create_directories(folder / "out/face/face_2");
    for (const std::string& name : written) {
        for (const std::string input : {"face.png", "face.json", "model.safetensors"}) {
            const std::string path = (input == "face.png" ? "out/face/" : "out/face/face_2/") + name;
            fs::create_hard_link(folder / input, folder / path);
            expect_refuses_to_replace(folder, path, fit + "-o out");
            fs::remove(folder / path);
        }
    }
    fs::create_symlink("../../face.png", folder / "out/face/overlay.png"); // a writer would follow it
    expect_refuses_to_replace(folder, "out/face/overlay.png", fit + "-o out");
}

TEST(BadInput, APictureNamedAsAResultIsNotReplaced)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    fs::create_directories(folder / "overlay");
    fs::copy_file(folder / "face.png", folder / "overlay/overlay.png");
    expect_refuses_to_replace(folder, "overlay/overlay.png", "fit overlay/overlay.png --landmarks face.json");
    fs::create_directories(folder / "y/face");
    fs::copy_file(folder / "face.png", folder / "y/face/overlay.png");
    expect_refuses_to_replace(folder, "y/face/overlay.png",
                              "fit y/face/overlay.png face.png --landmarks face.json -o y");
    fs::create_directories(folder / "fit");
    fs::copy_file(folder / "face.png", folder / "fit.png");
    fs::copy_file(folder / "face.json", folder / "fit/fit.json");
    expect_refuses_to_replace(folder, "fit/fit.json", "fit fit.png --landmarks fit");
    // The twin: the same pictures with results elsewhere.
    const Outcome outcome = run(folder, "fit overlay/overlay.png --landmarks face.json --no-report -o elsewhere");
    EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
}

TEST(BadInput, AModelIsNotReplacedByItsSample)
{
    const test::TemporaryFolder folder;
    fs::create_directories(folder / "m");
    save_model(folder / "m/m.safetensors", test::make_synthetic_face());
    expect_refuses_to_replace(folder, "m/m.safetensors", "model sample m/m.safetensors -o m/m.safetensors --count 1");
    EXPECT_EQ(run(folder, "model sample m/m.safetensors -o m.png --count 1").exit_code, 0);
}

TEST(BadInput, AVideoNamedAsAResultIsNotReplaced)
{
    const test::TemporaryFolder folder;
    for (const std::string name : {"overlay", "clip"}) {
        fs::create_directories(folder / name);
        save_text(folder / (name + "/" + name + ".mp4"), "no video");
    }
    expect_refuses_to_replace(folder, "overlay/overlay.mp4", "track overlay/overlay.mp4");
    EXPECT_EQ(run(folder, "track clip/clip.mp4").exit_code, 3) << "the twin is read, and is no video";
}

TEST(BadInput, LandmarksOutsideThePictureAreNoAnswer)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    LandmarkSet set = load_landmarks(folder / "face.json").frames.front().set;
    const auto fit_with_points_moved = [&](std::size_t count, double by_px) {
        LandmarkSet moved = set;
        for (std::size_t i = 0; i < count; ++i) {
            moved.landmarks[i].point_px.x() += by_px;
        }
        save_landmarks(folder / "moved.json", moved, 640, 480);
        return run(folder, "fit face.png --landmarks moved.json --no-report -o out");
    };
    for (const auto& [count, by_px] : {std::pair(61, 700.0), std::pair(68, 100000.0), std::pair(68, -100000.0)}) {
        const Outcome outcome = fit_with_points_moved(static_cast<std::size_t>(count), by_px);
        EXPECT_EQ(outcome.exit_code, 6) << outcome.error;
        EXPECT_THAT(outcome.error, HasSubstr("moved.json: " + std::to_string(count) +
                                             " of 68 landmarks lie outside "
                                             "face.png (640 x 480)"));
        EXPECT_FALSE(fs::exists(folder / "out"));
    }
    EXPECT_THAT(fit_with_points_moved(10, 700.0).error, Not(HasSubstr("outside"))) << "a face may be cut by the edge";
    EXPECT_EQ(fit_with_points_moved(68, 0.0).exit_code, 0);
}

TEST(BadInput, LandmarksOfAnotherImageSizeAreRefused)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const LandmarkSet set = load_landmarks(folder / "face.json").frames.front().set;
    for (const auto& [width, height] : {std::pair(640, 481), std::pair(1280, 480)}) {
        save_landmarks(folder / "other.json", set, width, height);
        const Outcome outcome = run(folder, "fit face.png --landmarks other.json -o out");
        EXPECT_EQ(outcome.exit_code, 3) << outcome.error;
        EXPECT_THAT(outcome.error, HasSubstr("other.json:/image: expected the size of face.png, 640 x 480, found " +
                                             std::to_string(width) + " x " + std::to_string(height)));
        EXPECT_FALSE(fs::exists(folder / "out"));
    }
    save_landmarks(folder / "other.json", set, 640, 480);
    EXPECT_EQ(run(folder, "fit face.png --landmarks other.json --no-report -o out").exit_code, 0);
}

TEST(BadInput, APictureNamedAsAnotherFormatGivesAWarning)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    fs::copy_file(folder / "face.png", folder / "face.jpg");
    write_file(folder / "photo.png", format_jpeg(load_image(folder / "face.png")));
    fs::copy_file(folder / "photo.png", folder / "photo.JPEG");
    const std::string options = " --landmarks face.json --no-report -o out";
    for (const std::string wrong : {"face.jpg", "photo.png"}) {
        const Outcome outcome = run(folder, "fit " + wrong + options);
        EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
        EXPECT_THAT(outcome.error, HasSubstr("lineament: warning: " + wrong + ": the name ends in "));
        const Outcome strict = run(folder, "fit --strict " + wrong + options + "-strict");
        EXPECT_EQ(strict.exit_code, 3) << strict.error;
        EXPECT_THAT(strict.error, HasSubstr("lineament: error: " + wrong + ": the name ends in "));
        EXPECT_FALSE(fs::exists(folder / "out-strict"));
    }
    for (const std::string right : {"face.png", "photo.JPEG"}) {
        const Outcome outcome = run(folder, "fit --strict " + right + options);
        EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
        EXPECT_EQ(outcome.error, "");
    }
}

TEST(BadInput, WarningsOfAModelAreSeenByEveryCommandThatReadsIt)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    MorphableModel model = test::make_synthetic_face();
    save_model(folder / "good.safetensors", model);
    model.shape.basis.col(0) *= 2.0F; // no longer orthonormal
    save_model(folder / "odd.safetensors", model);
    const auto commands = [](const std::string& name) {
        return std::vector<std::string>{"model info " + name, "model info --json " + name,
                                        "model sample --count 1 " + name,
                                        "fit face.png --landmarks face.json --no-report --model " + name};
    };
    for (const std::string& command : commands("odd.safetensors")) {
        const Outcome outcome = run(folder, command);
        EXPECT_THAT(outcome.error, HasSubstr("lineament: warning: odd.safetensors: ")) << command;
        EXPECT_THAT(outcome.error, HasSubstr("orthonormal")) << command;
        EXPECT_NE(outcome.exit_code, 3) << command;
        const Outcome strict = run(folder, "--strict " + command);
        EXPECT_EQ(strict.exit_code, 3) << command << strict.error;
        EXPECT_EQ(strict.out, "") << command;
    }
    EXPECT_THAT(run(folder, "track missing.mp4 --model odd.safetensors").error, HasSubstr("orthonormal"));
    for (const std::string& command : commands("good.safetensors")) {
        const Outcome outcome = run(folder, "--strict " + command);
        EXPECT_THAT(outcome.error, Not(HasSubstr("orthonormal"))) << command;
        EXPECT_NE(outcome.exit_code, 3) << command << outcome.error;
    }
}

TEST(BadInput, WhatAModelLacksIsNamedWithTheFile)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    MorphableModel model = test::make_synthetic_face();
    save_model(folder / "whole.safetensors", model);
    model.expression_sets.clear();
    save_model(folder / "no_expressions.safetensors", model);
    model.uv_coordinates.resize(2, 0);
    for (Level& level : model.levels) {
        level.uv_triangles.resize(3, 0);
    }
    save_model(folder / "no_uv.safetensors", model);
    const std::string fit = "fit face.png --landmarks face.json -o out --model ";
    const Outcome no_expressions = run(folder, fit + "no_expressions.safetensors");
    EXPECT_EQ(no_expressions.exit_code, 2);
    EXPECT_THAT(no_expressions.error,
                HasSubstr("--expressions: for no_expressions.safetensors expected none, got ekman6"));
    const Outcome unknown = run(folder, fit + "whole.safetensors --expressions klingon");
    EXPECT_EQ(unknown.exit_code, 2);
    EXPECT_THAT(unknown.error, HasSubstr("--expressions: for whole.safetensors expected ekman6 or none, got klingon"));
    const Outcome no_uv = run(folder, fit + "no_uv.safetensors --expressions none");
    EXPECT_EQ(no_uv.exit_code, 3);
    EXPECT_THAT(no_uv.error, HasSubstr("no_uv.safetensors: expected a uv layout"));
    EXPECT_FALSE(fs::exists(folder / "out"));
    const Outcome no_isomap = run(folder, "model sample no_uv.safetensors --what isomap -o isomap.png");
    EXPECT_EQ(no_isomap.exit_code, 2);
    EXPECT_THAT(no_isomap.error, HasSubstr("no uv layout"));
    EXPECT_FALSE(fs::exists(folder / "isomap.png"));
    EXPECT_EQ(run(folder, "model sample whole.safetensors --what isomap -o isomap.png").exit_code, 0);
    EXPECT_TRUE(fs::exists(folder / "isomap.png"));
}

TEST(BadInput, AFileLargerThanAllowedIsAFailedWrite)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    const std::string fit = "\"$lineament\" fit face.png --landmarks face.json --no-report -o out";
    const Outcome outcome = run_script(folder, "ulimit -f 100\n" + fit); // 51,200 bytes
    EXPECT_EQ(outcome.exit_code, 4) << outcome.error;
    EXPECT_THAT(outcome.error, HasSubstr("File too large"));
    EXPECT_EQ(num_temporary_files(folder), 0U);
    EXPECT_EQ(run_script(folder, "ulimit -f unlimited\n" + fit).exit_code, 0);
}

TEST(BadInput, AHangupEndsTheRunAsATerminationUnlessItIsIgnored)
{
    const test::TemporaryFolder folder;
    save_synthetic_picture(folder, "face");
    constexpr std::size_t num_pictures = 12;
    fs::create_directories(folder / "in");
    for (std::size_t i = 0; i < num_pictures; ++i) {
        fs::copy_file(folder / "face.png", fs::path(folder / "in") / ("face" + std::to_string(i) + ".png"));
    }
    // The signal comes once the first result is there.
    const std::string fit_and_hang_up = "\"$lineament\" fit in --landmarks face.json --no-report -o out &\n"
                                        "while kill -0 $! && [ ! -e out/face0/fit.json ]; do sleep 0.01; done\n"
                                        "kill -HUP $!\n"
                                        "wait $!\n";
    const Outcome ended = run_script(folder, fit_and_hang_up);
    EXPECT_EQ(ended.exit_code, 143) << ended.error;
    EXPECT_THAT(ended.error, HasSubstr("interrupted after "));
    EXPECT_LT(file_names_in(folder / "out").size(), num_pictures);
    EXPECT_EQ(num_temporary_files(folder), 0U);
    fs::remove_all(folder / "out");
    const Outcome ignored = run_script(folder, "trap '' HUP\n" + fit_and_hang_up); // as nohup does
    EXPECT_EQ(ignored.exit_code, 0) << ignored.error;
    EXPECT_EQ(file_names_in(folder / "out").size(), num_pictures);
}

TEST(BadInput, EachCommandHasExamplesOfItsOwn)
{
    const test::TemporaryFolder folder;
    for (const std::string command : {"fit", "track", "model", "model info", "model sample", "doctor"}) {
        const std::string help = run(folder, command + " --help").out;
        const std::size_t examples = help.find("Examples:");
        ASSERT_NE(examples, std::string::npos) << command;
        std::size_t num_examples = 0;
        for (std::size_t at = help.find("\n  lineament ", examples); at != std::string::npos;
             at = help.find("\n  lineament ", at + 1)) {
            EXPECT_EQ(help.compare(at, 13 + command.size(), "\n  lineament " + command), 0) << command << "\n" << help;
            ++num_examples;
        }
        EXPECT_GE(num_examples, 1U) << command;
    }
}

TEST(BadInput, TrackNamesNoOptionThatItLacks)
{
    const test::TemporaryFolder folder;
    save_text(folder / "clip.mp4", "no video");
    const Outcome outcome = run(folder, "track clip.mp4 --detector none");
    EXPECT_EQ(outcome.exit_code, 2) << outcome.error;
    EXPECT_THAT(outcome.error, HasSubstr("--detector"));
    EXPECT_THAT(outcome.error, Not(HasSubstr("--landmarks")));
    EXPECT_THAT(run(folder, "track --help").out, Not(HasSubstr("landmark files")));
    EXPECT_THAT(run(folder, "fit clip.png --detector none --help").out, HasSubstr("landmark files"));
}

std::size_t count(const std::string& text, const std::string& part)
{
    std::size_t found = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
        ++found;
    }
    return found;
}

TEST(BadInput, AnInterruptedTrackSaysWhatIsWritten)
{
    LINEAMENT_REQUIRE_REAL_DATA("video/vox_driving.mp4");
    const test::TemporaryFolder folder;
    // A copy: a program that fails this test writes over it.
    fs::copy_file(test::real_data_folder() / "video/vox_driving.mp4", folder / "clip.mp4");
    const auto track_until = [](const std::string& condition) {
        return "\"$lineament\" track clip.mp4 -o out --json &\n"
               "while kill -0 $! && ! " +
               condition + "; do sleep 0.01; done\nkill -TERM $!\nwait $!\n";
    };
    const auto summary_of = [](const Outcome& outcome) { return nlohmann::json::parse(outcome.out)[0]; };

    const Outcome early = run_script(folder, track_until("sleep 0.3")); // while the video is watched
    EXPECT_EQ(early.exit_code, 143) << early.error;
    EXPECT_EQ(count(early.error, "interrupted"), 1U) << early.error;
    EXPECT_THAT(early.error, HasSubstr("nothing is written"));
    EXPECT_EQ(summary_of(early)["exit_code"], 143);
    EXPECT_FALSE(fs::exists(folder / "out"));

    // Once the overlay has some bytes, the second pass is under way.
    const Outcome late = run_script(folder, track_until("[ -s out/clip/.lineament-*.mp4 ]"));
    EXPECT_EQ(late.exit_code, 143) << late.error;
    EXPECT_EQ(count(late.error, "interrupted"), 1U) << late.error;
    EXPECT_THAT(late.error, HasSubstr("the files written are whole"));
    EXPECT_EQ(summary_of(late)["exit_code"], 143);
    const nlohmann::json video = nlohmann::json::parse(read_all(folder / "out/clip/track.json"))["video"];
    EXPECT_EQ(video["complete"], false);
    const std::size_t num_frames = video["frames"].get<std::size_t>();
    EXPECT_EQ(count(read_all(folder / "out/clip/frames.csv"), "\n"), num_frames + 1);
    EXPECT_EQ(count(read_all(folder / "out/clip/report.html"), "Incomplete"), 1U);
    EXPECT_EQ(num_temporary_files(folder), 0U);

    const Outcome whole = run(folder, "track clip.mp4 -o out --json");
    EXPECT_EQ(whole.exit_code, 0) << whole.error;
    EXPECT_EQ(summary_of(whole)["exit_code"], 0);
    const nlohmann::json whole_video = nlohmann::json::parse(read_all(folder / "out/clip/track.json"))["video"];
    EXPECT_EQ(whole_video["complete"], true);
    EXPECT_EQ(count(read_all(folder / "out/clip/report.html"), "Incomplete"), 0U);
    EXPECT_GT(whole_video["frames"].get<std::size_t>(), num_frames);
    for (const std::string& name : file_names_in(folder / "out/clip")) {
        const std::string path = "linked/clip/" + name;
        fs::create_directories(folder / "linked/clip");
        fs::create_symlink("../../clip.mp4", folder / path);
        expect_refuses_to_replace(folder, path, "track clip.mp4 -o linked");
        fs::remove(folder / path);
    }
}

} // namespace
} // namespace lineament
