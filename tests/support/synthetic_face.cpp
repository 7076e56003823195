// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "support/synthetic_face.hpp"

#include "lineament/camera/angles.hpp"

#include <Eigen/Geometry>
#include <Eigen/QR>

#include <cmath>
#include <numbers>

namespace lineament::test {

namespace {

/// Grid position -> vertex index: the even columns and rows (the coarse level) come first.
struct Grid
{
    int columns;
    int rows;
    [[nodiscard]] int index(int column, int row) const
    {
        const int coarse_columns = (columns + 1) / 2;
        const int num_coarse = coarse_columns * ((rows + 1) / 2);
        if (column % 2 == 0 && row % 2 == 0) {
            return (row / 2) * coarse_columns + column / 2;
        }
        int before = row * columns + column;        // grid points before this one in reading order,
        before -= ((row + 1) / 2) * coarse_columns; // without the coarse ones of earlier rows
        if (row % 2 == 0) {
            before -= (column + 1) / 2; // and of this row
        }
        return num_coarse + before;
    }
};

/// Point of the face at (u, v) in [-1, 1]^2, v up.
Eigen::Vector3d face_point(double u, double v)
{
    const double longitude = u * 1.35;
    const double latitude = v * 1.25;
    Eigen::Vector3d point(75 * std::sin(longitude) * std::cos(latitude), 105 * std::sin(latitude),
                          85 * std::cos(longitude) * std::cos(latitude));
    point.z() += 22 * std::exp(-(u * u) / 0.012 - (v - 0.02) * (v - 0.02) / 0.03);                            // nose
    point.z() -= 6 * std::exp(-((std::abs(u) - 0.3) * (std::abs(u) - 0.3) + (v - 0.25) * (v - 0.25)) / 0.01); // eyes
    return point;
}

/// (u, v) of the 68 points; enough like a face for every solver.
std::vector<Eigen::Vector2d> landmark_positions()
{
    std::vector<Eigen::Vector2d> uv;
    for (int i = 0; i < 17; ++i) { // jaw, subject's right ear to left ear
        const double angle = std::numbers::pi * (i / 16.0);
        uv.emplace_back(-0.92 * std::cos(angle), 0.15 - 0.85 * std::sin(angle));
    }
    for (int i = 0; i < 5; ++i) {
        uv.emplace_back(-0.55 + 0.1 * i, 0.4 + 0.04 * std::sin(std::numbers::pi * i / 4));
    }
    for (int i = 0; i < 5; ++i) {
        uv.emplace_back(0.15 + 0.1 * i, 0.4 + 0.04 * std::sin(std::numbers::pi * i / 4));
    }
    for (int i = 0; i < 4; ++i) {
        uv.emplace_back(0.0, 0.3 - 0.09 * i);
    }
    for (int i = 0; i < 5; ++i) {
        uv.emplace_back(-0.12 + 0.06 * i, -0.07 - 0.02 * (2 - std::abs(i - 2)));
    }
    for (int side = -1; side <= 1; side += 2) {
        for (int i = 0; i < 6; ++i) {
            const double angle = std::numbers::pi - i * std::numbers::pi / 3;
            uv.emplace_back(side * 0.32 + 0.12 * std::cos(angle), 0.25 + 0.05 * std::sin(angle));
        }
    }
    for (int i = 0; i < 12; ++i) {
        const double angle = std::numbers::pi - i * std::numbers::pi / 6;
        uv.emplace_back(0.25 * std::cos(angle), -0.35 + 0.09 * std::sin(angle));
    }
    for (int i = 0; i < 8; ++i) {
        const double angle = std::numbers::pi - i * std::numbers::pi / 4;
        uv.emplace_back(0.2 * std::cos(angle), -0.35 + 0.03 * std::sin(angle));
    }
    return uv;
}

} // namespace

MorphableModel make_synthetic_face(const SyntheticFaceOptions& options)
{
    const Grid grid{2 * options.half_columns + 1, 2 * options.half_rows + 1};
    const int num_vertices = grid.columns * grid.rows;
    const auto u_of = [&](int column) { return static_cast<double>(column) / options.half_columns - 1.0; };
    const auto v_of = [&](int row) { return 1.0 - static_cast<double>(row) / options.half_rows; };

    MorphableModel model;
    model.name = "synthetic-face";
    model.license = "CC0-1.0";
    model.provenance = "made by the tests";
    model.triangle_group_names = {"skin"};
    Eigen::Matrix3Xd vertices(3, num_vertices);
    model.uv_coordinates.resize(2, num_vertices);
    model.mirror.resize(num_vertices);
    for (int row = 0; row < grid.rows; ++row) {
        for (int column = 0; column < grid.columns; ++column) {
            const int index = grid.index(column, row);
            vertices.col(index) = face_point(u_of(column), v_of(row));
            model.uv_coordinates.col(index) = Eigen::Vector2f(static_cast<float>(0.02 + 0.48 * (u_of(column) + 1)),
                                                              static_cast<float>(0.02 + 0.48 * (1 - v_of(row))));
            model.mirror[index] = grid.index(grid.columns - 1 - column, row);
        }
    }
    vertices.colwise() -= Eigen::Vector3d(vertices.rowwise().mean());
    model.shape.mean = Eigen::Map<const Eigen::VectorXd>(vertices.data(), vertices.size()).cast<float>();

    // Smooth modes: products of cosines times a direction, made orthonormal; odd in x where x moves (symmetric face).
    Eigen::MatrixXd modes(3 * num_vertices, options.num_shape_coefficients);
    for (int mode = 0; mode < options.num_shape_coefficients; ++mode) {
        const int axis = mode % 3;
        const int frequency_u = (mode / 3) % 3;
        const int frequency_v = 1 + (mode / 3 + mode % 2) % 3;
        for (int row = 0; row < grid.rows; ++row) {
            for (int column = 0; column < grid.columns; ++column) {
                const double u = u_of(column);
                const double v = v_of(row);
                Eigen::Vector3d offset = Eigen::Vector3d::Zero();
                const double along_v = std::cos(frequency_v * 1.3 * v + 0.5 * mode);
                offset[axis] =
                    (axis == 0 ? std::sin((frequency_u + 1) * 1.4 * u) : std::cos(frequency_u * 2.0 * u)) * along_v;
                modes.block<3, 1>(3 * grid.index(column, row), mode) = offset;
            }
        }
    }
    Eigen::HouseholderQR<Eigen::MatrixXd> qr(modes);
    const Eigen::MatrixXd basis =
        qr.householderQ() * Eigen::MatrixXd::Identity(3 * num_vertices, options.num_shape_coefficients);
    model.shape.basis = basis.cast<float>();
    model.shape.standard_deviations.resize(options.num_shape_coefficients);
    for (int mode = 0; mode < options.num_shape_coefficients; ++mode) {
        model.shape.standard_deviations[mode] =
            static_cast<float>(3.0 * std::pow(0.85, mode) * std::sqrt(static_cast<double>(num_vertices)));
    }

    Blendshapes expressions;
    expressions.name = "ekman6";
    const char* const names[] = {"anger", "disgust", "fear", "happiness", "sadness", "surprise"};
    expressions.offsets = Eigen::MatrixXf::Zero(3 * num_vertices, options.num_expressions);
    expressions.standard_deviations = Eigen::VectorXf::Constant(options.num_expressions, 0.3f);
    for (int k = 0; k < options.num_expressions; ++k) {
        expressions.names.push_back(k < 6 ? names[k] : "extra" + std::to_string(k));
        const double centre_u = 0.12 + 0.1 * (k % 3);
        const double centre_v = -0.45 + 0.3 * k;
        for (int row = 0; row < grid.rows; ++row) {
            for (int column = 0; column < grid.columns; ++column) {
                const double du = std::abs(u_of(column)) - centre_u;
                const double dv = v_of(row) - centre_v;
                const double bump = std::exp(-(du * du + dv * dv) / 0.03);
                const double side = std::tanh(8 * u_of(column));
                expressions.offsets.block<3, 1>(3 * grid.index(column, row), k) =
                    Eigen::Vector3d(3.0 * side * (k % 2 == 0 ? 1 : -1), k % 2 == 0 ? 8.0 : -9.0, 2.0 + k)
                        .cast<float>() *
                    static_cast<float>(bump);
            }
        }
    }
    model.expression_sets.push_back(expressions);

    if (options.with_color) {
        PcaModel color;
        color.mean = Eigen::VectorXf::Constant(3 * num_vertices, 0.55f);
        color.basis =
            Eigen::VectorXf::Constant(3 * num_vertices, 1.0f / std::sqrt(3.0f * static_cast<float>(num_vertices)));
        color.standard_deviations =
            Eigen::VectorXf::Constant(1, 0.1f * std::sqrt(3.0f * static_cast<float>(num_vertices)));
        model.color = color;
    }

    for (const int step : {2, 1}) {
        Level level;
        level.num_vertices = ((grid.columns - 1) / step + 1) * ((grid.rows - 1) / step + 1);
        std::vector<Eigen::Vector3i> triangles;
        for (int row = 0; row + step < grid.rows; row += step) {
            for (int column = 0; column + step < grid.columns; column += step) {
                const int a = grid.index(column, row);
                const int b = grid.index(column, row + step);
                const int c = grid.index(column + step, row + step);
                const int d = grid.index(column + step, row);
                if (column < options.half_columns) { // diagonals mirror each other
                    triangles.emplace_back(a, b, c);
                    triangles.emplace_back(a, c, d);
                } else {
                    triangles.emplace_back(a, b, d);
                    triangles.emplace_back(b, c, d);
                }
            }
        }
        level.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
        for (std::size_t t = 0; t < triangles.size(); ++t) {
            level.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
        }
        level.triangle_groups = Eigen::VectorXi::Zero(level.triangles.cols());
        level.uv_triangles = level.triangles;
        model.levels.push_back(level);
    }

    const auto nearest = [&](const Eigen::Vector2d& uv) { // coarse grid point
        const int column = 2 * static_cast<int>(std::lround((uv.x() + 1) * options.half_columns / 2));
        const int row = 2 * static_cast<int>(std::lround((1 - uv.y()) * options.half_rows / 2));
        return grid.index(column, row);
    };
    LandmarkMap map;
    map.scheme = "ibug68";
    const std::vector<Eigen::Vector2d> positions = landmark_positions();
    map.vertices.resize(3, static_cast<Eigen::Index>(positions.size()));
    map.weights.resize(3, static_cast<Eigen::Index>(positions.size()));
    for (std::size_t l = 0; l < positions.size(); ++l) {
        map.names.push_back(std::to_string(l + 1));
        map.vertices.col(static_cast<Eigen::Index>(l)).setConstant(nearest(positions[l]));
        map.weights.col(static_cast<Eigen::Index>(l)) = Eigen::Vector3f(1, 0, 0);
    }
    model.landmark_maps.push_back(map);
    for (int i = 0; i <= 24; ++i) {
        const double angle = 0.5 * std::numbers::pi * i / 24;
        const Eigen::Vector2d right(-0.92 * std::cos(angle), 0.15 - 0.85 * std::sin(angle));
        const int right_vertex = nearest(right);
        if (model.contour_right.empty() || model.contour_right.back() != right_vertex) {
            model.contour_right.push_back(right_vertex);
            model.contour_left.push_back(model.mirror[right_vertex]);
        }
    }
    model.masks["face"] = Eigen::VectorXf::Ones(num_vertices);
    return model;
}

Eigen::VectorXd random_normal(Random& random, Eigen::Index size)
{
    Eigen::VectorXd values(size);
    for (double& value : values) {
        value = random.normal();
    }
    return values;
}

Eigen::VectorXd random_uniform(Random& random, Eigen::Index size, double low, double high)
{
    Eigen::VectorXd values(size);
    for (double& value : values) {
        value = random.uniform(low, high);
    }
    return values;
}

Camera random_camera(Random& random, double max_yaw_deg)
{
    Camera camera;
    const double yaw = radians(random.uniform(-max_yaw_deg, max_yaw_deg));
    const double pitch = radians(random.uniform(-max_yaw_deg, max_yaw_deg) / 3);
    const double roll = radians(random.uniform(-max_yaw_deg, max_yaw_deg) / 3);
    camera.camera_from_model = rotation_from_angles({yaw, pitch, roll});
    camera.scale_px_per_mm = random.uniform(1.0, 1.4);
    camera.principal_point_px = Eigen::Vector2d(320, 240);
    camera.translation_mm = Eigen::Vector2d{random.uniform(-20, 20), random.uniform(-20, 20)};
    return camera;
}

Eigen::Matrix3Xd random_points(Random& random, int count)
{
    Eigen::Matrix3Xd points(3, count);
    for (int i = 0; i < count; ++i) {
        points.col(i) = Eigen::Vector3d{random.uniform(-75, 75), random.uniform(-100, 100), random.uniform(-20, 80)};
    }
    return points;
}

LandmarkSet project_landmarks(const MorphableModel& model, const std::string& scheme,
                              const Eigen::VectorXd& shape_coefficients, const Eigen::VectorXd& expression_coefficients,
                              const Camera& camera, double noise_px, Random& random)
{
    Eigen::VectorXf shape = model.shape.instance(shape_coefficients);
    if (expression_coefficients.size() > 0) {
        shape += model.expression_sets.front().displacement(expression_coefficients);
    }
    const LandmarkMap& map = *model.find_landmark_map(scheme);
    const Eigen::Matrix3Xf points =
        map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, model.num_vertices()));
    LandmarkSet set;
    set.scheme = scheme;
    for (Eigen::Index l = 0; l < points.cols(); ++l) {
        Landmark landmark;
        landmark.name = map.names[static_cast<std::size_t>(l)];
        landmark.point_px = camera.project(Eigen::Vector3d(points.col(l).cast<double>()));
        landmark.point_px += noise_px * Eigen::Vector2d{random.normal(), random.normal()};
        set.landmarks.push_back(landmark);
    }
    return set;
}

void add_depth(const MorphableModel& model, const Camera& camera, double origin_px, LandmarkSet& set)
{
    const LandmarkMap& map = *model.find_landmark_map(set.scheme);
    const Eigen::Matrix3Xf points =
        map.points_on(Eigen::Map<const Eigen::Matrix3Xf>(model.shape.mean.data(), 3, model.num_vertices()));
    for (Landmark& landmark : set.landmarks) {
        const Eigen::Vector3d point = points.col(map.index_of(landmark.name)).cast<double>();
        landmark.depth_px = origin_px + camera.scale_px_per_mm * camera.camera_from_model.row(2).dot(point);
    }
}

LandmarkSet without_depth(LandmarkSet set)
{
    for (Landmark& landmark : set.landmarks) {
        landmark.depth_px.reset();
    }
    return set;
}

double angle_between_deg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
    return degrees(Eigen::AngleAxisd(Eigen::Matrix3d(a.transpose() * b)).angle());
}

} // namespace lineament::test
