// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "model_options.hpp"

#include "console.hpp"

#include <CLI/CLI.hpp>

#include <cmath>

namespace lineament::cli {

namespace {

void set_focal(const std::string& text, ModelOptions& options)
{
    options.fits_focal = text == "unknown";
    options.focal_px = 0.0;
    if (!options.fits_focal && (!CLI::detail::lexical_cast(text, options.focal_px) ||
                                !std::isfinite(options.focal_px) || options.focal_px < 0.0)) {
        throw CLI::ValidationError("--focal", "expected a number of px >= 0, or unknown, got " + text);
    }
}

} // namespace

void add_model_options(CLI::App& command, ModelOptions& options)
{
    command.add_option("--model", options.model,
                       "Model file (.safetensors); default: the free model that comes along.");
    command.add_option("--level", options.level, "Resolution: full, or 0 (coarsest), 1, ...")->capture_default_str();
    command
        .add_option("--method", options.method,
                    "How to fit: joint (one energy for pose, identity and expression, robust, with uncertainties) or "
                    "thesis (one after the other). Of a video the identity, then each frame with that identity; "
                    "which frames the identity is fitted from is found by thesis.")
        ->check(CLI::IsMember({"joint", "thesis"}))
        ->capture_default_str();
    command
        .add_option("--expressions", options.expression_set, "Expression set of the model: ekman6, arkit47, or none.")
        ->capture_default_str();
    command
        .add_option("--contour", options.contour,
                    "The 16 outline landmarks: matched on both sides, on the sides that face the camera, tied to fixed "
                    "points, or ignored. The 478 points of mediapipe have none by themselves.")
        ->check(CLI::IsMember({"ignored", "fixed", "front", "both"}))
        ->default_str("both");
    command
        .add_option("--iterations", options.iterations, "Rounds of outline matches; default: 3 (joint) or 5 (thesis).")
        ->check(CLI::Range(1, 1000));
    command
        .add_option("--regularization", options.regularization,
                    "Weight of the shape prior, for --method thesis; default: 1, or 30 with the published prior.")
        ->check(CLI::NonNegativeNumber);
    command
        .add_option("--prior", options.prior,
                    "Unit of the landmark noise, for --method thesis: model (mm, independent of the image size), or "
                    "published (weight 30 at a variance of 3 px^2, for comparisons).")
        ->check(CLI::IsMember({"model", "published"}))
        ->capture_default_str();
    const CLI::Validator is_sigma(
        [](const std::string& text) {
            double value = 0;
            return CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value > 0
                       ? std::string()
                       : "expected a number of mm > 0, got " + text;
        },
        "MM");
    command
        .add_option("--noise", options.noise_mm,
                    "Standard deviation of landmarks but the outline, per coordinate [mm on the face]; default: 2 "
                    "(joint) or 2.5 (thesis). The model states that of mediapipe's points itself.")
        ->check(is_sigma);
    command
        .add_option("--outline-noise", options.outline_noise_mm, "The same of the 16 outline landmarks; default: 4.")
        ->check(is_sigma);
    command
        .add_option("--loss", options.loss,
                    "How residuals count, for --method joint: student_t (wild landmarks pull little), geman_mcclure "
                    "(not at all) or none (least squares); default: student_t.")
        ->check(CLI::IsMember({"student_t", "geman_mcclure", "none"}));
    command
        .add_option_function<std::string>(
            "--focal", [&options](const std::string& text) { set_focal(text, options); },
            "Focal length [px] of a perspective camera; unknown: fit it too (--method joint; for near faces, such as "
            "selfies, best in several pictures or a video, which are taken to come from one camera that does not "
            "zoom); "
            "0: scaled orthographic.")
        ->type_name("PX|unknown")
        ->default_str("0");
}

std::string model_path_or_default(const std::string& path)
{
    return path.empty() ? default_model_path().string() : path;
}

ModelFile load_model_with_warnings(const std::string& path)
{
    ModelFile file = load_model_file(path);
    for (const std::string& warning : file.warnings) {
        warn_of_input(path + ": " + warning);
    }
    return file;
}

MorphableModel load_chosen_model(const ModelOptions& options)
{
    const std::string path = model_path_or_default(options.model);
    MorphableModel model = load_model_with_warnings(path).model;
    if (options.level != "full") {
        const int num_levels = static_cast<int>(model.levels.size());
        if (options.level.size() != 1 || options.level[0] < '0' || options.level[0] - '0' >= num_levels) {
            throw Failure(wrong_use, "--level: expected full or 0 to " + std::to_string(num_levels - 1) + ", got " +
                                         options.level);
        }
        model = model.at_level(options.level[0] - '0');
    }
    if (options.expression_set != "none" && model.find_expression_set(options.expression_set) == nullptr) {
        std::string sets;
        for (const Blendshapes& set : model.expression_sets) {
            sets += set.name + " or ";
        }
        throw Failure(wrong_use,
                      "--expressions: for " + path + " expected " + sets + "none, got " + options.expression_set);
    }
    if (model.levels.back().uv_triangles.cols() == 0) {
        throw Failure(bad_input, path + ": expected a uv layout, which the texture of the face needs, found none");
    }
    return model;
}

TextureLayout make_texture_layout(const MorphableModel& model, int size)
{
    return TextureLayout(model.mesh_of(model.shape.mean), size, {"mouth_interior"});
}

} // namespace lineament::cli
