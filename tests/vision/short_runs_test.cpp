// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/short_runs.hpp"

#include <gtest/gtest.h>

#include <string>

namespace lineament {
namespace {

/// Frames as characters: 'x' a face, '.' none; in the result 'x' a false alarm.
std::string false_alarms(const std::string& frames)
{
    std::vector<bool> has_face;
    for (const char c : frames) {
        has_face.push_back(c == 'x');
    }
    std::string result;
    for (const bool is_false : find_short_runs(has_face, {.min_frames = 3, .max_gap = 2})) {
        result += is_false ? 'x' : '.';
    }
    return result;
}

TEST(ShortRuns, AreFalseAlarmsUnlessALongRunIsNear)
{
    EXPECT_EQ(false_alarms(".xx....."), ".xx.....");
    EXPECT_EQ(false_alarms(".xxx...."), "........");
    EXPECT_EQ(false_alarms("xxx..xx."), "........");
    EXPECT_EQ(false_alarms("xxx...xx"), "......xx");
    EXPECT_EQ(false_alarms("x..xxx.x"), "........");
    EXPECT_EQ(false_alarms("x...xxxx"), "x.......");
}

TEST(ShortRuns, OfAShortVideoAreBelievedIfTheyFillIt)
{
    EXPECT_EQ(false_alarms("xx"), "..");
    EXPECT_EQ(false_alarms("x."), "x.");
    EXPECT_EQ(false_alarms(""), "");
}

} // namespace
} // namespace lineament
