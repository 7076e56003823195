// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/fit/realtime_fitter.hpp" // before the guard: it includes this file where it is needed

#ifndef LINEAMENT_FIT_REALTIME_FIT_IMPL_HPP
#define LINEAMENT_FIT_REALTIME_FIT_IMPL_HPP

#include "lineament/fit/frame_fit_impl.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace lineament::detail {

/// Below this share of its diagonal a pivot is taken for rounding, and the system is left to double precision.
inline constexpr float least_pivot = 1e-5f;

/// One fit of RealtimeFitter. Its steps are those of FaceFitter::fit and FrameFit, on the packed model; image points
/// are relative to the principal point throughout. docs/realtime.md
class RealtimeFit
{
public:
    /// @param frame  Of the workspace; holds what an earlier RealtimeFit of these landmarks left in it.
    RealtimeFit(const RealtimeFitter& fitter, const LandmarkSet& landmarks, RealtimeWorkspace& workspace, int frame,
                const FrozenIdentity* frozen)
        : fitter_(fitter), pack_(fitter.pack_), kernels_(*fitter.kernels_), landmarks_(landmarks),
          workspace_(workspace), work_(workspace.buffers_), frame_(work_.frames[frame]), frozen_(frozen)
    {}

    /// False: FaceFitter must do it (it also says what is wrong with the input); then `result` is untouched.
    [[nodiscard]] bool fit(const Eigen::Vector2d& principal_point_px, const FitResult* start, FitResult& result);

    // The parts of a fit. Of several images of one person each takes them in turn, at the identity in the workspace.

    /// Reads the landmarks and finds the first pose, from psi of the start.
    [[nodiscard]] bool begin(const Eigen::Vector2d& principal_point_px, const FitResult* start);
    /// Takes up the identity in the workspace; of several images once is enough.
    void take_identity();
    /// Takes up the frame again after the identity has changed.
    void resume();
    [[nodiscard]] bool match_and_estimate_pose();
    void add_to(IdentitySums& sums);
    void fit_expression();
    void finish(FitResult& result, int iterations);

private:
    void turn_by_depth();
    void write(FitResult& result, int iterations);
    void write_names(FitResult& result) const;
    void write_landmarks(FitResult& result);
    [[nodiscard]] std::array<int, 2 * OutlineLandmarks::max_count + 1> shown_matches() const;
    void write_other_landmarks(FitResult& result);
    [[nodiscard]] bool read_landmarks();
    [[nodiscard]] bool read_places();
    [[nodiscard]] bool read_expressions(const FitResult* start);
    [[nodiscard]] bool read_identity(const FitResult* start);

    void update_expression_row();
    [[nodiscard]] const float* neutral(PointSet set);
    void evaluate(PointSet set, AlignedBuffer<float>& out);
    void update_fixed_positions();
    void update_match_positions();
    void evaluate_candidates();
    void update_silhouette_neutral();

    void match_contour();
    void project(const float* points, int count, AlignedBuffer<double>& u, AlignedBuffer<double>& v) const;
    [[nodiscard]] std::pair<int, double> nearest_projected(int count, double u, double v);
    void match_candidates(FaceSide side);
    void match_silhouette(FaceSide side);
    void find_silhouette(const ContourRegion& region);
    void see_occluders();
    [[nodiscard]] bool is_hidden(float x, float y, float depth) const;
    void add_match(const OutlineLandmarks& outline, int landmark, int row);
    void add_candidate_matches(const OutlineLandmarks& outline, const ContourRegion& region, const int* nearest);
    void clear_matches();

