// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/vision/video_reader.hpp"
#include "lineament/vision/video_writer.hpp"
