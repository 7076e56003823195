// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The rendered pictures of docs/fit-in-pictures.md: expressions with and without their bound, outline landmarks and
// what they are matched to, and the posterior standard deviation of each vertex beside the error made.
//
//   fit_pictures FOLDER [--model FILE] [--subjects N]
#include "fit_by_parts.hpp"
#include "options.hpp"
#include "planted.hpp"

#include "lineament/fit/contour.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/io/image_file.hpp"
#include "lineament/io/model_file.hpp"
#include "lineament/render/color_scale.hpp"
#include "lineament/render/contact_sheet.hpp"
#include "lineament/render/draw.hpp"
#include "lineament/render/shading.hpp"

#include <cstdio>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace lineament;
using bench::centre;
using bench::PlantedFaces;
using bench::Protocol;
using bench::Subject;

constexpr Color background = {255, 255, 255};

std::string text_of(const char* format, double value)
{
    char text[64];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

Camera camera_at(double yaw_deg, int size_px)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles({radians(yaw_deg), 0, 0});
    camera.scale_px_per_mm = 0.0048 * size_px; // the face fills the tile
    camera.principal_point_px = Eigen::Vector2d(0.5 * size_px, 0.44 * size_px);
    camera.translation_mm.x() = 17.0 * std::sin(radians(yaw_deg)); // vertices crowd at the front of the head
    return camera;
}

/// Six bits a channel, so that the files are smaller.
ImageU8 with_fewer_colors(ImageU8 image)
{
    for (std::uint8_t& value : image.data) {
        value = static_cast<std::uint8_t>(value | 3);
    }
    return image;
}

ImageU8 render(const PlantedFaces& faces, const Eigen::VectorXf& shape, const Camera& camera, int width, int height,
               SurfaceColor surface)
{
    Mesh mesh = faces.model().mesh_of(shape);
    mesh.colors = Eigen::Map<const Eigen::Matrix3Xf>(faces.model().color->mean.data(), 3, mesh.vertices.cols());
    ShadingOptions options;
    options.surface = surface;
    options.background = background;
    return with_fewer_colors(render_mesh(mesh, camera, width, height, options));
}

void save_sheet(const std::filesystem::path& path, const std::vector<Tile>& tiles, int columns, int tile_px)
{
    ContactSheetOptions options;
    options.tile_width_px = options.tile_height_px = tile_px;
    options.gap_px = 6;
    options.text_scale = 1;
    save_png(path, contact_sheet(tiles, columns, options));
}

/// Planted face, fit with psi >= 0, fit without a bound: the first subjects drawn, fitted from their landmarks.
void draw_expressions(const PlantedFaces& faces, const std::filesystem::path& folder)
{
    constexpr int tile_px = 170;
    const MorphableModel& model = faces.model();
    const ModelPoints points = landmark_points(model, *model.find_landmark_map("ibug68"),
                                               model.find_expression_set("ekman6"), model.shape.num_coefficients());
    const Protocol protocol;
    std::vector<Tile> rows[3];
    for (const Subject& subject : faces.draw_subjects(protocol, 3)) {
        const Eigen::VectorXf truth = faces.shape_of(subject.alpha, subject.psi[0]);
        const auto add = [&](std::vector<Tile>& row, const Eigen::VectorXf& shape, const std::string& caption) {
            row.push_back(
                {render(faces, shape, camera_at(20, tile_px), tile_px, tile_px, SurfaceColor::clay), caption});
        };
        add(rows[0], truth, "planted");
        bench::PartsOptions options;
        for (const bool is_bounded : {true, false}) {
            const double infinite = std::numeric_limits<double>::infinity();
            options.min_expression = is_bounded ? 0 : -infinite;
            options.max_expression = is_bounded ? 3 : infinite;
            const bench::PartsResult fit = bench::fit_by_parts(points, bench::points_of(subject.images[0]), options);
            const Eigen::VectorXf shape = faces.shape_of(fit.alpha, fit.psi);
            add(rows[is_bounded ? 1 : 2], shape,
                (is_bounded ? "psi >= 0: " : "psi free: ") + text_of("%.1f mm", faces.shape_error_mm(shape, truth)));
        }
    }
    std::vector<Tile> tiles;
    for (const std::vector<Tile>& row : rows) {
        tiles.insert(tiles.end(), row.begin(), row.end());
    }
    save_sheet(folder / "fit-expressions.png", tiles, static_cast<int>(rows[0].size()), tile_px);
}