    void set_scale();
    [[nodiscard]] bool estimate_pose();
    [[nodiscard]] bool estimate_pose_closed_form(const double* moments);
    void update_jacobian();
    [[nodiscard]] std::array<double, 8> image_from_model() const;
    void update_factors();
    [[nodiscard]] std::array<double, 6> gram_factors() const;
    void add_normal_matrix(const AlignedBuffer<float>& grams, const PointRows& fixed_rows, int num_columns, int width,
                           const AlignedBuffer<float>& contour_rows, AlignedBuffer<float>& gram);
    void fit_identity();
    void assemble_expressions();
    [[nodiscard]] bool step_free_expressions();
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
    [[nodiscard]] int num_matches() const { return frame_.num_matches; }
    /// Of points: fixed ones, and matches from pack_.first_match on.
    [[nodiscard]] int num_points() const { return pack_.first_match + num_matches(); }
    [[nodiscard]] double weight(int point) const { return frame_.scale_factor * frame_.information[point]; }

    const RealtimeFitter& fitter_;
    const RealtimePack& pack_;
    const kernels::Kernels& kernels_;
    const LandmarkSet& landmarks_;
    RealtimeWorkspace& workspace_;
    RealtimeBuffers& work_;
    RealtimeFrame& frame_;
    const FrozenIdentity* frozen_;
    bool are_candidates_known_ = false; ///< With the present identity and expression.

    FitStatus identity_status_ = FitStatus::success;
    std::string identity_reason_ = {};
};

/// A name of up to three characters in one number; 0: it is longer, or empty. Names end with a null, so that there are
/// two characters to read at the beginning and from the last one on.
[[nodiscard]] inline std::uint64_t name_key(const std::string& name)
{
    const std::size_t size = name.size();
    if (size == 0 || size > 3) {
        return 0;
    }
    std::uint16_t first = 0, last = 0;
    std::memcpy(&first, name.data(), 2);
    std::memcpy(&last, name.data() + size - 1, 2);
    return static_cast<std::uint64_t>(size) << 32 | static_cast<std::uint64_t>(first) << 16 | last;
}

/// @param key  Of `expected`.
[[nodiscard]] inline bool is_same_name(const std::string& name, std::uint64_t key, const std::string& expected)
{
    return key != 0 ? name_key(name) == key : name == expected;
}

/// After plain landmarks, plain ones again: only their places are new. False for others, which must be read as
/// a whole.
inline bool RealtimeFit::read_places()
{
    const std::vector<Landmark>& landmarks = landmarks_.landmarks;
    const std::vector<std::string>& names = fitter_.reference_.landmark_map().names;
    if (!frame_.is_plain || landmarks.size() != names.size()) {
        return false;
    }
    const std::string* const expected = names.data();
    const int* const slots = frame_.slots.data();
    const std::uint64_t* const keys = frame_.name_keys.data();
    double* const seen_u = frame_.seen_u.data();
    double* const seen_v = frame_.seen_v.data();
    const Eigen::Vector2d principal_point_px = frame_.camera.principal_point_px;
    for (std::size_t l = 0; l < names.size(); ++l) {
        const Landmark& landmark = landmarks[l];
        if (!is_same_name(landmark.name, keys[l], expected[l]) || landmark.confidence != 1 || landmark.depth_px ||
            !(std::abs(landmark.point_px.x()) <= max_coordinate_px) ||
            !(std::abs(landmark.point_px.y()) <= max_coordinate_px)) {
            return false;
        }
        const Eigen::Vector2d point = landmark.point_px - principal_point_px;
        seen_u[slots[l]] = point.x();
        seen_v[slots[l]] = point.y();
    }
    return true;
}

