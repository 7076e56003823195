// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Fits to given correspondences, four vertices compared with what clang 14 gave: whichever compiler and instruction
// set, they differ by less than 1 um.
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/face_model.hpp"
#include "support/planted_face.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

namespace lineament {
namespace {

constexpr std::array<int, 4> vertices = {10, 300, 800, 2500};

/// Of the fitted face [mm], in the order of the fields; a row a vertex.
struct Expected
{
    double thesis[4][3];
    double joint[4][3];
};

constexpr Expected expected[3] = {{{{-18.64961, 22.20007, 28.67023},
                                    {-60.90549, -33.37271, 4.56595},
                                    {77.37840, 11.38861, -69.59133},
                                    {-80.75613, 13.97141, -63.26209}},
                                   {{-18.94407, 22.37409, 28.69688},
                                    {-61.39535, -33.67902, 4.32727},
                                    {78.12724, 12.09190, -70.74223},
                                    {-81.50697, 14.77356, -64.36662}}},
                                  {{{-18.88448, 21.73152, 28.35442},
                                    {-59.93982, -31.92343, 3.81753},
                                    {77.44292, 5.72981, -66.60439},
                                    {-81.02192, 8.77512, -60.20005}},
                                   {{-18.62566, 21.09724, 28.42234},
                                    {-59.34322, -31.75478, 3.82097},
                                    {76.40958, 5.06319, -65.59103},
                                    {-79.96545, 8.02639, -59.27198}}},
                                  {{{-18.77224, 22.36201, 28.41739},
                                    {-55.25543, -32.43924, 3.95889},
                                    {73.49609, 4.27858, -64.91988},
                                    {-77.22868, 7.82702, -58.28489}},
                                   {{-18.54843, 22.03163, 28.48323},
                                    {-54.65804, -32.23955, 4.16566},
                                    {72.58668, 3.25717, -63.73000},
                                    {-76.28638, 6.86556, -57.19275}}}};

LandmarkSet landmarks_of(const MorphableModel& model, int face)
{
    // No random numbers: those of the standard library may differ too.
    Eigen::VectorXd alpha(model.shape.num_coefficients());
    for (Eigen::Index i = 0; i < alpha.size(); ++i) {
        alpha[i] = 1.5 * std::sin(1.7 * static_cast<double>(i) + face);
    }
    Eigen::VectorXd psi(6);
    for (Eigen::Index i = 0; i < psi.size(); ++i) {
        psi[i] = std::max(0.0, 0.6 * std::sin(2.3 * static_cast<double>(i) + 2 * face));
    }
    Camera camera;
    camera.camera_from_model = rotation_from_angles({0.4 * (face - 1), 0.1 * face, -0.05 * face});
    camera.scale_px_per_mm = 1.1 + 0.2 * face;
    camera.translation_mm = {5.0 * face, -3};
    camera.principal_point_px = {320, 240};
    Random random(1);
    LandmarkSet set = test::project_landmarks(model, "ibug68", alpha, psi, camera, 0, random);
    for (std::size_t l = 0; l < set.landmarks.size(); ++l) {
        const double phase = static_cast<double>(l) + 0.3 * face;
        set.landmarks[l].point_px += Eigen::Vector2d(2 * std::sin(3.1 * phase), 2 * std::cos(4.7 * phase));
    }
    return set;
}

/// Largest distance of the four vertices from the expected ones [um].
double distance_um(const MorphableModel& model, const FitResult& fit, const double (&expected_mm)[4][3])
{
    const Eigen::VectorXf shape = shape_of(model, fit);
    double largest = 0;
    std::string found;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Eigen::Vector3d vertex = shape.segment<3>(3 * vertices[i]).cast<double>();
        largest = std::max(largest, 1000 * (vertex - Eigen::Map<const Eigen::Vector3d>(expected_mm[i])).norm());
        char text[80];
        std::snprintf(text, sizeof(text), "{%.5f, %.5f, %.5f}, ", vertex.x(), vertex.y(), vertex.z());
        found += text;
    }
    EXPECT_LT(largest, 1) << "found " << found;
    return largest;
}

TEST(SameEverywhere, FitsToGivenCorrespondences)
{
    const MorphableModel& model = test::face_model();
    const Eigen::Vector2d centre(320, 240);
    FitOptions options;
    options.contour = ContourMode::fixed;
    JointOptions joint_options;
    joint_options.contour = ContourMode::fixed;
    joint_options.tolerance = 1e-7;
    const FaceFitter thesis(model, "ibug68", options);
    const JointFitter joint(model, "ibug68", joint_options);
    for (int face = 0; face < 3; ++face) {
        SCOPED_TRACE("face " + std::to_string(face));
        const LandmarkSet set = landmarks_of(model, face);
        distance_um(model, thesis.fit(set, centre), expected[face].thesis);
        distance_um(model, joint.fit(set, centre).fit, expected[face].joint);
        for (const kernels::Kernels* kernels : kernels::supported_kernels()) {
            SCOPED_TRACE(kernels->name);
            const RealtimeFitter realtime(model, "ibug68", options, *kernels);
            RealtimeWorkspace workspace = realtime.make_workspace();
            FitResult result;
            realtime.fit(set, centre, workspace, result);
            distance_um(model, result, expected[face].thesis);
            distance_um(model, JointFitter(model, "ibug68", joint_options, kernels).fit(set, centre).fit,
                        expected[face].joint);
        }
    }
}

} // namespace
} // namespace lineament
