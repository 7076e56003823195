// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_FIT_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_FIT_IMPL_HPP

#include "lineament/fit/frame_fit_impl.hpp"
#include "lineament/fit/pair_moments_impl.hpp"
#include "lineament/fit/pose_support_impl.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament::detail {

/// Below this share of its diagonal a pivot is taken for rounding, and the system is left to double precision.
inline constexpr float least_pivot = 1e-5f;

/// One fit of RealtimeFitter. Its steps are those of FaceFitter::fit and FrameFit, on the packed model; image points
/// are relative to the principal point throughout. docs/realtime.md
class RealtimeFit
{
public:
    RealtimeFit(const RealtimeFitter& fitter, const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                RealtimeWorkspace& workspace, const FrozenIdentity* frozen)
        : fitter_(fitter), pack_(fitter.pack_), kernels_(*fitter.kernels_), landmarks_(landmarks),
          workspace_(workspace), work_(workspace.buffers_), frozen_(frozen)
    {
        camera_.principal_point_px = principal_point_px;
    }

    /// False: FaceFitter must do it (it also says what is wrong with the input); then `result` is untouched.
    [[nodiscard]] bool fit(const FitResult* start, FitResult& result);

private:
    [[nodiscard]] bool read_landmarks();
    [[nodiscard]] bool read_start(const FitResult* start);
    [[nodiscard]] const NeutralShape& neutral() const { return frozen_ ? frozen_->neutral_ : work_.neutral; }

    void update_rows();
    void evaluate(const PointPanels& panels, const AlignedBuffer<float>& frozen_neutral, AlignedBuffer<float>& neutral,
                  AlignedBuffer<float>& out);
    void update_fixed_neutral();
    void update_positions();
    void update_matches_neutral();

    void match_contour();
    void match_candidates(FaceSide side);
    void match_silhouette(FaceSide side);
    void find_silhouette(const ContourRegion& region);
    void drop_hidden(int step);
    [[nodiscard]] float update_occluders();
    void find_near_triangles(float moved_mm, const SilhouetteExtent& extent);
    void add_match(const OutlineLandmark& landmark, int row);

    void set_scale();
    [[nodiscard]] bool estimate_pose();
    [[nodiscard]] bool estimate_pose_closed_form(const double* moments);
    void update_jacobian();
    void turn_by_depth();
    void update_residuals();
    void add_normal_matrix(const AlignedBuffer<float>& grams, const PointRows& fixed_rows, int width,
                           const AlignedBuffer<float>& contour_rows, AlignedBuffer<float>& gram);
    void add_right_side(const AlignedBuffer<float>& fixed_rows, int width);
    void fit_identity();
    void fit_expression();
    [[nodiscard]] bool solve_expression();
    void fit_expression_in_double();
    void fit_identity_in_double();

    /// The points of this round as the double precision solvers take them.
    struct Reference
    {
        ModelPoints points;
        Eigen::Matrix2Xd image_points;
        Eigen::VectorXd weights;
    };
    [[nodiscard]] Reference reference_points() const;
    [[nodiscard]] double fixed_weight(int f) const
    {
        return scale_factor_ * pack_.fixed_information[f] * work_.fixed_confidence[f];
    }

    void write(FitResult& result, int iterations);

    const RealtimeFitter& fitter_;
    const RealtimePack& pack_;
    const kernels::Kernels& kernels_;
    const LandmarkSet& landmarks_;
    RealtimeWorkspace& workspace_;
    RealtimeBuffers& work_;
    const FrozenIdentity* frozen_;

    bool has_outline_ = false;
    bool is_nominal_ = true; ///< Every fixed point seen with confidence 1: the Gram matrices hold.
    bool has_scale_ = false;
    double scale_factor_ = 1; ///< Weight of a point: this times its information.
    int num_fixed_seen_ = 0;
    bool has_depth_ = false; ///< Of any fixed point.
    ContourView view_ = ContourView::frontal;
    Camera camera_ = {};
    float jacobian_[6] = {}; ///< s R_2.
    FitStatus status_ = FitStatus::success;
    std::string reason_ = {};
    FitStatus identity_status_ = FitStatus::success;
    std::string identity_reason_ = {};
    int num_held_ = 0;
    int num_near_triangles_ = 0;
};

