// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "support/planted_face.hpp"

namespace lineament::test {

namespace {

PlantedFace plant(Random& random, Eigen::VectorXd alpha, Eigen::VectorXd psi, double noise_px, double max_yaw_deg)
{
    PlantedFace planted;
    planted.alpha = std::move(alpha);
    planted.psi = std::move(psi);
    planted.camera = random_camera(random, max_yaw_deg);
    planted.landmarks =
        project_landmarks(synthetic_face(), "ibug68", planted.alpha, planted.psi, planted.camera, noise_px, random);
    return planted;
}

} // namespace

const MorphableModel& synthetic_face()
{
    static const MorphableModel face = make_synthetic_face();
    return face;
}

PlantedFace plant_moderate_face(Random& random, double noise_px, double max_yaw_deg)
{
    const MorphableModel& model = synthetic_face();
    const Eigen::VectorXd alpha = 0.5 * random_normal(random, model.shape.num_coefficients());
    const Eigen::VectorXd psi = random_uniform(random, model.expression_sets[0].num_coefficients(), 0.0, 0.6);
    return plant(random, alpha, psi, noise_px, max_yaw_deg);
}

PlantedFace plant_face_from_priors(Random& random, double noise_px, double max_yaw_deg)
{
    const Eigen::VectorXd alpha = random_normal(random, synthetic_face().shape.num_coefficients());
    const Eigen::VectorXd psi = draw_expression(random);
    return plant(random, alpha, psi, noise_px, max_yaw_deg);
}

Eigen::VectorXd draw_expression(Random& random)
{
    return (0.3 * random_normal(random, synthetic_face().expression_sets[0].num_coefficients()))
        .cwiseAbs()
        .cwiseMin(1.0);
}

double neutral_distance_mm(const Eigen::VectorXd& alpha, const Eigen::VectorXd& other)
{
    const MorphableModel& model = synthetic_face();
    const Eigen::VectorXf difference = model.shape.instance(alpha) - model.shape.instance(other);
    return Eigen::Map<const Eigen::Matrix3Xf>(difference.data(), 3, model.num_vertices()).colwise().norm().mean();
}

double largest_vertex_distance_mm(const MorphableModel& model, const FitResult& a, const FitResult& b)
{
    const Eigen::VectorXf alpha = (a.shape_coefficients - b.shape_coefficients).cast<float>();
    Eigen::VectorXf difference = model.shape.basis.leftCols(alpha.size()) *
                                 model.shape.standard_deviations.head(alpha.size()).cwiseProduct(alpha);
    if (a.expression_coefficients.size() > 0) {
        difference += model.find_expression_set(a.expression_set)->offsets *
                      (a.expression_coefficients - b.expression_coefficients).cast<float>();
    }
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(difference.data(), 3, model.num_vertices());
    return static_cast<double>(vertices.colwise().norm().maxCoeff());
}

} // namespace lineament::test