inline bool RealtimeFit::read_landmarks()
{
    const FaceFitter& reference = fitter_.reference_;
    const Eigen::Vector2d principal_point_px = frame_.camera.principal_point_px;
    if (!principal_point_px.allFinite() || landmarks_.scheme != reference.scheme()) {
        return false;
    }
    if (read_places()) {
        return true;
    }
    const LandmarkMap& map = reference.landmark_map();
    const std::size_t num_names = map.names.size();
    const std::size_t count = landmarks_.landmarks.size();
    int num_fixed_seen = 0;
    bool is_plain = count == num_names;
    bool is_certain = true;
    frame_.is_plain = false;
    frame_.has_outline = false;
    frame_.has_depth = false;
    std::fill(frame_.landmark_of_fixed.begin(), frame_.landmark_of_fixed.end(), -1);
    std::fill_n(frame_.information.data(), pack_.fixed.num_points, 0.0);
    std::fill_n(frame_.seen_u.data(), pack_.fixed.num_points, 0.0); // of those not seen nothing stays of fits before
    std::fill_n(frame_.seen_v.data(), pack_.fixed.num_points, 0.0);
    frame_.map_indices.resize(count);
    frame_.name_keys.resize(count);
    frame_.slots.assign(count, frame_.spare_slot);
    frame_.outline[0].count = 0;
    frame_.outline[1].count = 0;
    for (std::size_t l = 0; l < count; ++l) {
        const Landmark& landmark = landmarks_.landmarks[l];
        const double confidence = landmark.confidence;
        const Eigen::Vector2d point = landmark.point_px - principal_point_px;
        if (!(std::abs(landmark.point_px.x()) <= max_coordinate_px) ||
            !(std::abs(landmark.point_px.y()) <= max_coordinate_px) || !(confidence >= 0 && confidence <= 1) ||
            (landmark.depth_px && !(std::abs(*landmark.depth_px) <= max_coordinate_px))) {
            return false;
        }
        frame_.name_keys[l] = name_key(landmark.name);
        const bool is_in_order = l < num_names && is_same_name(map.names[l], frame_.name_keys[l], landmark.name);
        const int index = is_in_order ? static_cast<int>(l) : map.index_of(landmark.name);
        frame_.map_indices[l] = index;
        is_plain = is_plain && is_in_order && confidence == 1 && !landmark.depth_px;
        if (confidence < least_confidence) {
            continue;
        }
        if (index < 0) {
            if (pack_.has_contour && outline_side(landmarks_.scheme, landmark.name)) {
                return false; // an outline landmark that this map does not name
            }
            continue;
        }
        const MapEntry& entry = pack_.map[index];
        if (entry.fixed_index >= 0) {
            const int f = entry.fixed_index;
            if (frame_.landmark_of_fixed[f] >= 0) {
                return false; // seen twice
            }
            frame_.landmark_of_fixed[f] = static_cast<int>(l);
            frame_.slots[l] = f;
            frame_.seen_u[f] = point.x();
            frame_.seen_v[f] = point.y();
            frame_.information[f] = pack_.fixed_information[f] * confidence;
            frame_.has_depth = frame_.has_depth || landmark.depth_px;
            is_certain = is_certain && confidence == 1;
            ++num_fixed_seen;
        } else if (entry.is_outline && pack_.has_contour) {
            OutlineLandmarks& outline = frame_.outline[static_cast<int>(entry.side)];
            if (outline.count == OutlineLandmarks::max_count) {
                return false;
            }
            const int i = outline.count++;
            const double information = confidence * pack_.contour_information;
            outline.landmark_indices[i] = static_cast<int>(l);
            frame_.slots[l] = outline.first_slot + i;
            frame_.seen_u[frame_.slots[l]] = point.x();
            frame_.seen_v[frame_.slots[l]] = point.y();
            frame_.has_depth = frame_.has_depth || landmark.depth_px;
            outline.information[i] = information;
            outline.roots[i] = static_cast<float>(std::sqrt(information));
            frame_.has_outline = frame_.has_outline || entry.is_measured;
        }
    }
    frame_.num_fixed_seen = num_fixed_seen;
    frame_.is_nominal = is_certain && num_fixed_seen == pack_.fixed.num_points;
    frame_.is_plain = is_plain;
    return true;
}

