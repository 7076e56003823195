// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/camera/angles.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/model/morphable_model.hpp"

int main()
{
    const lineament::HeadAngles angles = lineament::angles_from_rotation(lineament::frontal_rotation());
    return angles.yaw == 0.0 ? 0 : 1;
}
