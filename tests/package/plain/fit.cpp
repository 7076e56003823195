// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The solvers header-only: a planted face found without any library.
#include "lineament/fit/affine_camera.hpp"
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/identity_filter.hpp"
#include "lineament/fit/joint_fitter.hpp"
#include "lineament/fit/multi_frame.hpp"
#include "lineament/fit/nnls.hpp"
#include "lineament/fit/realtime_fitter.hpp"

#include "support/planted_face.cpp" // as one file: a third of the time of three
#include "support/synthetic_face.cpp"

#include <cstdio>

int main()
{
    using namespace lineament;
    Random random(5);
    const test::PlantedFace planted = test::plant_moderate_face(random, 0.0);
    const FitResult thesis =
        FaceFitter(test::synthetic_face(), "ibug68").fit(planted.landmarks, planted.camera.principal_point_px);
    const FitResult joint =
        JointFitter(test::synthetic_face(), "ibug68").fit(planted.landmarks, planted.camera.principal_point_px).fit;
    for (const FitResult* fit : {&thesis, &joint}) {
        const double mean_face_mm =
            test::neutral_distance_mm(Eigen::VectorXd::Zero(planted.alpha.size()), planted.alpha);
        const double fit_mm = test::neutral_distance_mm(fit->shape_coefficients, planted.alpha);
        std::printf("%s: %.3f mm from the truth, the mean face %.3f\n", fit->method.c_str(), fit_mm, mean_face_mm);
        if (fit->status != FitStatus::success || !(fit_mm < 0.6 * mean_face_mm)) {
            return 1;
        }
    }
    return 0;
}