inline bool RealtimeFit::read_landmarks()
{
    const FaceFitter& reference = fitter_.reference_;
    if (!camera_.principal_point_px.allFinite() || landmarks_.scheme != reference.scheme()) {
        return false;
    }
    std::fill(work_.landmark_of_fixed.begin(), work_.landmark_of_fixed.end(), -1);
    std::fill(work_.fixed_confidence.begin(), work_.fixed_confidence.end(), 0.0);
    std::fill(work_.fixed_u.begin(), work_.fixed_u.end(), 0.0);
    std::fill(work_.fixed_v.begin(), work_.fixed_v.end(), 0.0);
    work_.map_indices.clear();
    work_.outline[0].clear();
    work_.outline[1].clear();
    const LandmarkMap& map = reference.landmark_map();
    for (std::size_t l = 0; l < landmarks_.landmarks.size(); ++l) {
        const Landmark& landmark = landmarks_.landmarks[l];
        if (!landmark.point_px.allFinite() || !std::isfinite(landmark.depth_px.value_or(0.0)) ||
            !(landmark.confidence >= 0 && landmark.confidence <= 1)) {
            return false;
        }
        const bool is_in_order = l < map.names.size() && map.names[l] == landmark.name;
        const int index = is_in_order ? static_cast<int>(l) : map.index_of(landmark.name);
        work_.map_indices.push_back(index);
        if (landmark.confidence == 0) {
            continue;
        }
        if (index < 0) {
            if (pack_.has_contour && outline_side(landmark.name)) {
                return false; // an outline landmark that this map does not name
            }
            continue;
        }
        const MapEntry& entry = pack_.map[index];
        const Eigen::Vector2d point = landmark.point_px - camera_.principal_point_px;
        if (entry.fixed_index >= 0) {
            if (work_.landmark_of_fixed[entry.fixed_index] >= 0) {
                return false; // seen twice
            }
            work_.landmark_of_fixed[entry.fixed_index] = static_cast<int>(l);
            work_.fixed_u[entry.fixed_index] = point.x();
            work_.fixed_v[entry.fixed_index] = point.y();
            work_.fixed_depth_px[entry.fixed_index] = landmark.depth_px;
            has_depth_ = has_depth_ || landmark.depth_px;
            work_.fixed_confidence[entry.fixed_index] = landmark.confidence;
            is_nominal_ = is_nominal_ && landmark.confidence == 1;
            ++num_fixed_seen_;
        } else if (entry.is_outline && pack_.has_contour) {
            std::vector<OutlineLandmark>& outline = work_.outline[static_cast<int>(entry.side)];
            if (outline.size() == 8) {
                return false;
            }
            outline.push_back({static_cast<int>(l), point.x(), point.y(), landmark.confidence});
            has_outline_ = has_outline_ || entry.is_measured;
        }
    }
    is_nominal_ = is_nominal_ && num_fixed_seen_ == pack_.fixed.num_points;
    return true;
}

inline bool RealtimeFit::read_start(const FitResult* start)
{
    if (frozen_ != nullptr) {
        std::copy_n(frozen_->shape_coefficients_.data(), pack_.num_shape, work_.alpha.begin());
    } else if (start == nullptr) {
        std::fill(work_.alpha.begin(), work_.alpha.end(), 0.0);
    } else {
        if (start->shape_coefficients.size() != pack_.num_shape || !start->shape_coefficients.allFinite()) {
            return false;
        }
        std::copy_n(start->shape_coefficients.data(), pack_.num_shape, work_.alpha.begin());
    }
    if (start == nullptr) {
        std::fill(work_.psi.begin(), work_.psi.end(), 0.0);
        return true;
    }
    if (start->expression_coefficients.size() != pack_.num_expressions || !start->expression_coefficients.allFinite()) {
        return false;
    }
    std::copy_n(start->expression_coefficients.data(), pack_.num_expressions, work_.psi.begin());
    return true;
}

