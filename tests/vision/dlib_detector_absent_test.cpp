// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/vision/dlib_detector.hpp"

#include "lineament/core/error.hpp"
#include "support/matchers.hpp"

namespace lineament {
namespace {

TEST(DlibDetectorAbsent, SaysThatItIsNotThereAndWhatToUseInstead)
{
    EXPECT_TRUE(test::throws<IoError>([] { DlibDetector(); }, "LINEAMENT_WITH_DLIB", "MeshDetector"));
}

} // namespace
} // namespace lineament