/// A planted face from the side with its outline landmarks, before the fit (mean face in the estimated pose) and after,
/// and what they are matched to.
void draw_contours(const PlantedFaces& faces, const std::filesystem::path& folder)
{
    constexpr int tile_px = 380;
    constexpr double zoom = 1.6;
    const MorphableModel& model = faces.model();
    const ContourModel contour(model);
    Protocol protocol;
    protocol.min_yaw_deg = protocol.max_yaw_deg = 40;
    protocol.noise_px = 1.0;
    protocol.outline = bench::Outline::visible;
    const Subject subject = faces.draw_subjects(protocol, 1)[0];
    const Eigen::VectorXf truth = faces.shape_of(subject.alpha, subject.psi[0]);

    // The same picture, larger, with the landmarks in its middle.
    const Eigen::Vector2d middle(tile_px / 2.0, tile_px / 2.0);
    const Eigen::Vector2d looked_at = bench::points_of(subject.images[0]).rowwise().mean();
    const auto place = [&](const Eigen::Vector2d& point_px) {
        return Eigen::Vector2d(middle + zoom * (point_px - looked_at));
    };
    const auto enlarged = [&](Camera camera) {
        camera.scale_px_per_mm *= zoom;
        camera.principal_point_px = place(camera.principal_point_px);
        return camera;
    };
    const FaceFitter fitter(model);
    const FitResult fit = fitter.fit(subject.images[0], centre);
    FitResult start = fit;
    start.shape_coefficients.setZero();
    start.expression_coefficients.setZero();
    start.camera =
        estimate_pose(faces.landmark_points(model.shape.mean), bench::points_of(subject.images[0]), {}, centre).camera;

    std::vector<Tile> tiles;
    for (const bool is_fitted : {false, true}) {
        const FitResult& stage = is_fitted ? fit : start;
        ImageU8 picture = render(faces, truth, enlarged(subject.cameras[0]), tile_px, tile_px, SurfaceColor::clay);
        const Eigen::VectorXf shape = faces.shape_of(stage.shape_coefficients, stage.expression_coefficients);
        const Eigen::Map<const Eigen::Matrix3Xf> vertices(shape.data(), 3, model.num_vertices());
        const auto seen = [&](int v) {
            return place(stage.camera.project(Eigen::Vector3d(vertices.col(v).cast<double>())));
        };
        for (const int v : contour.candidates(FaceSide::right)) {
            draw_disc(picture, seen(v), 2.0, {60, 120, 220});
        }
        for (const int v : contour.silhouette_vertices(vertices, stage.camera, FaceSide::left)) {
            draw_disc(picture, seen(v), 2.0, {20, 150, 90});
        }
        const ContourMatches matches = match_contour(contour, vertices, stage.camera, subject.images[0]);
        for (const ContourMatch& match : matches.matches) {
            const Landmark& landmark = subject.images[0].landmarks[static_cast<std::size_t>(match.landmark_index)];
            draw_line(picture, place(landmark.point_px), seen(match.vertex), {30, 30, 30}, 1.2);
            draw_circle(picture, seen(match.vertex), 4.0, {30, 30, 30}, 1.2);
        }
        for (int l = 0; l < 17; ++l) {
            draw_disc(picture, place(subject.images[0].landmarks[static_cast<std::size_t>(l)].point_px), 3.2,
                      {215, 40, 40});
        }
        tiles.push_back({picture, is_fitted ? "after the fit" : "mean face in its first pose"});
    }
    save_sheet(folder / "fit-contour.png", tiles, 2, tile_px);
}

/// Predicted standard deviation (root of the summed variances of the three coordinates) and root mean square error of
/// each vertex, in model space, means over subjects.
struct VertexErrors
{
    Eigen::VectorXf predicted_mm;
    Eigen::VectorXf made_mm;
};