inline bool RealtimeFit::read_identity(const FitResult* start)
{
    if (frozen_ != nullptr) {
        if (!frozen_->is_moderate_) {
            return false;
        }
        std::copy_n(frozen_->shape_coefficients_.data(), pack_.num_shape, work_.alpha.begin());
    } else if (start == nullptr) {
        std::fill(work_.alpha.begin(), work_.alpha.end(), 0.0);
    } else {
        if (start->shape_coefficients.size() != pack_.num_shape || !is_moderate(start->shape_coefficients)) {
            return false;
        }
        std::copy_n(start->shape_coefficients.data(), pack_.num_shape, work_.alpha.begin());
    }
    return true;
}

inline bool RealtimeFit::read_expressions(const FitResult* start)
{
    if (start == nullptr) {
        std::fill(frame_.psi.begin(), frame_.psi.end(), 0.0);
    } else {
        if (start->expression_coefficients.size() != pack_.num_expressions ||
            !is_moderate(start->expression_coefficients)) {
            return false;
        }
        std::copy_n(start->expression_coefficients.data(), pack_.num_expressions, frame_.psi.begin());
    }
    for (int j = 0; j < pack_.num_expressions; ++j) {
        frame_.bound_state[j] = frame_.psi[j] > 0 ? 0 : -1;
    }
    return true;
}

inline bool RealtimeFit::begin(const Eigen::Vector2d& principal_point_px, const FitResult* start)
{
    frame_.camera = {};
    frame_.camera.principal_point_px = principal_point_px;
    frame_.view = start == nullptr ? ContourView::frontal : start->contour_view;
    frame_.has_scale = false;
    frame_.scale_factor = 1;
    frame_.num_held = 0;
    frame_.status = FitStatus::success;
    frame_.reason.clear();
    clear_matches();
    if (!read_landmarks() || !read_expressions(start) || frame_.num_fixed_seen < 4) {
        return false;
    }
    update_expression_row();
    update_fixed_positions();
    return estimate_pose();
}

inline void RealtimeFit::resume()
{
    update_expression_row();
    update_fixed_positions();
    update_match_positions();
}

inline void RealtimeFit::finish(FitResult& result, int iterations)
{
    update_match_positions();
    turn_by_depth();
    write(result, iterations);
}

inline bool RealtimeFit::match_and_estimate_pose()
{
    match_contour();
    return estimate_pose();
}

