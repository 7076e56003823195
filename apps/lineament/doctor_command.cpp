// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"

#include "lineament/core/version.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/vision/dlib_detector.hpp"
#include "lineament/vision/mesh_detector.hpp"
#include "lineament/vision/video_writer.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <memory>
#include <vector>

#include <unistd.h>

namespace lineament::cli {

namespace {

/// One thing the program needs, and whether it is there.
struct Finding
{
    std::string name;
    std::string state; ///< "ok", "missing", or "absent": not there, and only needed by those who ask for it.
    std::string detail;
};

Finding check(const std::string& name, const std::function<std::string()>& probe,
              const std::string& state_without = "missing")
{
    try {
        return {name, "ok", probe()};
    } catch (...) {
        return {name, state_without, current_failure().what()};
    }
}

std::string probe_model()
{
    const std::filesystem::path path = default_model_path();
    const MorphableModel model = load_model(path.string());
    return model.name + ", " + std::to_string(model.num_vertices()) + " vertices, " +
           std::to_string(model.shape.num_coefficients()) + " shape components; licence: " + model.license + "; " +
           path.string();
}

std::string probe_mesh_detector()
{
    const MeshDetector detector;
    return "--detector mediapipe: 478 landmarks; networks Apache-2.0, free for every use";
}

std::string probe_dlib()
{
    const DlibDetector detector;
    return "--detector dlib: 68 landmarks; its trained model excludes commercial use (iBUG 300-W terms)";
}

std::string probe_video_writer()
{
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("lineament-doctor-" + std::to_string(getpid()) + ".mp4");
    VideoWriter writer(path.string());
    writer.write(ImageU8(64, 64, 3), 0.0);
    return "MP4 by encoder " + writer.codec(); // not finished: the writer removes its file
}

int run(bool as_json)
{
    const std::vector<Finding> findings = {
        check("face model", probe_model),
        check("face detector", probe_mesh_detector),
        check("dlib detector", probe_dlib, "absent"),
        check("video output", probe_video_writer),
    };
    bool all_there = true;
    nlohmann::ordered_json json;
    json["version"] = version;
    json["findings"] = nlohmann::ordered_json::array();
    if (!as_json) {
        print_data(std::string("lineament ") + version + "; opens no network connection");
    }
    for (const Finding& finding : findings) {
        all_there = all_there && finding.state != "missing";
        json["findings"].push_back({{"name", finding.name}, {"state", finding.state}, {"detail", finding.detail}});
        if (!as_json) {
            print_data(printable(finding.state + std::string(9 - finding.state.size(), ' ') + finding.name +
                                 std::string(15 - finding.name.size(), ' ') + finding.detail));
        }
    }
    if (as_json) {
        print_data(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    }
    return all_there ? all_done : system_failed;
}

} // namespace

void add_doctor_command(CLI::App& program, Action& action)
{
    CLI::App* command = add_command(program, "doctor", "What is installed, what is missing, how to get it.");
    auto as_json = std::make_shared<bool>(false);
    command->add_flag("--json", *as_json, "Findings as JSON on stdout.");
    command->footer("Examples:\n  lineament doctor\n  lineament doctor --json");
    command->callback([&action, as_json] { action = [as_json] { return run(*as_json); }; });
}

} // namespace lineament::cli
