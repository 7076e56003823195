// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace lineament {

struct ShortRunOptions
{
    std::size_t min_frames = 6; ///< A face seen in fewer frames in a row is not believed ...
    std::size_t max_gap = 12;   ///< ... unless at most so many frames lie between it and a longer run.
};

/// The frames of a video whose face is a false alarm: seen too shortly, and far from every longer sighting. A face that
/// is there in all frames of a short video is believed.
/// @param has_face  Whether a face was seen, for each frame.
[[nodiscard]] inline std::vector<bool> find_short_runs(const std::vector<bool>& has_face,
                                                       const ShortRunOptions& options = {})
{
    struct Run
    {
        std::size_t begin;
        std::size_t end;
    };
    std::vector<Run> short_runs;
    std::vector<Run> long_runs;
    for (std::size_t begin = 0; begin < has_face.size();) {
        std::size_t end = begin;
        while (end < has_face.size() && has_face[end] == has_face[begin]) {
            ++end;
        }
        if (has_face[begin]) {
            const bool is_long = end - begin >= options.min_frames || end - begin == has_face.size();
            (is_long ? long_runs : short_runs).push_back({begin, end});
        }
        begin = end;
    }
    std::vector<bool> is_false_alarm(has_face.size(), false);
    for (const Run& run : short_runs) {
        bool is_believed = false;
        for (const Run& other : long_runs) {
            const std::size_t gap = other.end <= run.begin ? run.begin - other.end : other.begin - run.end;
            is_believed = is_believed || gap <= options.max_gap;
        }
        for (std::size_t i = run.begin; i < run.end && !is_believed; ++i) {
            is_false_alarm[i] = true;
        }
    }
    return is_false_alarm;
}

} // namespace lineament
