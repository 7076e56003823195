// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Opens the program's GLB files in Chromium with a loader that is not ours: three.js, from the folder of the npm
// package `three` that $LINEAMENT_THREE names.
#include "apps/run_program.hpp"
#include "apps/turning_clip.hpp"

#include "support/chromium.hpp"

#include <nlohmann/json.hpp>

#include <set>

namespace lineament {
namespace {

using nlohmann::json;
using test::Outcome;
using test::read_all;
using test::run;
using test::save_text;

#define LINEAMENT_REQUIRE_THREE()                                                                                      \
    LINEAMENT_REQUIRE_CHROMIUM();                                                                                      \
    if (std::getenv("LINEAMENT_THREE") == nullptr) {                                                                   \
        GTEST_SKIP() << "npm package three not found (set LINEAMENT_THREE to its folder)";                             \
    }

/// What load_glb.js finds in a GLB file of the folder.
json load_in_browser(const test::TemporaryFolder& folder, const std::string& name)
{
    const std::string three = std::string("file://") + std::getenv("LINEAMENT_THREE");
    const json imports = {{"three", three + "/build/three.module.js"}, {"three/addons/", three + "/examples/jsm/"}};
    save_text(folder / "page.html", "<!DOCTYPE html><meta charset=\"utf-8\"><script type=\"importmap\">" +
                                        json{{"imports", imports}}.dump() + "</script><body data-glb=\"" + name +
                                        "\"><pre id=\"found\"></pre><script type=\"module\" src=\"file://" +
                                        LINEAMENT_SOURCE_DIR "/tests/apps/load_glb.js\"></script>");
    const std::string document = test::document_of_page(folder, "page.html", "--allow-file-access-from-files");
    const std::string begin = "<pre id=\"found\">";
    const std::size_t at = document.find(begin);
    if (at == std::string::npos) {
        return {{"error", "no document"}};
    }
    const std::size_t first = at + begin.size();
    return json::parse(document.substr(first, document.find("</pre>", first) - first), nullptr, false);
}

/// Vertices of the model with one copy for each uv point they have.
std::size_t num_split_vertices(const MorphableModel& model)
{
    const Level& level = model.levels.back();
    std::set<std::pair<int, int>> pairs;
    for (Eigen::Index i = 0; i < level.triangles.size(); ++i) {
        pairs.emplace(level.triangles.data()[i], level.uv_triangles.data()[i]);
    }
    return pairs.size();
}

void expect_face(const json& found, const MorphableModel& model)
{
    ASSERT_FALSE(found.contains("error")) << found;
    EXPECT_EQ(found["meshes"], 1);
    EXPECT_EQ(found["vertices"], num_split_vertices(model));
    EXPECT_EQ(found["targets"], json(model.find_expression_set("ekman6")->names));
    EXPECT_GT(found["covered"], 0.3) << "part of the picture that the head covers";
    EXPECT_LT(found["covered"], 0.9);
    EXPECT_GT(found["colors"], 200) << "a texture has many colours";
}

TEST(Browser, ThreeLoadsTheMeshOfAFit)
{
    LINEAMENT_REQUIRE_THREE();
    const test::TemporaryFolder folder;
    save_png(folder / "face.png", test::RenderedPerson(3).picture(15, 480, 480));
    const Outcome outcome = run(folder, "fit face.png --no-report");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    const json found = load_in_browser(folder, "face/mesh.glb");
    expect_face(found, load_model(default_model_path()));
    EXPECT_EQ(found["animations"], 0);
    const json values = json::parse(read_all(folder / "face/fit.json"))["faces"][0]["expression"]["values"];
    for (std::size_t i = 0; i < found["targets"].size(); ++i) {
        const double value = values[found["targets"][i].get<std::string>()];
        EXPECT_NEAR(found["weights"][i].get<double>(), value, 1e-6) << "the fitted expression is what is shown first";
    }
    // The twin: half a file.
    const std::string whole = read_all(folder / "face/mesh.glb");
    write_file(folder / "broken.glb", std::string_view(whole).substr(0, whole.size() / 2));
    EXPECT_TRUE(load_in_browser(folder, "broken.glb").contains("error"));
}

TEST(Browser, ThreePlaysTheFaceOfATrack)
{
    LINEAMENT_REQUIRE_THREE();
    const test::TemporaryFolder folder;
    constexpr int count = 8;
    test::save_turning_clip(folder / "clip.mp4", count);
    const Outcome outcome = run(folder, "track clip.mp4");
    ASSERT_EQ(outcome.exit_code, 0) << outcome.error;
    const json found = load_in_browser(folder, "clip/face.glb");
    expect_face(found, load_model(default_model_path()));
    EXPECT_EQ(found["animations"], 1);
    EXPECT_NEAR(found["duration"].get<double>(), (count - 1) / test::frame_rate, 1e-4);
    // The face looks to the viewer's right by the sine of its yaw.
    for (const auto& [moment, frame] : {std::pair<std::size_t, int>{0, 0}, {1, count - 1}}) {
        EXPECT_NEAR(found["directions"][moment][0].get<double>(), std::sin(radians(test::planted_yaw_deg(frame))),
                    std::sin(radians(7.0)))
            << "frame " << frame;
    }
}

} // namespace
} // namespace lineament
