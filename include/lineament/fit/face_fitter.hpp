// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/core/landmarks.hpp"
#include "lineament/fit/contour.hpp"
#include "lineament/fit/fit_result.hpp"
#include "lineament/fit/fitted_shape.hpp"
#include "lineament/fit/identity.hpp"
#include "lineament/fit/model_points.hpp"
#include "lineament/model/morphable_model.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace lineament {

/// What becomes of the outline landmarks "1".."8" and "10".."17" of ibug68. Other schemes have none (the oval of
/// mediapipe478 is a line on the surface), but may have them beside their own: FitOptions::outline_beside_scheme.
enum class ContourMode
{
    ignored,      ///< They are not used.
    fixed,        ///< Each is tied to its point of the landmark map, whatever the pose.
    front_facing, ///< Re-matched on the sides that face the camera, unused on a side turned away.
    both,         ///< Re-matched on both sides.
};

/// In which units landmark noise is stated; it decides how the prior weighs against the landmarks.
enum class NoiseUnits
{
    model,  ///< Sigmas in mm, turned into px by the fitted scale: the answer does not depend on image resolution.
    pixels, ///< `pixel_variance` for every landmark, as other programs do: it does depend on it.
};

/// How to fit one face. Every member has its default here and nowhere else.
struct FitOptions
{
    int iterations = 5;              ///< Rounds of contour, pose, identity, expression; >= 1.
    double regularization = 1.0;     ///< Weight of |a|^2, >= 0; 1: maximum a posteriori.
    double landmark_sigma_mm = 2.5;  ///< Of inner landmarks, > 0; where the landmark map states no noise.
    double contour_sigma_mm = 4.0;   ///< Of outline landmarks, > 0; where it states none, or they are re-matched.
    std::string noise_detector = {}; ///< Whose LandmarkMap::noise_mm to use; empty: the only one there is, if any.
    NoiseUnits noise_units = NoiseUnits::model;
    double pixel_variance = 3.0;   ///< [px^2], > 0; with NoiseUnits::pixels only.
    double expression_sigma = 1.0; ///< Of each psi: a wide prior, > 0, against blendshapes the landmarks hardly see.
                                   ///< Infinite: none, as in the thesis.
    double max_expression = 3.0;   ///< Each psi is held at this, > 0; the status says so.
    ContourMode contour = ContourMode::both;
    ContourOptions contour_matching = {};
    bool outline_beside_scheme = false; ///< Sets of another scheme may hold the outline landmarks of ibug68 too, named
                                        ///< "ibug68:1" ...; they are only ever re-matched. False: they are not used.
    std::string expression_set = "ekman6";                    ///< Of the model; empty: no expressions.
    std::optional<int> num_shape_coefficients = std::nullopt; ///< Leading components to fit; empty: all m.
    std::optional<double> focal_length_px = std::nullopt;     ///< Known: perspective; empty: scaled orthographic.

    /// The setting usual for this method in pixels: prior weight 30 at a noise variance of 3 px^2, and no
    /// prior on expressions.
    [[nodiscard]] static FitOptions published_prior();

    void check() const; ///< @throws InvalidArgument naming the member and the value.
};

/// Fits many faces with one model, scheme and options: pose, identity and expression in turn (the thesis's method).
///
///   pose on the start shape -> expression -> iterations x (contour matches -> pose -> identity -> expression)
///
/// Landmark rows of the model are packed once; inside the loop only those are touched, and for the outline of a side
/// turned away the vertices of that side and of the coarsest level. `const` members may run in several threads at once.
/// Same input, same bits.
/// @par Reference  Huber, Real-time 3D Morphable Shape Model Fitting to Monocular In-the-wild Videos, PhD thesis,
///                 University of Surrey 2017, chapter 4.                                     docs/maths.md, section 7
class FaceFitter
{
public:
    /// @throws InvalidArgument on bad options, a scheme, expression set or noise the model lacks, more coefficients
    ///         than it has, or fixed outline points beside the scheme.
    explicit FaceFitter(MorphableModel model, std::string scheme = "ibug68", FitOptions options = {});

