// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "test_meshes.hpp"

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace lineament::test {

Mesh make_plane(double width_mm, double height_mm, double z_mm, int columns, int rows)
{
    Mesh mesh;
    const int stride = columns + 1;
    mesh.vertices.resize(3, stride * (rows + 1));
    mesh.uv_coordinates.resize(2, mesh.vertices.cols());
    mesh.triangles.resize(3, 2 * columns * rows);
    for (int j = 0; j <= rows; ++j) {
        for (int i = 0; i <= columns; ++i) {
            const double u = static_cast<double>(i) / columns;
            const double v = static_cast<double>(j) / rows;
            mesh.vertices.col(j * stride + i) =
                Eigen::Vector3d(width_mm * (u - 0.5), height_mm * (0.5 - v), z_mm).cast<float>();
            mesh.uv_coordinates.col(j * stride + i) = Eigen::Vector2d(u, v).cast<float>();
        }
    }
    int t = 0;
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            const int a = j * stride + i; // top left of the cell
            mesh.triangles.col(t++) = Eigen::Vector3i(a, a + stride, a + 1);
            mesh.triangles.col(t++) = Eigen::Vector3i(a + 1, a + stride, a + stride + 1);
        }
    }
    mesh.uv_triangles = mesh.triangles;
    return mesh;
}

Mesh make_sphere(double radius_mm, const Eigen::Vector3d& center, int columns, int rows)
{
    Mesh mesh = make_plane(1.0, 1.0, 0.0, columns, rows);
    for (Eigen::Index v = 0; v < mesh.vertices.cols(); ++v) {
        const double longitude = 2 * std::numbers::pi * (mesh.uv_coordinates(0, v) - 0.5);
        const double latitude = std::numbers::pi * (0.5 - mesh.uv_coordinates(1, v));
        const Eigen::Vector3d direction(std::sin(longitude) * std::cos(latitude), std::sin(latitude),
                                        std::cos(longitude) * std::cos(latitude));
        mesh.vertices.col(v) = (center + radius_mm * direction).cast<float>();
    }
    return mesh;
}

Mesh join(const Mesh& a, const Mesh& b)
{
    Mesh mesh = a;
    mesh.vertices.resize(3, a.vertices.cols() + b.vertices.cols());
    mesh.vertices << a.vertices, b.vertices;
    mesh.triangles.resize(3, a.triangles.cols() + b.triangles.cols());
    mesh.triangles << a.triangles, (b.triangles.array() + static_cast<int>(a.vertices.cols())).matrix();
    mesh.uv_triangles = Eigen::Matrix3Xi::Zero(3, mesh.triangles.cols());
    mesh.uv_triangles.leftCols(a.uv_triangles.cols()) = a.uv_triangles;
    return mesh;
}

std::optional<std::pair<int, double>> cast_ray(const Mesh& mesh, const Camera& camera, const Eigen::Vector2d& point_px)
{
    const Eigen::Vector2d e = (point_px - camera.principal_point_px) / camera.scale_px_per_mm;
    const Eigen::Vector3d origin(e.x(), e.y(), 0.0); // the ray's point at depth 0, and its change with depth:
    const Eigen::Vector3d direction(camera.phi_per_mm * e.x(), camera.phi_per_mm * e.y(), 1.0);
    std::optional<std::pair<int, double>> nearest;
    for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
        Eigen::Matrix3d corners;
        for (int i = 0; i < 3; ++i) {
            corners.col(i) = camera.in_camera(mesh.vertices.col(mesh.triangles(i, t)).cast<double>());
        }
        // Moeller and Trumbore: origin + z direction = a + v (b - a) + w (c - a)
        const Eigen::Vector3d ab = corners.col(1) - corners.col(0);
        const Eigen::Vector3d ac = corners.col(2) - corners.col(0);
        const Eigen::Vector3d p = direction.cross(ac);
        const double determinant = ab.dot(p);
        if (std::abs(determinant) < 1e-12) {
            continue;
        }
        const Eigen::Vector3d s = origin - corners.col(0);
        const double v = s.dot(p) / determinant;
        const Eigen::Vector3d q = s.cross(ab);
        const double w = direction.dot(q) / determinant;
        const double z = ac.dot(q) / determinant;
        if (v >= 0 && w >= 0 && v + w <= 1 && (!nearest || z < nearest->second)) {
            nearest = {static_cast<int>(t), z};
        }
    }
    return nearest;
}

Camera centered_camera(int width, int height, double scale_px_per_mm, const HeadAngles& angles, double phi_per_mm)
{
    Camera camera;
    camera.camera_from_model = rotation_from_angles(angles);
    camera.scale_px_per_mm = scale_px_per_mm;
    camera.phi_per_mm = phi_per_mm;
    camera.principal_point_px = Eigen::Vector2d(0.5 * width, 0.5 * height);
    return camera;
}

} // namespace lineament::test
