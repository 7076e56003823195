// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The pictures of docs/model.md: mean, landmarks, levels, modes, samples and expressions of a model; and, printed, its
// figures: modes for a share of the variance, distances between landmarks.
#include "lineament/render/draw.hpp"
#include "lineament/core/random.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/render/contact_sheet.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/render/texture_layout.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>

namespace {

using namespace lineament;

constexpr int tile_px = 160;
constexpr double px_per_mm = 0.5;

/// The coloured mesh with a dark mouth interior of its own vertices, so that an open mouth reads as one.
Mesh mesh_to_draw(const MorphableModel& model, const Eigen::VectorXf& shape, const Eigen::VectorXf& color)
{
    Mesh mesh = model.mesh_of(shape);
    mesh.colors = Eigen::Map<const Eigen::Matrix3Xf>(color.data(), 3, color.size() / 3).cwiseMax(0.0f).cwiseMin(1.0f);
    for (Eigen::Index t = 0; t < mesh.num_triangles(); ++t) {
        if (mesh.group_names[static_cast<std::size_t>(mesh.triangle_groups[t])] != "mouth_interior") {
            continue;
        }
        const Eigen::Index count = mesh.num_vertices();
        mesh.vertices.conservativeResize(3, count + 3);
        mesh.colors.conservativeResize(3, count + 3);
        for (int corner = 0; corner < 3; ++corner) {
            mesh.vertices.col(count + corner) = mesh.vertices.col(mesh.triangles(corner, t));
            mesh.colors.col(count + corner) = Eigen::Vector3f(0.22f, 0.08f, 0.08f);
            mesh.triangles(corner, t) = static_cast<int>(count) + corner;
        }
    }
    return mesh;
}

Camera camera_at(double yaw_deg, int size_px)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(yaw_deg), 0, 0});
    camera.scale_px_per_mm = px_per_mm * size_px / tile_px;
    camera.principal_point_px = Eigen::Vector2d(size_px / 2.0, size_px / 2.0);
    camera.translation_mm.x() = 17.0 * std::sin(radians(yaw_deg)); // vertices crowd at the front of the head
    return camera;
}

ImageU8 draw_shape(const MorphableModel& model, const Eigen::VectorXf& shape, const Eigen::VectorXf& color,
                   double yaw_deg, const ShadingOptions& options = {}, int size_px = tile_px)
{
    return render_mesh(mesh_to_draw(model, shape, color), camera_at(yaw_deg, size_px), size_px, size_px, options);
}

void save_sheet(const std::filesystem::path& path, const std::vector<Tile>& tiles, int columns, int size_px = tile_px)
{
    ContactSheetOptions options;
    options.tile_width_px = size_px;
    options.tile_height_px = size_px;
    options.gap_px = 6;
    options.text_scale = 1;
    save_png(path, contact_sheet(tiles, columns, options));
}

void draw_mean(const MorphableModel& model, const std::filesystem::path& folder)
{
    constexpr int size_px = 260;
    ShadingOptions clay;
    clay.surface = SurfaceColor::clay;
    std::vector<Tile> tiles;
    for (const bool with_color : {true, false}) {
        for (const int yaw : {0, 45, 90, -30}) {
            tiles.push_back({draw_shape(model, model.shape.mean, model.color->mean, yaw,
                                        with_color ? ShadingOptions{} : clay, size_px),
                             std::to_string(yaw) + " deg"});
        }
    }
    save_sheet(folder / "model-mean.png", tiles, 4, size_px);
}

void draw_landmarks(const MorphableModel& model, const std::filesystem::path& folder)
{
    constexpr int size_px = 360;
    ShadingOptions clay;
    clay.surface = SurfaceColor::clay;
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(model.shape.mean.data(), 3, model.num_vertices());
    std::vector<Tile> tiles;
    for (const int yaw : {0, 45}) {
        const Camera camera = camera_at(yaw, size_px);
        ImageU8 picture = draw_shape(model, model.shape.mean, model.color->mean, yaw, clay, size_px);
        for (const auto* contour : {&model.contour_left, &model.contour_right}) {
            for (const int v : *contour) {
                draw_disc(picture, camera.project(Eigen::Vector3d(vertices.col(v).cast<double>())), 2.0, {40, 90, 200});
            }
        }
        const Eigen::Matrix3Xf points = model.landmark_maps.front().points_on(vertices);
        for (Eigen::Index l = 0; l < points.cols(); ++l) {
            draw_disc(picture, camera.project(Eigen::Vector3d(points.col(l).cast<double>())), 2.5, {210, 30, 40});
        }
        tiles.push_back({picture, "landmarks (red), contour candidates (blue)"});
    }
    save_sheet(folder / "model-landmarks.png", tiles, 2, size_px);
}