inline bool RealtimeFit::fit(const FitResult* start, FitResult& result)
{
    if (!read_landmarks() || !read_start(start) || num_fixed_seen_ < 4) {
        return false;
    }
    const FitOptions& options = fitter_.reference_.options();
    std::fill(work_.bound_state.begin(), work_.bound_state.end(), static_cast<signed char>(-1));
    for (int j = 0; j < pack_.num_expressions; ++j) {
        work_.bound_state[j] = work_.psi[j] > 0 ? 0 : -1;
    }
    work_.matches.clear();
    work_.match_rows.clear();
    update_rows();
    update_fixed_neutral();
    update_positions();
    if (!estimate_pose()) {
        return false;
    }
    if (start == nullptr || frozen_ != nullptr) {
        fit_expression();
    }
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
        match_contour();
        if (!estimate_pose()) {
            return false;
        }
        if (frozen_ == nullptr) {
            fit_identity();
        }
        fit_expression();
    }
    if (identity_status_ == FitStatus::degenerate) {
        return false;
    }
    turn_by_depth();
    write(result, options.iterations);
    return true;
}

// The shape

inline void RealtimeFit::update_rows()
{
    for (int j = 0; j < pack_.num_shape; ++j) {
        work_.alpha_row[j] = static_cast<float>(work_.alpha[j]);
    }
    for (int j = 0; j < pack_.num_expressions; ++j) {
        work_.psi_row[j] = static_cast<float>(work_.psi[j]);
    }
}

inline void RealtimeFit::update_fixed_neutral()
{
    if (frozen_ == nullptr) {
        kernels_.combine_panels(pack_.fixed.mean.data(), pack_.fixed.identity.data(), pack_.fixed.num_panels,
                                pack_.num_shape, work_.alpha_row.data(), work_.neutral.fixed.data());
    }
}

/// S(a, psi) of panels whose neutral part is known only if the identity is frozen.
inline void RealtimeFit::evaluate(const PointPanels& panels, const AlignedBuffer<float>& frozen_neutral,
                                  AlignedBuffer<float>& neutral, AlignedBuffer<float>& out)
{
    if (frozen_ == nullptr) {
        kernels_.combine_panels(panels.mean.data(), panels.identity.data(), panels.num_panels, pack_.num_shape,
                                work_.alpha_row.data(), neutral.data());
    }
    kernels_.combine_panels(frozen_ ? frozen_neutral.data() : neutral.data(), panels.expression.data(),
                            panels.num_panels, pack_.num_expressions, work_.psi_row.data(), out.data());
}

inline void RealtimeFit::update_matches_neutral()
{
    const int count = static_cast<int>(work_.matches.size());
    if (frozen_ != nullptr) {
        for (int i = 0; i < count; ++i) {
            std::copy_n(frozen_->neutral_.contour.data() + 3 * work_.match_rows[i], 3,
                        work_.match_neutral.data() + 3 * i);
        }
        return;
    }
    kernels_.multiply_rows(pack_.contour_rows.identity.data(), pack_.shape_width, work_.match_rows.data(), count,
                           work_.alpha_row.data(), work_.match_neutral.data());
    for (int i = 0; i < count; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
            work_.match_neutral[3 * i + axis] += pack_.contour_rows.mean[3 * work_.match_rows[i] + axis];
        }
    }
}

/// Fixed and matched points with the present expression.
inline void RealtimeFit::update_positions()
{
    kernels_.combine_panels(neutral().fixed.data(), pack_.fixed.expression.data(), pack_.fixed.num_panels,
                            pack_.num_expressions, work_.psi_row.data(), work_.fixed.data());
    const int count = static_cast<int>(work_.matches.size());
    kernels_.multiply_rows(pack_.contour_rows.expression.data(), pack_.expression_width, work_.match_rows.data(), count,
                           work_.psi_row.data(), work_.match_offset.data());
    for (int i = 0; i < 3 * count; ++i) {
        work_.match_positions[i] = work_.match_neutral[i] + work_.match_offset[i];
    }
}

// Pose

inline void RealtimeFit::set_scale()
{
    const double scale = camera_.scale_px_per_mm;
    scale_factor_ = fitter_.reference_.options().noise_units == NoiseUnits::model ? 1 / (scale * scale) : 1;
}

