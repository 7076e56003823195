// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// lineament::fit_frames on RealtimeFit: the images take their steps in turn, and leave sums of what they say of the
// identity.                                                                                           docs/realtime.md
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_FRAMES_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_FRAMES_IMPL_HPP

#include "lineament/fit/realtime_fit_impl.hpp"
#include "lineament/fit/realtime_pack_impl.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace lineament::detail {

inline void clear(IdentitySums& sums)
{
    sums.grams.fill(0.0);
    std::fill_n(sums.fixed_right_side.data(), sums.fixed_right_side.size(), 0.0);
    if (sums.has_fixed_information) {
        std::fill(sums.fixed_information.begin(), sums.fixed_information.end(), 0.0);
        sums.has_fixed_information = false;
    }
    for (const int row : sums.touched) {
        std::fill_n(sums.contour_information.begin() + 6 * row, 6, 0.0);
        std::fill_n(sums.contour_right_side.begin() + 3 * row, 3, 0.0);
        sums.is_touched[row] = 0;
    }
    sums.touched.clear();
}

inline void RealtimeFit::add_to(IdentitySums& sums)
{
    update_factors();
    using Information = Eigen::Array<double, 6, 1>;
    const std::array<double, 6> factors = gram_factors();
    const Information nominal = Eigen::Map<const Information>(factors.data());
    if (frame_.is_nominal) {
        Eigen::Map<Information>(sums.grams.data()) += nominal;
    } else {
        sums.has_fixed_information = true;
        for (int i = 0; i < pack_.fixed.num_points; ++i) {
            Eigen::Map<Information>(&sums.fixed_information[6 * i]) += frame_.information[i] * nominal;
        }
    }
    const double one = 1;
    kernels_.add_wide(work_.factors.data(), 1, 3 * pack_.first_match, &one, sums.fixed_right_side.data());
    const float* match_factors = work_.factors.data() + 3 * pack_.first_match;
    const double* information = frame_.information.data() + pack_.first_match;
    for (int i = 0; i < num_matches(); ++i) {
        const int row = frame_.match_rows[i];
        if (!sums.is_touched[row]) {
            sums.is_touched[row] = 1;
            sums.touched.push_back(row);
        }
        Eigen::Map<Information>(&sums.contour_information[6 * row]) += information[i] * nominal;
        Eigen::Map<Eigen::Array3d>(&sums.contour_right_side[3 * row]) +=
            Eigen::Map<const Eigen::Array3f>(match_factors + 3 * i).cast<double>();
    }
}

/// Three rows whose products with each other are the 3 x 3 matrix (xx yy zz xy xz yz): its upper Cholesky factor, with
/// zero rows where it has no rank.
[[nodiscard]] inline std::array<float, 9> root_of(const double* information)
{
    const double xx = information[0], yy = information[1], zz = information[2];
    const double xy = information[3], xz = information[4], yz = information[5];
    const double least = 1e-12 * (xx + yy + zz);
    std::array<float, 9> root = {};
    double x = 0, a = 0, b = 0;
    if (xx > least) {
        x = std::sqrt(xx);
        a = xy / x;
        b = xz / x;
    }
    double y = 0, c = 0;
    if (yy - a * a > least) {
        y = std::sqrt(yy - a * a);
        c = (yz - a * b) / y;
    }
    const double z = std::sqrt(std::max(zz - b * b - c * c, 0.0));
    root[0] = static_cast<float>(x);
    root[1] = static_cast<float>(a);
    root[2] = static_cast<float>(b);
    root[4] = static_cast<float>(y);
    root[5] = static_cast<float>(c);
    root[8] = static_cast<float>(z);
    return root;
}

/// One identity of several images by the steps of lineament::fit_frames.
class RealtimeFramesFit
{
public:
    RealtimeFramesFit(const RealtimeFitter& fitter, std::span<const LandmarkSet> frames, RealtimeWorkspace& workspace)
        : fitter_(fitter), pack_(fitter.pack_), kernels_(*fitter.kernels_), frames_(frames), workspace_(workspace),
          work_(workspace.buffers_)
    {}

    /// False: the reference must do it; then `result` is untouched.
    [[nodiscard]] bool fit(const Eigen::Vector2d& principal_point_px, PriorCount prior_count, MultiFrameResult& result);

private:
    [[nodiscard]] RealtimeFit frame(std::size_t f)
    {
        return {fitter_, frames_[f], workspace_, static_cast<int>(f), nullptr};
    }
    void add_rows_of(const PointRows& rows, int index, const double* information);
    void flush_rows();
    [[nodiscard]] bool solve_identity(double regularization);

