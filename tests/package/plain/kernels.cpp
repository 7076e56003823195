// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// The vector kernels header-only, for the flags of this file and without Highway's library: a real-time fit as with the
// plain ones.
#define LINEAMENT_USE_HIGHWAY
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/highway_kernels.hpp"

#include "support/planted_face.cpp" // as one file: a third of the time of three
#include "support/synthetic_face.cpp"

#include <cstdio>

int main()
{
    using namespace lineament;
    Random random(5);
    const test::PlantedFace planted = test::plant_moderate_face(random, 1.0);
    const auto fit_with = [&](const kernels::Kernels& kernels) {
        const RealtimeFitter fitter(test::synthetic_face(), "ibug68", {}, kernels);
        RealtimeWorkspace workspace = fitter.make_workspace();
        FitResult result;
        fitter.fit(planted.landmarks, planted.camera.principal_point_px, workspace, result);
        return workspace.num_reference_fits() == 0 ? result : FitResult();
    };
    const FitResult fit = fit_with(kernels::highway_kernels());
    const FitResult plain = fit_with(kernels::scalar_kernels());
    if (fit.status != FitStatus::success || plain.status != FitStatus::success) {
        return 1;
    }
    const double difference_um = 1000 * test::largest_vertex_distance_mm(test::synthetic_face(), fit, plain);
    std::printf("%s: at most %.3f um from the plain kernels\n", kernels::highway_kernels().name, difference_um);
    return difference_um < 1 ? 0 : 1;
}