    /// The face that explains the landmarks.
    ///
    /// Landmarks the scheme does not know, of confidence 0 or of infinite noise get weight 0. Statuses:
    /// too_few_correspondences and degenerate leave coefficients and camera neutral; implausible with a face that looks
    /// away leaves coefficients neutral, with coefficients at their bound keeps them; not_converged keeps the best
    /// found.
    /// @param start  An earlier result with this model, for instance of the frame before; nullptr: the mean face.
    /// @throws InvalidArgument on another scheme, a landmark that is not finite (naming it), a confidence outside
    ///         [0, 1], or a start whose sizes disagree.
    [[nodiscard]] FitResult fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                const FitResult* start = nullptr) const;

    /// As fit, with the identity known and left alone.
    /// @param shape_coefficients  At most as many as are fitted; missing ones are 0.
    [[nodiscard]] FitResult fit_pose_and_expression(const LandmarkSet& landmarks,
                                                    const Eigen::Vector2d& principal_point_px,
                                                    const Eigen::VectorXd& shape_coefficients,
                                                    const FitResult* start = nullptr) const;

    [[nodiscard]] const MorphableModel& model() const { return model_; }
    [[nodiscard]] const std::string& scheme() const { return scheme_; }
    [[nodiscard]] const FitOptions& options() const { return options_; }
    [[nodiscard]] Eigen::Index num_shape_coefficients() const { return landmark_points_.num_shape_coefficients(); }

    // Parts prepared for the solvers of one image and of many.

    [[nodiscard]] const LandmarkMap& landmark_map() const { return *model_.find_landmark_map(scheme_); }
    /// Standard deviation of each landmark of the map [mm]; nullptr: the options state it.
    [[nodiscard]] const Eigen::VectorXf* landmark_noise_mm() const;
    [[nodiscard]] const Blendshapes* expressions() const { return model_.find_expression_set(options_.expression_set); }
    [[nodiscard]] const ModelPoints& landmark_points() const { return landmark_points_; }
    /// Of each landmark of the map: the side of an outline landmark, or nothing.
    [[nodiscard]] const std::vector<std::optional<FaceSide>>& outline_sides() const { return outline_sides_; }
    [[nodiscard]] const std::optional<ContourModel>& contour() const { return contour_; }

    /// S(a, psi) in float at the vertices that match_contour reads in this view; the others are left as they are.
    void update_shape(const Eigen::VectorXd& shape_coefficients, const Eigen::VectorXd& expression_coefficients,
                      ContourView view, Eigen::Matrix3Xf& shape_vertices) const;

    /// Sets point `to` to a vertex.
    void assign_vertex(ModelPoints& points, Eigen::Index to, int vertex) const;

    /// @param mean        3.
    /// @param identity    m x 3, as in PackedPoints.
    /// @param expression  k x 3.
    void get_vertex(int vertex, Eigen::Ref<Eigen::Vector3d> mean, Eigen::Ref<Eigen::MatrixX3f> identity,
                    Eigen::Ref<Eigen::MatrixX3f> expression) const;

private:
    MorphableModel model_;
    std::string scheme_;
    FitOptions options_;
    ModelPoints landmark_points_ = {};
    std::vector<std::optional<FaceSide>> outline_sides_ = {};
    std::optional<ContourModel> contour_ = std::nullopt; ///< Unless the outline is ignored or fixed.
    Eigen::MatrixXf identity_rows_ = {};                 ///< m x 3V, B^T; where there is a contour.
    Eigen::MatrixXf expression_rows_ = {};               ///< k x 3V, D^T.
};

/// FaceFitter(model, landmarks.scheme, options).fit(landmarks, principal_point_px): once, without preparation to keep.
[[nodiscard]] FitResult fit_face(const MorphableModel& model, const LandmarkSet& landmarks,
                                 const Eigen::Vector2d& principal_point_px, const FitOptions& options = {});

} // namespace lineament

#ifndef LINEAMENT_COMPILED_FIT
#include "lineament/fit/face_fitter_impl.hpp"
#endif