inline bool RealtimeFit::estimate_pose()
{
    const int num_fixed = pack_.fixed.num_points;
    const int count = static_cast<int>(work_.matches.size());
    const int stride = kernels::round_up(num_fixed + count, 8);
    double* x = work_.pose_points.data();
    double* y = x + stride;
    double* z = y + stride;
    double* u = z + stride;
    double* v = u + stride;
    double* w = v + stride;
    for (int i = 0; i < num_fixed; ++i) {
        x[i] = work_.fixed[3 * i];
        y[i] = work_.fixed[3 * i + 1];
        z[i] = work_.fixed[3 * i + 2];
        u[i] = work_.fixed_u[i];
        v[i] = work_.fixed_v[i];
        w[i] = fixed_weight(i);
    }
    for (int i = 0; i < count; ++i) {
        x[num_fixed + i] = work_.match_positions[3 * i];
        y[num_fixed + i] = work_.match_positions[3 * i + 1];
        z[num_fixed + i] = work_.match_positions[3 * i + 2];
        u[num_fixed + i] = work_.matches[i].u;
        v[num_fixed + i] = work_.matches[i].v;
        w[num_fixed + i] = scale_factor_ * work_.matches[i].information;
    }
    for (int i = num_fixed + count; i < stride; ++i) {
        x[i] = y[i] = z[i] = u[i] = v[i] = w[i] = 0;
    }
    double moments[kernels::num_pose_moments];
    kernels_.pose_moments(work_.pose_points.data(), stride, moments);
    if (!estimate_pose_closed_form(moments)) {
        const Reference reference = reference_points();
        const PoseResult pose = lineament::estimate_pose(
            reference.points.at(Eigen::Map<const Eigen::VectorXd>(work_.alpha.data(), pack_.num_shape),
                                Eigen::Map<const Eigen::VectorXd>(work_.psi.data(), pack_.num_expressions)),
            reference.image_points, reference.weights, camera_.principal_point_px);
        ++workspace_.num_reference_solves_;
        if (pose.status != FitStatus::success) {
            return false;
        }
        camera_ = pose.camera;
    }
    update_jacobian();
    if (!has_scale_) {
        has_scale_ = true;
        set_scale();
    }
    return true;
}

inline void RealtimeFit::update_jacobian()
{
    for (int row = 0; row < 2; ++row) {
        for (int column = 0; column < 3; ++column) {
            jacobian_[3 * row + column] =
                static_cast<float>(camera_.scale_px_per_mm * camera_.camera_from_model(row, column));
        }
    }
}

/// As FrameFit::turn_by_depth.
inline void RealtimeFit::turn_by_depth()
{
    if (!has_depth_) {
        return;
    }
    PairMoments all, with_depth;
    int num_with_depth = 0;
    for (int i = 0; i < pack_.fixed.num_points; ++i) {
        const double weight = fixed_weight(i);
        if (weight > 0) {
            const Eigen::Vector3d point = Eigen::Map<const Eigen::Vector3f>(work_.fixed.data() + 3 * i).cast<double>();
            const std::optional<double>& depth_px = work_.fixed_depth_px[i];
            const Eigen::Vector3d seen(work_.fixed_u[i], work_.fixed_v[i], depth_px.value_or(0.0));
            all.add(weight, point, seen);
            if (depth_px) {
                with_depth.add(weight, point, seen);
                ++num_with_depth;
            }
        }
    }
    for (std::size_t i = 0; i < work_.matches.size(); ++i) {
        const RealtimeMatch& match = work_.matches[i];
        all.add(scale_factor_ * match.information,
                Eigen::Map<const Eigen::Vector3f>(work_.match_positions.data() + 3 * i).cast<double>(),
                {match.u, match.v, 0.0});
    }
    // Image points are relative to the principal point here.
    Camera camera = camera_;
    camera.principal_point_px.setZero();
    if (turn_camera_by_depth(all, with_depth, num_with_depth, camera)) {
        camera.principal_point_px = camera_.principal_point_px;
        camera_ = camera;
        update_jacobian();
        fit_expression();
    }
}

