// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "fitters.hpp"

#include "console.hpp"

#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/vision/mesh_detector.hpp"

#include <map>
#include <string>

namespace lineament::cli {

namespace {

FitOptions make_fit_options(const ModelOptions& options)
{
    FitOptions fit = options.prior == "published" ? FitOptions::published_prior() : FitOptions{};
    fit.iterations = options.iterations.value_or(fit.iterations);
    if (options.regularization) {
        fit.regularization = *options.regularization;
    }
    fit.expression_set = options.expression_set == "none" ? "" : options.expression_set;
    fit.contour = options.contour == "ignored" ? ContourMode::ignored
                  : options.contour == "fixed" ? ContourMode::fixed
                  : options.contour == "front" ? ContourMode::front_facing
                                               : ContourMode::both;
    if (options.focal_px > 0.0) {
        fit.focal_length_px = options.focal_px;
    }
    return fit;
}

} // namespace

struct Fitters::Implementation
{
    const MorphableModel* model;
    FitOptions options;
    std::map<std::string, FaceFitter> fitters = {};

    const FaceFitter& for_scheme(const std::string& scheme)
    {
        const auto known = fitters.find(scheme);
        return known != fitters.end() ? known->second
                                      : fitters.emplace(scheme, FaceFitter(*model, scheme, options)).first->second;
    }
};

Fitters::Fitters(const MorphableModel& model, const ModelOptions& options)
    : implementation_(new Implementation{&model, make_fit_options(options)})
{}

Fitters::~Fitters() = default;

LandmarkSet Fitters::in_scheme_of_model(LandmarkSet landmarks) const
{
    const MorphableModel& model = *implementation_->model;
    if (model.find_landmark_map(landmarks.scheme) != nullptr) {
        return landmarks;
    }
    if (landmarks.scheme == "mediapipe478" && model.find_landmark_map("ibug68") != nullptr) {
        return ibug68_from_mediapipe(landmarks);
    }
    std::string known;
    for (const LandmarkMap& map : model.landmark_maps) {
        known += (known.empty() ? "" : ", ") + map.scheme;
    }
    throw Failure(bad_input, "the model " + model.name + " has no landmarks of the scheme " + landmarks.scheme +
                                 " (it has: " + known + ")");
}

FitResult Fitters::fit(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px)
{
    return implementation_->for_scheme(landmarks.scheme).fit(landmarks, principal_point_px);
}

FitResult Fitters::fit_pose_and_expression(const LandmarkSet& landmarks, const Eigen::Vector2d& principal_point_px,
                                           const Eigen::VectorXd& shape_coefficients, const FitResult* start)
{
    return implementation_->for_scheme(landmarks.scheme)
        .fit_pose_and_expression(landmarks, principal_point_px, shape_coefficients, start);
}

Eigen::VectorXd Fitters::fit_identity(const std::vector<LandmarkSet>& frames, const Eigen::Vector2d& principal_point_px)
{
    return fit_frames(implementation_->for_scheme(frames.front().scheme), frames, principal_point_px)
        .shape_coefficients;
}

} // namespace lineament::cli