VertexErrors vertex_errors(const PlantedFaces& faces, int num_images, int num_subjects)
{
    Protocol protocol;
    protocol.num_images = num_images;
    const JointFitter joint(faces.model(), "ibug68", [&] {
        JointOptions options;
        options.contour = ContourMode::fixed;
        options.landmark_sigma_mm = options.contour_sigma_mm = protocol.noise_px / faces.mean_scale();
        options.bias_sigma_mm = 0;
        return options;
    }());
    const Eigen::Index count = faces.model().num_vertices();
    Eigen::VectorXf predicted = Eigen::VectorXf::Zero(count), made = Eigen::VectorXf::Zero(count);
    for (const Subject& subject : faces.draw_subjects(protocol, num_subjects)) {
        const JointFramesResult fit = joint.fit_frames(subject.images, centre);
        const Eigen::Matrix3Xf spread = vertex_standard_deviations(faces.model(), fit.shape_covariance);
        const Eigen::VectorXf offset =
            faces.model().shape.instance(fit.shape_coefficients) - faces.model().shape.instance(subject.alpha);
        predicted += spread.colwise().squaredNorm().transpose();
        made += Eigen::Map<const Eigen::Matrix3Xf>(offset.data(), 3, count).colwise().squaredNorm().transpose();
    }
    return {(predicted / static_cast<float>(num_subjects)).cwiseSqrt(),
            (made / static_cast<float>(num_subjects)).cwiseSqrt()};
}

void draw_uncertainty(const PlantedFaces& faces, const std::filesystem::path& folder, int num_subjects)
{
    constexpr int tile_px = 154;
    constexpr double largest_mm = 8;
    const Eigen::Index num_coefficients = faces.model().shape.num_coefficients();
    const VertexErrors one = vertex_errors(faces, 1, num_subjects);
    const VertexErrors ten = vertex_errors(faces, 10, num_subjects);
    const Eigen::VectorXf prior =
        vertex_standard_deviations(faces.model(), Eigen::MatrixXd::Identity(num_coefficients, num_coefficients))
            .colwise()
            .norm()
            .transpose();
    std::vector<Tile> tiles;
    for (const double yaw_deg : {0.0, 50.0}) {
        const auto add = [&](const Eigen::VectorXf& values_mm, const char* caption) {
            double sum = 0;
            for (const int v : faces.face_vertices()) {
                sum += values_mm[v] * values_mm[v];
            }
            const double rms_mm = std::sqrt(sum / static_cast<double>(faces.face_vertices().size()));
            const Mesh mean = faces.model().mesh_of(faces.model().shape.mean);
            const Camera camera = camera_at(yaw_deg, tile_px);
            tiles.push_back({with_fewer_colors(render_values(mean, values_mm, largest_mm, camera, tile_px, tile_px)),
                             caption + text_of("\n%.2f mm", rms_mm)});
        };
        add(prior, "prior");
        add(one.predicted_mm, "1 image, predicted");
        add(one.made_mm, "1 image, made");
        add(ten.predicted_mm, "10 images, predicted");
        add(ten.made_mm, "10 images, made");
    }
    ContactSheetOptions options;
    options.tile_width_px = options.tile_height_px = tile_px;
    options.gap_px = 6;
    options.text_scale = 1;
    save_png(folder / "fit-uncertainty.png", add_color_bar(contact_sheet(tiles, 5, options), largest_mm, "mm"));
}

} // namespace

int main(int argc, char** argv)
{
    const bench::Options given(argc, argv, "fit_pictures FOLDER [--model FILE] [--subjects N]", 1);
    const int num_subjects = given.count("--subjects", 100, 2);
    try {
        const PlantedFaces faces(load_model(given.text("--model", default_model_path())));
        const std::filesystem::path folder = argv[1];
        std::filesystem::create_directories(folder);
        draw_expressions(faces, folder);
        draw_contours(faces, folder);
        draw_uncertainty(faces, folder, num_subjects);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "fit_pictures: error: %s\n", error.what());
        return 1;
    }
    return 0;
}