/// lineament::estimate_pose from sums; false where it would not be clearly a success.
inline bool RealtimeFit::estimate_pose_closed_form(const double* moments)
{
    const double inverse = 1 / moments[0];
    const double mx = moments[1] * inverse, my = moments[2] * inverse, mz = moments[3] * inverse;
    const double mu = moments[4] * inverse, mv = moments[5] * inverse;
    const double xx = moments[6] * inverse - mx * mx, xy = moments[7] * inverse - mx * my;
    const double xz = moments[8] * inverse - mx * mz, yy = moments[9] * inverse - my * my;
    const double yz = moments[10] * inverse - my * mz, zz = moments[11] * inverse - mz * mz;
    const double ux = moments[12] * inverse - mu * mx, uy = moments[13] * inverse - mu * my;
    const double uz = moments[14] * inverse - mu * mz, vx = moments[15] * inverse - mv * mx;
    const double vy = moments[16] * inverse - mv * my, vz = moments[17] * inverse - mv * mz;

    const double cxx = yy * zz - yz * yz, cxy = xz * yz - xy * zz, cxz = xy * yz - xz * yy; // cofactors
    const double cyy = xx * zz - xz * xz, cyz = xy * xz - xx * yz, czz = xx * yy - xy * xy;
    const double determinant = xx * cxx + xy * cxy + xz * cxz;
    const double trace = xx + yy + zz;
    // The least variance is at least 4 det / trace^2, the largest at most the trace.
    if (!(4 * determinant > 2e-4 * trace * trace * trace)) {
        return false;
    }
    const double d = 1 / determinant;
    double r1[3] = {d * (ux * cxx + uy * cxy + uz * cxz), d * (ux * cxy + uy * cyy + uz * cyz),
                    d * (ux * cxz + uy * cyz + uz * czz)};
    double r2[3] = {d * (vx * cxx + vy * cxy + vz * cxz), d * (vx * cxy + vy * cyy + vz * cyz),
                    d * (vx * cxz + vy * cyz + vz * czz)};
    const double n1 = std::sqrt(r1[0] * r1[0] + r1[1] * r1[1] + r1[2] * r1[2]);
    const double n2 = std::sqrt(r2[0] * r2[0] + r2[1] * r2[1] + r2[2] * r2[2]);
    const double least = std::min(n1, n2);
    if (!(least * std::sqrt(trace) > 1e-6) || !(least > 0.01 * std::max(n1, n2))) {
        return false;
    }
    const double cosine = (r1[0] * r2[0] + r1[1] * r2[1] + r1[2] * r2[2]) / (n1 * n2);
    if (!(std::abs(cosine) < 0.999)) {
        return false;
    }
    const double plus = 0.5 / std::sqrt(1 + cosine), minus = 0.5 / std::sqrt(1 - cosine);
    const double same = plus + minus, cross = plus - minus;
    for (int a = 0; a < 3; ++a) {
        const double first = r1[a] / n1, second = r2[a] / n2;
        r1[a] = same * first + cross * second;
        r2[a] = cross * first + same * second;
    }
    const double r3z = r1[0] * r2[1] - r1[1] * r2[0];
    const double correlation = r1[0] * ux + r1[1] * uy + r1[2] * uz + r2[0] * vx + r2[1] * vy + r2[2] * vz;
    const auto variance_along = [&](const double* r) {
        return r[0] * (r[0] * xx + 2 * r[1] * xy + 2 * r[2] * xz) + r[1] * (r[1] * yy + 2 * r[2] * yz) +
               r[2] * r[2] * zz;
    };
    const double scale = correlation / (variance_along(r1) + variance_along(r2));
    if (!(scale > 1e-9) || -r3z < min_facing_cosine + 1e-6) {
        return false;
    }
    for (int a = 0; a < 3; ++a) {
        camera_.camera_from_model(0, a) = r1[a];
        camera_.camera_from_model(1, a) = r2[a];
    }
    camera_.camera_from_model(2, 0) = r1[1] * r2[2] - r1[2] * r2[1];
    camera_.camera_from_model(2, 1) = r1[2] * r2[0] - r1[0] * r2[2];
    camera_.camera_from_model(2, 2) = r3z;
    camera_.scale_px_per_mm = scale;
    camera_.translation_mm.x() = mu / scale - (r1[0] * mx + r1[1] * my + r1[2] * mz);
    camera_.translation_mm.y() = mv / scale - (r2[0] * mx + r2[1] * my + r2[2] * mz);
    return true;
}

} // namespace lineament::detail

#include "lineament/fit/realtime_contour_impl.hpp"
#include "lineament/fit/realtime_result_impl.hpp"
#include "lineament/fit/realtime_solve_impl.hpp"

#endif
