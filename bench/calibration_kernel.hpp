// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace lineament::bench {

/// Multiply-adds over 4 MB: what other times are divided by, to be compared between machines.
class CalibrationKernel
{
public:
    /// The sum of 2^20 squares. Each run needs the one before, so none is left out if the last answer is used.
    float run()
    {
        values_[0] = 1e-30f * sum_;
        return sum_ = values_.squaredNorm();
    }

private:
    Eigen::VectorXf values_ = Eigen::VectorXf::LinSpaced(1 << 20, 0.0f, 1.0f);
    float sum_ = 0;
};

} // namespace lineament::bench
