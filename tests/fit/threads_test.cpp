// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// One const fitter, used by several threads at once; built with the preset tsan, this is where races would show.
#include "lineament/fit/face_fitter.hpp"
#include "lineament/fit/joint_fitter.hpp"

#include "support/matchers.hpp"
#include "support/planted_face.hpp"

#include <thread>

namespace lineament {
namespace {

using test::plant_face_from_priors;
using test::PlantedFace;
using test::synthetic_face;

/// All numbers of the fits of the faces, made by so many threads with a function that fits one face.
template <typename Fit>
std::vector<Eigen::VectorXd> fit_all(const std::vector<PlantedFace>& faces, std::size_t num_threads, const Fit& fit)
{
    std::vector<Eigen::VectorXd> numbers(faces.size());
    std::vector<std::thread> threads;
    for (std::size_t thread = 0; thread < num_threads; ++thread) {
        threads.emplace_back([&, thread] {
            for (std::size_t i = thread; i < faces.size(); i += num_threads) {
                const FitResult result = fit(faces[i]);
                Eigen::VectorXd all(result.shape_coefficients.size() + result.expression_coefficients.size() + 10);
                all << result.shape_coefficients, result.expression_coefficients, result.rms_px,
                    result.camera.camera_from_model.reshaped();
                numbers[i] = all;
            }
        });
    }
    for (std::thread& thread : threads) {
        thread.join();
    }
    return numbers;
}

std::vector<PlantedFace> plant_faces()
{
    Random random(311);
    std::vector<PlantedFace> faces;
    for (int i = 0; i < 8; ++i) {
        faces.push_back(plant_face_from_priors(random, 1.0, 40));
    }
    return faces;
}

TEST(Threads, ShareAFaceFitter)
{
    const std::vector<PlantedFace> faces = plant_faces();
    const FaceFitter fitter(synthetic_face(), "ibug68");
    const auto fit = [&](const PlantedFace& face) {
        return fitter.fit(face.landmarks, face.camera.principal_point_px);
    };
    const std::vector<Eigen::VectorXd> alone = fit_all(faces, 1, fit);
    EXPECT_EQ(fit_all(faces, 4, fit), alone);
    EXPECT_NE(alone[0], alone[1]);
}

TEST(Threads, ShareAJointFitter)
{
    const std::vector<PlantedFace> faces = plant_faces();
    const JointFitter fitter(synthetic_face(), "ibug68");
    const auto fit = [&](const PlantedFace& face) {
        return fitter.fit(face.landmarks, face.camera.principal_point_px).fit;
    };
    const std::vector<Eigen::VectorXd> alone = fit_all(faces, 1, fit);
    EXPECT_EQ(fit_all(faces, 4, fit), alone);
    EXPECT_NE(alone[0], alone[1]);
}

} // namespace
} // namespace lineament
