// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/io/model_file.hpp"

#include <string>

namespace lineament::test {

/// The model that ships, from the source tree: 3,166 vertices, 60 components, 6 or 47 expressions.
[[nodiscard]] inline const MorphableModel& face_model()
{
    static const MorphableModel model =
        load_model(std::string(LINEAMENT_SOURCE_DIR) + "/models/lineament-face-1.safetensors");
    return model;
}

} // namespace lineament::test
