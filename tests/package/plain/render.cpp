// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The renderer header-only: the picture of a square with a texture, and the texture found again in the picture.
#include "lineament/camera/angles.hpp"
#include "lineament/render/color_scale.hpp"
#include "lineament/render/contact_sheet.hpp"
#include "lineament/render/shading.hpp"
#include "lineament/render/texture_completion.hpp"
#include "lineament/render/texture_fusion.hpp"

#include <cstdio>
#include <cstdlib>

int main()
{
    using namespace lineament;
    Mesh square;
    square.vertices.resize(3, 4);
    square.vertices << -50, 50, 50, -50, 50, 50, -50, -50, 0, 0, 0, 0;
    square.triangles.resize(3, 2);
    square.triangles << 0, 0, 2, 3, 1, 2;
    square.uv_coordinates.resize(2, 4);
    square.uv_coordinates << 0, 1, 1, 0, 0, 0, 1, 1;
    square.uv_triangles = square.triangles;

    ImageU8 texture(32, 32, 3, 60);
    fill_rectangle(texture, 8, 8, 16, 16, {200, 120, 40});
    const Camera camera = frame_camera(square, HeadAngles{}, 128, 128);
    ShadingOptions options;
    options.lighting = Lighting::unlit;
    options.ambient_occlusion = 0;
    const ImageU8 picture = render_mesh(square, texture, camera, 128, 128, options);

    const TextureLayout layout(square, 32);
    TextureAccumulator accumulator(32);
    accumulator.add(extract_texture(layout, square.vertices, square.triangles, camera, picture));
    const CompletedTexture found = complete_texture(accumulator.texture());
    const int seen = found.color.at(16, 16, 0);
    const int rim = found.color.at(4, 16, 0);
    std::printf("red in the middle %d (planted 200), at the rim %d (60)\n", seen, rim);
    const ImageU8 sheet = contact_sheet({{picture, "picture"}, {add_color_bar(picture, 1.0, "mm"), "bar"}}, 2);
    return std::abs(seen - 200) <= 3 && std::abs(rim - 60) <= 3 && sheet.width > 512 ? 0 : 1;
}
