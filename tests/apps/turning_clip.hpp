// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// A clip of a rendered person who turns the head, leaves the picture, and comes back.
#pragma once

#include "support/rendered_person.hpp"

#include "lineament/vision/video_writer.hpp"

namespace lineament::test {

inline constexpr int num_frames = 30;
inline constexpr double frame_rate = 24.0; ///< [1/s].

inline bool shows_the_person(int frame)
{
    return frame < 11 || frame >= 18;
}

inline double planted_yaw_deg(int frame)
{
    return -20.0 + 40.0 * frame / (num_frames - 1);
}

/// The first `count` frames of the clip at frame_rate; the person is in those that shows_the_person() names.
inline void save_turning_clip(const std::string& path, int count = num_frames)
{
    const RenderedPerson person(5);
    VideoWriter writer(path);
    for (int i = 0; i < count; ++i) {
        const ImageU8 picture =
            shows_the_person(i) ? person.picture(planted_yaw_deg(i), 480, 360) : ImageU8(480, 360, 3, 246);
        writer.write(picture, i / frame_rate);
    }
    writer.finish();
}

} // namespace lineament::test