/// The lines of MediaPipe's face mesh along lids, brows, lips, the ridge of the nose and the face's oval.
const std::vector<std::vector<int>> mesh_lines = {
    {33, 246, 161, 160, 159, 158, 157, 173, 133, 155, 154, 153, 145, 144, 163, 7, 33},
    {263, 466, 388, 387, 386, 385, 384, 398, 362, 382, 381, 380, 374, 373, 390, 249, 263},
    {70, 63, 105, 66, 107, 55, 65, 52, 53, 46, 70},
    {300, 293, 334, 296, 336, 285, 295, 282, 283, 276, 300},
    {61, 185, 40, 39, 37, 0, 267, 269, 270, 409, 291, 375, 321, 405, 314, 17, 84, 181, 91, 146, 61},
    {78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308, 324, 318, 402, 317, 14, 87, 178, 88, 95, 78},
    {168, 6, 197, 195, 5, 4, 1, 19, 94, 2},
    {469, 470, 471, 472, 469},
    {474, 475, 476, 477, 474},
    {10,  338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377, 152,
     148, 176, 149, 150, 136, 172, 58,  132, 93,  234, 127, 162, 21,  54,  103, 67,  109, 10}};

void draw_mesh_points(const MorphableModel& model, const std::filesystem::path& folder)
{
    constexpr int size_px = 480;
    const LandmarkMap& map = *model.find_landmark_map("mediapipe478");
    const Blendshapes& set = *model.find_expression_set("arkit47");
    Eigen::VectorXf surprised = model.shape.mean;
    for (std::size_t k = 0; k < set.names.size(); ++k) {
        if (set.names[k] == "jawOpen" || set.names[k] == "eyeBlinkRight") {
            surprised += set.offsets.col(static_cast<Eigen::Index>(k));
        }
    }
    std::vector<Tile> tiles;
    const auto add_tile = [&](const Eigen::VectorXf& shape, double yaw_deg, const std::string& caption) {
        Camera camera = camera_at(yaw_deg, size_px);
        camera.scale_px_per_mm *= 1.35;
        ImageU8 picture = render_mesh(mesh_to_draw(model, shape, model.color->mean), camera, size_px, size_px, {});
        const Eigen::Matrix3Xf points =
            map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()));
        const auto place = [&](int i) { return camera.project(Eigen::Vector3d(points.col(i).cast<double>())); };
        for (const std::vector<int>& line : mesh_lines) {
            for (std::size_t i = 1; i < line.size(); ++i) {
                draw_line(picture, place(line[i - 1]), place(line[i]), {40, 90, 200}, 1.5);
            }
        }
        for (int i = 0; i < static_cast<int>(points.cols()); ++i) {
            draw_disc(picture, place(i), 1.5, {210, 30, 40});
        }
        tiles.push_back({picture, caption});
    };
    add_tile(model.shape.mean, 0, "mean");
    add_tile(model.shape.mean, 40, "mean, 40 deg");
    add_tile(surprised, 0, "jawOpen, eyeBlinkRight");
    save_sheet(folder / "model-mediapipe478.png", tiles, static_cast<int>(tiles.size()), size_px);
}

void draw_levels(const MorphableModel& model, const std::filesystem::path& folder)
{
    constexpr int size_px = 360;
    ShadingOptions options;
    options.mode = DrawMode::surface_and_wireframe;
    options.surface = SurfaceColor::clay;
    std::vector<Tile> tiles;
    for (int level = 0; level < static_cast<int>(model.levels.size()); ++level) {
        const MorphableModel coarse = model.at_level(level);
        tiles.push_back({draw_shape(coarse, coarse.shape.mean, coarse.color->mean, 25, options, size_px),
                         std::to_string(coarse.num_vertices()) + " vertices"});
    }
    save_sheet(folder / "model-levels.png", tiles, static_cast<int>(tiles.size()), size_px);
}

void draw_modes(const MorphableModel& model, const std::filesystem::path& folder)
{
    std::vector<Tile> shapes;
    std::vector<Tile> colors;
    for (const double sigmas : {-2.0, 2.0}) {
        for (int mode = 0; mode < 8; ++mode) {
            const Eigen::VectorXd a = sigmas * Eigen::VectorXd::Unit(mode + 1, mode);
            const std::string caption = "mode " + std::to_string(mode + 1) + (sigmas < 0 ? ", -2 sd" : ", +2 sd");
            shapes.push_back({draw_shape(model, model.shape.instance(a), model.color->mean, 25), caption});
            colors.push_back({draw_shape(model, model.shape.mean, model.color->instance(a), 15), caption});
        }
    }
    save_sheet(folder / "model-modes.png", shapes, 8);
    save_sheet(folder / "model-color-modes.png", colors, 8);
}