    const RealtimeFitter& fitter_;
    const RealtimePack& pack_;
    const kernels::Kernels& kernels_;
    std::span<const LandmarkSet> frames_;
    RealtimeWorkspace& workspace_;
    RealtimeBuffers& work_;
    static constexpr int max_rows = 64; ///< That work_.rows surely holds.
    int num_rows_ = 0;                  ///< In work_.rows.
};

inline bool RealtimeFramesFit::fit(const Eigen::Vector2d& principal_point_px, PriorCount prior_count,
                                   MultiFrameResult& result)
{
    if (frames_.empty()) {
        return false;
    }
    while (work_.frames.size() < frames_.size()) {
        work_.frames.push_back(make_frame(pack_));
    }
    const FitOptions& options = fitter_.reference_.options();
    const double num_priors = prior_count == PriorCount::per_frame ? static_cast<double>(frames_.size()) : 1.0;
    std::fill(work_.alpha.begin(), work_.alpha.end(), 0.0);
    frame(0).take_identity();
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
        clear(work_.sums);
        for (std::size_t f = 0; f < frames_.size(); ++f) {
            RealtimeFit fit = frame(f);
            if (iteration > 0) {
                fit.resume();
            } else if (!fit.begin(principal_point_px, nullptr)) {
                return false;
            }
            fit.fit_expression();
            if (!fit.match_and_estimate_pose()) {
                return false;
            }
            fit.add_to(work_.sums);
        }
        if (!solve_identity(num_priors * options.regularization)) {
            return false;
        }
        frame(0).take_identity();
    }
    result.frames.resize(frames_.size());
    for (std::size_t f = 0; f < frames_.size(); ++f) {
        RealtimeFit fit = frame(f);
        fit.resume();
        fit.fit_expression();
        fit.finish(result.frames[f], options.iterations);
        result.frames[f].timing = {};
    }
    result.status = FitStatus::success;
    result.reason.clear();
    result.num_used_frames = static_cast<int>(frames_.size());
    result.shape_coefficients = Eigen::Map<const Eigen::VectorXd>(work_.alpha.data(), pack_.num_shape);
    return true;
}

/// Adds information of a point to the normal matrix, by way of work_.rows.
inline void RealtimeFramesFit::add_rows_of(const PointRows& rows, int index, const double* information)
{
    if (num_rows_ + 4 > max_rows) {
        flush_rows();
    }
    const std::array<float, 9> root = root_of(information);
    const std::array<float, 6> last = {0, 0, root[8], 0, 0, 0}; // its second row is written over
    const float one = 1;
    float* out = work_.rows.data() + static_cast<std::ptrdiff_t>(num_rows_) * pack_.shape_width;
    kernels_.project_rows(rows.identity.data(), pack_.shape_width, &index, 1, root.data(), &one, out);
    kernels_.project_rows(rows.identity.data(), pack_.shape_width, &index, 1, last.data(), &one,
                          out + 2 * pack_.shape_width);
    num_rows_ += 3;
}

inline void RealtimeFramesFit::flush_rows()
{
    kernels_.add_gram(work_.rows.data(), num_rows_, 0, pack_.shape_width, pack_.shape_width, work_.system.data());
    num_rows_ = 0;
}

/// One step of all images' normal equations from the present identity; false where the reference must take it.
inline bool RealtimeFramesFit::solve_identity(double regularization)
{
    const IdentitySums& sums = work_.sums;
    const int width = pack_.shape_width;
    float scales[6];
    std::copy(sums.grams.begin(), sums.grams.end(), scales);
    kernels_.combine_grams(pack_.identity_grams.data(), width, width, scales, work_.system.data());
    for (int i = 0; i < pack_.fixed.num_points && sums.has_fixed_information; ++i) {
        add_rows_of(pack_.fixed_rows, i, &sums.fixed_information[6 * i]);
    }
    for (int i = 0; i < 3 * pack_.fixed.num_points; ++i) {
        work_.factors[i] = static_cast<float>(sums.fixed_right_side[i]);
    }
    float* right_side = work_.right_side.data();
    std::fill_n(right_side, width, 0.0f);
    kernels_.add_rows(pack_.fixed_rows.identity.data(), 3 * pack_.fixed.num_points, width, work_.factors.data(),
                      right_side);
    for (const int row : sums.touched) {
        add_rows_of(pack_.contour_rows, row, &sums.contour_information[6 * row]);
        float factors[3];
        std::copy_n(&sums.contour_right_side[3 * row], 3, factors);
        kernels_.add_point_rows(pack_.contour_rows.identity.data(), width, &row, 1, factors, right_side);
    }
    flush_rows();
    return pack_.num_shape == 0 || step_identity(kernels_, pack_, regularization, work_);
}

} // namespace lineament::detail

#endif
