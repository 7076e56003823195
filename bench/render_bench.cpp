// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Time of the renderer's parts on a sphere of about 7,000 triangles that fills most of a 512 x 512 picture.
#include "calibration.hpp"

#include "lineament/render/background.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/render/texture_completion.hpp"
#include "lineament/render/texture_fusion.hpp"

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <numbers>

namespace {

using namespace lineament;

constexpr int side_px = 512;
constexpr double radius_mm = 100.0;

/// Front and back of a sphere with uv of longitude and latitude.
Mesh make_sphere()
{
    constexpr int columns = 84;
    constexpr int rows = 42;
    Mesh mesh;
    mesh.vertices.resize(3, (columns + 1) * (rows + 1));
    mesh.uv_coordinates.resize(2, mesh.vertices.cols());
    mesh.triangles.resize(3, 2 * columns * rows);
    for (int j = 0; j <= rows; ++j) {
        for (int i = 0; i <= columns; ++i) {
            const double longitude = 2 * std::numbers::pi * (static_cast<double>(i) / columns - 0.5);
            const double latitude = std::numbers::pi * (0.5 - static_cast<double>(j) / rows);
            const Eigen::Vector3d point(std::sin(longitude) * std::cos(latitude), std::sin(latitude),
                                        std::cos(longitude) * std::cos(latitude));
            mesh.vertices.col(j * (columns + 1) + i) = (radius_mm * point).cast<float>();
            mesh.uv_coordinates.col(j * (columns + 1) + i) =
                Eigen::Vector2d(static_cast<double>(i) / columns, static_cast<double>(j) / rows).cast<float>();
        }
    }
    for (int j = 0, t = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            const int a = j * (columns + 1) + i;
            mesh.triangles.col(t++) = Eigen::Vector3i(a, a + columns + 1, a + 1);
            mesh.triangles.col(t++) = Eigen::Vector3i(a + 1, a + columns + 1, a + columns + 2);
        }
    }
    mesh.uv_triangles = mesh.triangles;
    return mesh;
}

struct Scene
{
    Mesh mesh = make_sphere();
    Camera camera = frame_camera(mesh, {0.3, 0.1, 0.05}, side_px, side_px);
    TextureLayout layout{mesh, side_px};
    ImageU8 picture = render_mesh(mesh, camera, side_px, side_px);
    TextureMap map = extract_texture(layout, mesh.vertices, mesh.triangles, camera, picture);
};

const Scene& scene()
{
    static const Scene value;
    return value;
}

void rasterize_bench(benchmark::State& state)
{
    const Scene& s = scene();
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(rasterize(s.mesh.vertices, s.mesh.triangles, s.camera, side_px, side_px));
    }
}

void render_depth_bench(benchmark::State& state)
{
    const Scene& s = scene();
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(render_depth(s.mesh.vertices, s.mesh.triangles, s.camera, side_px, side_px));
    }
}

void compute_visibility_bench(benchmark::State& state)
{
    const Scene& s = scene();
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(compute_visibility(s.mesh.vertices, s.mesh.triangles, s.camera, side_px, side_px));
    }
}

void render_mesh_bench(benchmark::State& state)
{
    const Scene& s = scene();
    const ShadingOptions options{.ambient_occlusion = state.range(1) != 0 ? 0.7 : 0.0,
                                 .supersampling = static_cast<int>(state.range(0))};
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(render_mesh(s.mesh, s.camera, side_px, side_px, options));
    }
}

void extract_texture_bench(benchmark::State& state)
{
    const Scene& s = scene();
    const TextureLayout layout(s.mesh, static_cast<int>(state.range(0)));
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(extract_texture(layout, s.mesh.vertices, s.mesh.triangles, s.camera, s.picture));
    }
}

/// What `vertex_skin` adds to extract_texture.
void foreground_test_bench(benchmark::State& state)
{
    const Scene& s = scene();
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(ForegroundTest(s.mesh.vertices, s.mesh.triangles, s.camera, s.picture));
    }
}

void fuse_texture_bench(benchmark::State& state)
{
    const Scene& s = scene();
    TextureAccumulator accumulator(side_px);
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(accumulator.add(s.map));
    }
}

void complete_texture_bench(benchmark::State& state)
{
    const Scene& s = scene();
    for ([[maybe_unused]] auto _ : state) {
        benchmark::DoNotOptimize(complete_texture(s.map));
    }
}

BENCHMARK(bench::calibration)->Unit(benchmark::kMillisecond);
BENCHMARK(rasterize_bench)->Unit(benchmark::kMillisecond);
BENCHMARK(render_depth_bench)->Unit(benchmark::kMillisecond);
BENCHMARK(compute_visibility_bench)->Unit(benchmark::kMillisecond);
BENCHMARK(render_mesh_bench)
    ->ArgNames({"supersampling", "occlusion"})
    ->Args({1, 0})
    ->Args({2, 0})
    ->Args({2, 1})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(foreground_test_bench)->Unit(benchmark::kMillisecond);
BENCHMARK(extract_texture_bench)->ArgName("size")->Arg(256)->Arg(512)->Unit(benchmark::kMillisecond);
BENCHMARK(fuse_texture_bench)->Unit(benchmark::kMillisecond);
BENCHMARK(complete_texture_bench)->Unit(benchmark::kMillisecond);

/// The picture must be right before its time counts: depth of the sphere against its equation.
bool is_accurate()
{
    const Scene& s = scene();
    const ImageF depth = render_depth(s.mesh.vertices, s.mesh.triangles, s.camera, side_px, side_px);
    double largest_mm = 0.0;
    for (int row = 0; row < side_px; ++row) {
        for (int column = 0; column < side_px; ++column) {
            const Eigen::Vector2d at_mm =
                (Eigen::Vector2d(column + 0.5, row + 0.5) - s.camera.principal_point_px) / s.camera.scale_px_per_mm -
                s.camera.translation_mm;
            if (at_mm.norm() < 0.9 * radius_mm) {
                const double expected = -std::sqrt(radius_mm * radius_mm - at_mm.squaredNorm());
                largest_mm = std::max(largest_mm, std::abs(depth.at(column, row) - expected));
            }
        }
    }
    std::printf("largest depth error on the sphere: %.3f mm (its facets lie up to 0.3 mm inside)\n", largest_mm);
    return largest_mm < 0.7;
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    if (!is_accurate()) {
        std::fprintf(stderr, "render_bench: the depth image is wrong\n");
        return 1;
    }
    benchmark::RunSpecifiedBenchmarks();
}
