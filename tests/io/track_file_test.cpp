// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/io/track_file.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/core/error.hpp"
#include "lineament/io/file.hpp"

#include "support/matchers.hpp"

#include <nlohmann/json.hpp>

#include <cmath>

namespace lineament {
namespace {

using nlohmann::json;

TEST(TrackFile, FramesHaveTheDocumentedColumns)
{
    TrackRow row;
    row.frame = 3;
    row.time_s = 0.1;
    row.face = 1;
    row.status = "success";
    row.camera = Camera{rotation_from_angles({radians(0.0), 0.0, 0.0}), {1.5, -2.0}, 4.0, 0.002, {320, 240}};
    row.rms_px = 1.25;
    row.chi_square = 100.5;
    row.quality = 0.75;
    row.gaze_yaw = radians(-11.25);
    row.gaze_pitch = 0.0;
    row.expression_coefficients = Eigen::Vector2d(0.5, 0.0);
    TrackRow lost;
    lost.frame = 4;
    lost.time_s = 0.14;
    lost.status = "lost";
    EXPECT_EQ(format_frames_csv({row, lost}, {"jawOpen", "=x"}),
              "frame,time_s,face,status,yaw_deg,pitch_deg,roll_deg,x_mm,y_mm,z_mm,scale_px_per_mm,rms_px,chi_square,"
              "quality,jawOpen,'=x,gaze_yaw_deg,gaze_pitch_deg\n"
              "3,0.1,1,success,0,0,0,1.5,-2,500,4,1.25,100.5,0.75,0.5,0,-11.25,0\n"
              "4,0.14,,lost,,,,,,,,,,,,,,\n");
}

TEST(TrackFile, UnknownAndNotFiniteNumbersAreEmptyCells)
{
    TrackRow row;
    row.status = "success";
    row.camera = Camera{}; // scaled orthographic: no depth
    row.rms_px = std::nan("");
    row.chi_square = INFINITY;
    const std::string line = format_frames_row(row, 0);
    EXPECT_THAT(line, testing::EndsWith(",0,0,,1,,,,,\n")) << line;
    row.expression_coefficients = Eigen::Vector2d(0.5, 0.0);
    EXPECT_TRUE(test::throws<InvalidArgument>([&] { (void)format_frames_row(row, 3); }, "expression_coefficients"));
}

TEST(TrackFile, CsvTextIsQuotedAndNoFormula)
{
    EXPECT_EQ(format_csv_text("plain text"), "plain text");
    EXPECT_EQ(format_csv_text(""), "");
    EXPECT_EQ(format_csv_text("a,b"), "\"a,b\"");
    EXPECT_EQ(format_csv_text("say \"a\"\n"), "\"say \"\"a\"\"\n\"");
    for (const char* text : {"=1+1", "+1", "-1", "@a", "\ta"}) {
        EXPECT_EQ(format_csv_text(text), std::string("'") + text);
    }
    EXPECT_EQ(format_csv_text("\ra"), "\"'\ra\"");
    EXPECT_EQ(format_csv_text("a=1"), "a=1");
}

TEST(TrackFile, TrackJsonHoldsTheClipAndEachFace)
{
    TrackFile file;
    file.width = 1280;
    file.height = 720;
    file.num_frames = 100;
    file.duration_s = 3.96;
    file.frame_rate = 25.0;
    file.model = "default";
    file.method = "beyond";
    file.focal_px = 1500.0;
    file.principal_point_px = {640, 360};
    file.expression_set = "arkit47";
    file.expression_names = {"jawOpen"};
    file.faces = {{1,
                   Eigen::Vector2d(0.5, -1.0),
                   Eigen::Vector2d(0.1, std::nan("")),
                   {{"success", 97}, {"lost", 3}},
                   {"cheekPuff", "noseSneerLeft"}}};
    test::TemporaryFolder folder;
    save_track_json(folder / "track.json", file);
    const json root = json::parse(read_text_file(folder / "track.json"));
    EXPECT_EQ(root["format"], "lineament-track");
    EXPECT_EQ(root["version"], 1);
    EXPECT_EQ(root["video"], (json{{"width", 1280},
                                   {"height", 720},
                                   {"frames", 100},
                                   {"duration_s", 3.96},
                                   {"frame_rate", 25.0},
                                   {"complete", true}}));
    EXPECT_EQ(root["camera"]["focal_px"], 1500.0);
    EXPECT_EQ(root["expression"]["names"], json::array({"jawOpen"}));
    EXPECT_EQ(root["faces"][0]["shape_coefficients"], json::array({0.5, -1.0}));
    EXPECT_EQ(root["faces"][0]["shape_standard_deviations"], json::array({0.1, nullptr}));
    EXPECT_EQ(root["faces"][0]["unobservable_expressions"], json::array({"cheekPuff", "noseSneerLeft"}));
    EXPECT_EQ(root["faces"][0]["status_counts"]["success"], 97);
    file.faces[0].unobservable_expressions.clear();
    EXPECT_EQ(json::parse(format_track_json(file))["faces"][0]["unobservable_expressions"], json::array());
    file.is_complete = false;
    EXPECT_EQ(json::parse(format_track_json(file))["video"]["complete"], false);
    file.focal_px.reset();
    EXPECT_TRUE(json::parse(format_track_json(file))["camera"]["focal_px"].is_null());

    save_frames_csv(folder / "frames.csv", {TrackRow{}}, {"a"});
    EXPECT_EQ(read_text_file(folder / "frames.csv"), format_frames_csv({TrackRow{}}, {"a"}));
}

} // namespace
} // namespace lineament