void draw_samples(const MorphableModel& model, const std::filesystem::path& folder)
{
    Random random(20);
    std::vector<Tile> tiles;
    for (int i = 0; i < 16; ++i) {
        Eigen::VectorXd shape(model.shape.num_coefficients());
        Eigen::VectorXd color(model.color->num_coefficients());
        for (double& value : shape) {
            value = random.normal();
        }
        for (double& value : color) {
            value = random.normal();
        }
        const double yaw_deg = random.uniform(-50, 50);
        tiles.push_back({draw_shape(model, model.shape.instance(shape), model.color->instance(color), yaw_deg), ""});
    }
    save_sheet(folder / "model-samples.png", tiles, 8);
}

void draw_expressions(const MorphableModel& model, const std::filesystem::path& folder)
{
    for (const Blendshapes& set : model.expression_sets) {
        std::vector<Tile> tiles;
        const bool is_small = set.num_coefficients() <= 6;
        for (const double yaw_deg : is_small ? std::vector<double>{0, 45} : std::vector<double>{0}) {
            for (Eigen::Index k = 0; k < set.num_coefficients(); ++k) {
                const Eigen::VectorXf shape = model.shape.mean + set.offsets.col(k);
                tiles.push_back(
                    {draw_shape(model, shape, model.color->mean, yaw_deg), set.names[static_cast<std::size_t>(k)]});
            }
        }
        save_sheet(folder / ("model-" + set.name + ".png"), tiles, is_small ? 6 : 8);
    }
}

/// First-order mean and standard deviation of the distance between two landmarks.
void print_distance(const MorphableModel& model, int from, int to)
{
    const LandmarkMap& map = model.landmark_maps.front();
    const auto length = [&](const Eigen::VectorXf& shape) {
        const Eigen::Matrix3Xf points =
            map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()));
        return static_cast<double>((points.col(from - 1) - points.col(to - 1)).norm());
    };
    const Eigen::MatrixXf basis = model.shape.rescaled_basis();
    double variance = 0.0;
    for (Eigen::Index i = 0; i < basis.cols(); ++i) {
        const double slope = (length(model.shape.mean + basis.col(i)) - length(model.shape.mean - basis.col(i))) / 2.0;
        variance += slope * slope;
    }
    std::printf("landmarks %d-%d: %.1f mm, standard deviation %.1f mm\n", from, to, length(model.shape.mean),
                std::sqrt(variance));
}

void print_figures(const MorphableModel& model)
{
    const Eigen::VectorXd variances = model.shape.standard_deviations.cast<double>().array().square().matrix();
    for (const double share : {0.5, 0.9, 0.95, 0.98, 0.99}) {
        Eigen::Index count = 0;
        for (double sum = 0.0; sum < share * variances.sum(); ++count) {
            sum += variances[count];
        }
        std::printf("%.0f %% of the variance of all %d modes: %d modes\n", 100 * share,
                    static_cast<int>(variances.size()), static_cast<int>(count));
    }
    std::printf("standard deviation of a vertex: %.2f mm (root mean square)\n",
                std::sqrt(variances.sum() / static_cast<double>(model.num_vertices())));
    for (const auto& [from, to] : std::vector<std::pair<int, int>>{{37, 46},
                                                                   {40, 43},
                                                                   {1, 17},
                                                                   {5, 13},
                                                                   {28, 9},
                                                                   {28, 34},
                                                                   {34, 9},
                                                                   {32, 36},
                                                                   {31, 34},
                                                                   {49, 55},
                                                                   {52, 58}}) {
        print_distance(model, from, to);
    }
}

} // namespace

int main(int argc, char** argv)
{
    if (argc != 3) {
        std::fprintf(stderr, "usage: lineament-draw-default-model MODEL.safetensors FOLDER\n");
        return 2;
    }
    try {
        const MorphableModel model = load_model(argv[1]);
        const std::filesystem::path folder = argv[2];
        std::filesystem::create_directories(folder);
        draw_mean(model, folder);
        draw_landmarks(model, folder);
        draw_mesh_points(model, folder);
        draw_levels(model, folder);
        draw_modes(model, folder);
        draw_samples(model, folder);
        draw_expressions(model, folder);
        save_png(folder / "model-isomap.png",
                 draw_uv_layout(model.uv_coordinates, model.levels.back().uv_triangles, 640));
        print_figures(model);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "lineament-draw-default-model: error: %s\n", error.what());
        return 4;
    }
    return 0;
}
