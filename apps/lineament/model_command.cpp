// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"
#include "inputs.hpp"
#include "model_options.hpp"
#include "model_sheets.hpp"

#include "lineament/io/image_file.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace lineament::cli {

namespace {

using Json = nlohmann::ordered_json;

Json describe(const ModelFile& file, const std::string& path)
{
    const MorphableModel& model = file.model;
    Json json;
    json["file"] = path;
    json["bytes"] = file.num_bytes;
    json["crc32c"] = file.crc32c;
    json["name"] = model.name;
    json["license"] = model.license;
    json["provenance"] = model.provenance;
    json["unit"] = "mm";
    json["vertices"] = model.num_vertices();
    json["shape"] = {{"components", model.shape.num_coefficients()},
                     {"total_sd_mm", std::sqrt(model.shape.standard_deviations.squaredNorm() /
                                               static_cast<float>(model.num_vertices()))}};
    json["color"] = {{"components", model.color ? model.color->num_coefficients() : 0}};
    json["levels"] = Json::array();
    for (const Level& level : model.levels) {
        json["levels"].push_back({{"vertices", level.num_vertices}, {"triangles", level.triangles.cols()}});
    }
    json["expression_sets"] = Json::array();
    for (const Blendshapes& set : model.expression_sets) {
        json["expression_sets"].push_back({{"name", set.name}, {"blendshapes", set.names}});
    }
    json["landmark_schemes"] = Json::array();
    for (const LandmarkMap& map : model.landmark_maps) {
        Json noise = Json::array();
        for (const auto& [detector, sigma] : map.noise_mm) {
            noise.push_back(detector);
        }
        json["landmark_schemes"].push_back(
            {{"name", map.scheme}, {"points", map.num_landmarks()}, {"noise_of_detectors", noise}});
    }
    json["contour_candidates"] = {{"left", model.contour_left.size()}, {"right", model.contour_right.size()}};
    json["triangle_groups"] = model.triangle_group_names;
    json["masks"] = Json::array();
    for (const auto& [region, weights] : model.masks) {
        json["masks"].push_back(region);
    }
    json["warnings"] = file.warnings;
    return json;
}

void print_description(const Json& json)
{
    const auto list = [](const Json& names) {
        std::string text;
        for (const Json& name : names) {
            text += (text.empty() ? "" : ", ") + name.get<std::string>();
        }
        return text;
    };
    const auto line = [](const std::string& name, const std::string& value) {
        print_data(printable(name + std::string(name.size() < 18 ? 18 - name.size() : 1, ' ') + value));
    };
    line("name", json["name"]);
    line("file", json["file"].get<std::string>() + " (" + json["bytes"].dump() + " bytes, CRC-32C " +
                     json["crc32c"].get<std::string>() + ")");
    line("licence", json["license"]);
    line("provenance", json["provenance"]);
    std::string levels;
    for (const Json& level : json["levels"]) {
        levels +=
            (levels.empty() ? "" : ", ") + level["vertices"].dump() + " (" + level["triangles"].dump() + " triangles)";
    }
    line("levels, vertices", levels);
    line("shape", json["shape"]["components"].dump() + " components, spread " +
                      to_text(json["shape"]["total_sd_mm"].get<double>()) + " mm per vertex (root mean square)");
    line("colour", json["color"]["components"].dump() + " components");
    for (const Json& set : json["expression_sets"]) {
        line("expressions", set["name"].get<std::string>() + ": " + list(set["blendshapes"]));
    }
    for (const Json& scheme : json["landmark_schemes"]) {
        line("landmarks", scheme["name"].get<std::string>() + ", " + scheme["points"].dump() + " points");
    }
    line("contour", json["contour_candidates"]["left"].dump() + " candidates left, " +
                        json["contour_candidates"]["right"].dump() + " right");
    line("triangle groups", list(json["triangle_groups"]));
    line("masks", list(json["masks"]));
}

int run_info(const std::string& file, bool as_json)
{
    const std::string path = model_path_or_default(file);
    const Json json = describe(load_model_with_warnings(path), path);
    if (as_json) {
        print_data(json.dump(2, ' ', false, Json::error_handler_t::replace));
    } else {
        print_description(json);
    }
    return all_done;
}

int run_sample(const std::string& file, const std::string& output, const SheetOptions& options)
{
    const std::string path = model_path_or_default(file);
    refuse_to_overwrite({path}, {output});
    save_png(output, make_sheet(load_model_with_warnings(path).model, options));
    print_data(printable(output));
    return all_done;
}

} // namespace

void add_model_command(CLI::App& program, Action& action)
{
    CLI::App* model = add_command(program, "model", "Work on morphable models.");
    model->require_subcommand(1);
    model->footer("Examples:\n  lineament model info\n  lineament model sample -o faces.png");

    CLI::App* info = add_command(*model, "info", "What a model file holds, its licence and provenance.");
    auto info_file = std::make_shared<std::string>();
    auto as_json = std::make_shared<bool>(false);
    info->add_option("file", *info_file, "Model file; default: the free model that comes along.");
    info->add_flag("--json", *as_json, "As JSON.");
    info->footer("Examples:\n  lineament model info\n  lineament model info my.safetensors --json");
    info->callback(
        [&action, info_file, as_json] { action = [info_file, as_json] { return run_info(*info_file, *as_json); }; });

    CLI::App* sample =
        add_command(*model, "sample", "A picture of faces of the model: random ones, modes, expressions.");
    auto sample_file = std::make_shared<std::string>();
    auto output = std::make_shared<std::string>("faces.png");
    auto options = std::make_shared<SheetOptions>();
    sample->add_option("file", *sample_file, "Model file; default: the free model that comes along.");
    sample->add_option("-o,--output", *output, "The PNG file to write.")->capture_default_str();
    sample->add_option("--what", options->what, "What the sheet shows.")
        ->check(CLI::IsMember({"random", "shape-modes", "color-modes", "expressions", "levels", "isomap", "landmarks"}))
        ->capture_default_str();
    sample->add_option("--count", options->count, "Number of random faces, or of modes.")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    sample->add_option("--sd", options->standard_deviations, "How far along a mode, in standard deviations.")
        ->check(CLI::Range(0.0, 5.0))
        ->capture_default_str();
    sample->add_option("--expressions", options->expression_set, "Expression set shown.")->capture_default_str();
    sample->add_option("--seed", options->seed, "Of the random faces: the same seed gives the same faces.")
        ->capture_default_str();
    sample->add_option("--tile", options->tile_px, "Size of one face [px].")
        ->check(CLI::Range(32, 2048))
        ->capture_default_str();
    sample->footer("Examples:\n  lineament model sample -o faces.png --count 24\n"
                   "  lineament model sample -o modes.png --what shape-modes --count 10 --sd 2\n"
                   "  lineament model sample -o six.png --what expressions --expressions ekman6");
    sample->callback([&action, sample_file, output, options] {
        action = [sample_file, output, options] { return run_sample(*sample_file, *output, *options); };
    });
}

} // namespace lineament::cli
