// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/depth_pose_impl.hpp"
#include "lineament/fit/perspective_pose_impl.hpp"
#include "lineament/fit/pose_impl.hpp"