inline bool RealtimeFit::fit(const Eigen::Vector2d& principal_point_px, const FitResult* start, FitResult& result)
{
    if (!read_identity(start)) {
        return false;
    }
    take_identity();
    if (!begin(principal_point_px, start)) {
        return false;
    }
    const FitOptions& options = fitter_.reference_.options();
    if (start == nullptr) {
        fit_expression();
    }
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
        if (!match_and_estimate_pose()) {
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
    finish(result, options.iterations);
    return true;
}

inline void RealtimeFit::update_expression_row()
{
    are_candidates_known_ = false;
    for (int j = 0; j < pack_.num_expressions; ++j) {
        work_.psi_row[j] = static_cast<float>(frame_.psi[j]);
    }
}

inline void RealtimeFit::take_identity()
{
    are_candidates_known_ = false;
    if (frozen_ != nullptr) {
        return; // its neutral face has been computed
    }
    for (int j = 0; j < pack_.num_shape; ++j) {
        work_.alpha_row[j] = static_cast<float>(work_.alpha[j]);
    }
    NeutralShape& neutral = work_.neutral;
    const float* alpha = work_.alpha_row.data();
    if (!std::equal(alpha, alpha + pack_.num_shape, neutral.alpha_row.data())) {
        std::copy_n(alpha, pack_.num_shape, neutral.alpha_row.data());
        neutral.is_known.fill(false);
        std::fill(neutral.is_row_known.begin(), neutral.is_row_known.end(), static_cast<unsigned char>(0));
    }
}

/// S(a, 0) of the set.
inline const float* RealtimeFit::neutral(PointSet set)
{
    const int index = static_cast<int>(set);
    if (frozen_ != nullptr) {
        return frozen_->neutral_.points[index].data();
    }
    float* points = work_.neutral.points[index].data();
    if (!work_.neutral.is_known[index]) {
        const PointPanels& panels = pack_.panels(set);
        const bool is_mean = std::all_of(work_.alpha.begin(), work_.alpha.end(), [](double a) { return a == 0; });
        kernels_.combine_panels(panels.mean.data(), panels.identity.data(), panels.num_panels,
                                is_mean ? 0 : pack_.num_shape, work_.alpha_row.data(), points);
        work_.neutral.is_known[index] = true;
    }
    return points;
}

/// S(a, psi) of the set.
inline void RealtimeFit::evaluate(PointSet set, AlignedBuffer<float>& out)
{
    const PointPanels& panels = pack_.panels(set);
    kernels_.combine_panels(neutral(set), panels.expression.data(), panels.num_panels, pack_.num_expressions,
                            work_.psi_row.data(), out.data());
}

inline void RealtimeFit::evaluate_candidates()
{
    if (!are_candidates_known_) {
        evaluate(PointSet::candidates, work_.candidates);
        are_candidates_known_ = true;
    }
}

/// Sees to it that the neutral points of matches on the silhouette are known.
inline void RealtimeFit::update_silhouette_neutral()
{
    if (frozen_ != nullptr) {
        return;
    }
    NeutralShape& neutral = work_.neutral;
    work_.new_rows.clear();
    for (int i = 0; i < frame_.num_silhouette_matches; ++i) {
        const int row = frame_.match_rows[frame_.first_silhouette_match + i];
        if (!neutral.is_row_known[row]) {
            neutral.is_row_known[row] = 1;
            work_.new_rows.push_back(row);
        }
    }
    const int count = static_cast<int>(work_.new_rows.size());
    kernels_.multiply_rows(pack_.contour_rows.identity.data(), pack_.shape_width, work_.new_rows.data(), count,
                           work_.alpha_row.data(), work_.new_points.data());
    for (int i = 0; i < count; ++i) {
        const int at = 3 * work_.new_rows[i];
        for (int axis = 0; axis < 3; ++axis) {
            neutral.contour[at + axis] = work_.new_points[3 * i + axis] + pack_.contour_rows.mean[at + axis];
        }
    }
}

/// With the present expression. Panels are wider than the fixed points, so that those of matches are lost.
inline void RealtimeFit::update_fixed_positions()
{
    evaluate(PointSet::fixed, work_.points);
    frame_.are_fixed_moments_known = false;
}

/// Candidates are evaluated all at once, which costs less than those that are matched one by one.
inline void RealtimeFit::update_match_positions()
{
    const int num_silhouette = frame_.num_silhouette_matches;
    if (frame_.num_matches > num_silhouette) {
        evaluate_candidates();
    }
    if (num_silhouette > 0) {
        update_silhouette_neutral();
        kernels_.multiply_rows(pack_.contour_rows.expression.data(), pack_.expression_width,
                               frame_.match_rows.data() + frame_.first_silhouette_match, num_silhouette,
                               work_.psi_row.data(), work_.match_offset.data());
    }
    const float* contour = (frozen_ ? frozen_->neutral_ : work_.neutral).contour.data();
    const float* offset = work_.match_offset.data();
    float* position = work_.points.data() + 3 * pack_.first_match;
    for (int i = 0; i < frame_.num_matches; ++i, position += 3) {
        const int candidate = frame_.match_candidates[i];
        if (candidate >= 0) {
            std::copy_n(work_.candidates.data() + 3 * candidate, 3, position);
        } else {
            for (int axis = 0; axis < 3; ++axis) {
                position[axis] = contour[3 * frame_.match_rows[i] + axis] + offset[axis];
            }
            offset += 3;
        }
    }
}

} // namespace lineament::detail

#include "lineament/fit/realtime_contour_impl.hpp"
#include "lineament/fit/realtime_pose_impl.hpp"
#include "lineament/fit/realtime_result_impl.hpp"
#include "lineament/fit/realtime_solve_impl.hpp"

#endif
