// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Columns of 16 bits in RealtimeFitter: where they lose nothing, and what they lose elsewhere.
#include "lineament/fit/realtime_fitter.hpp"
#include "lineament/kernels/dispatched_kernels.hpp"

#include "support/face_model.hpp"
#include "support/planted_face.hpp"

#include <gtest/gtest.h>

namespace lineament {
namespace {

using test::face_model;

FitOptions with_expressions(const std::string& set)
{
    FitOptions options;
    options.contour = ContourMode::fixed;
    options.expression_set = set;
    return options;
}

/// A face far from the mean, so that every column counts.
FitResult face_of(const MorphableModel& model, int num_expressions, Random& random)
{
    FitResult fit;
    fit.shape_coefficients = test::random_normal(random, model.shape.num_coefficients());
    fit.expression_coefficients = test::random_uniform(random, num_expressions, 0, 1);
    return fit;
}

/// Where the mesh of a face is, summed in double precision.
Eigen::Matrix3Xd double_shape(const MorphableModel& model, const std::string& set, const FitResult& fit)
{
    Eigen::VectorXd shape = model.shape.mean.cast<double>();
    shape += model.shape.basis.cast<double>() *
             model.shape.standard_deviations.cast<double>().cwiseProduct(fit.shape_coefficients);
    if (!set.empty()) {
        shape += model.find_expression_set(set)->offsets.cast<double>() * fit.expression_coefficients;
    }
    return Eigen::Map<const Eigen::Matrix3Xd>(shape.data(), 3, model.num_vertices());
}

/// Largest distance of a vertex of the fitter's mesh from that [um].
double error_um(const RealtimeFitter& fitter, const std::string& set, const FitResult& fit)
{
    RealtimeWorkspace workspace = fitter.make_workspace();
    const Eigen::Matrix3Xd shape = fitter.shape_of(fit, workspace).cast<double>();
    return 1000 * (shape - double_shape(fitter.reference().model(), set, fit)).colwise().norm().maxCoeff();
}

/// Bytes of the columns of a whole mesh.
std::size_t columns_bytes(const MorphableModel& model, Eigen::Index num_columns, std::size_t bytes)
{
    const std::size_t coordinates = 3 * static_cast<std::size_t>(model.num_vertices());
    const std::size_t panels = (coordinates + kernels::panel_size - 1) / kernels::panel_size;
    return panels * kernels::panel_size * static_cast<std::size_t>(num_columns) * bytes;
}

TEST(MeshStorage, ColumnsThatAreSixteenBitIntegersStaySoAndLoseNothing)
{
    Random random(93);
    const MorphableModel& model = face_model();
    for (const kernels::Kernels* kernels : kernels::supported_kernels()) {
        const std::size_t bytes = kernels->prefers_int16 ? 2 : 4;
        for (const std::string set : {"ekman6", "arkit47", ""}) {
            const RealtimeFitter fitter(model, "ibug68", with_expressions(set), *kernels);
            const int num_expressions =
                set.empty() ? 0 : static_cast<int>(model.find_expression_set(set)->num_coefficients());
            EXPECT_EQ(fitter.mesh_bytes().identity, columns_bytes(model, 60, bytes)) << kernels->name;
            if (set == "arkit47") { // two thirds of its blocks are zero
                EXPECT_LT(fitter.mesh_bytes().expression, columns_bytes(model, num_expressions, 2)) << kernels->name;
            } else {
                EXPECT_EQ(fitter.mesh_bytes().expression, columns_bytes(model, num_expressions, bytes))
                    << kernels->name;
            }
            for (int i = 0; i < 5; ++i) {
                EXPECT_LE(error_um(fitter, set, face_of(model, num_expressions, random)), 0.2) << kernels->name;
            }
        }
    }
}

TEST(MeshStorage, OtherColumnsStayInSinglePrecision)
{
    Random random(931);
    MorphableModel model = face_model();
    for (float& entry : model.shape.basis.reshaped()) {
        entry *= static_cast<float>(1 + 1e-4 * random.normal());
    }
    for (const kernels::Kernels* kernels : kernels::supported_kernels()) {
        const RealtimeFitter fitter(model, "ibug68", with_expressions("ekman6"), *kernels);
        EXPECT_EQ(fitter.mesh_bytes().identity, columns_bytes(model, 60, 4)) << kernels->name;
        EXPECT_EQ(fitter.mesh_bytes().expression, columns_bytes(model, 6, kernels->prefers_int16 ? 2 : 4));
        const FitResult fit = face_of(model, 6, random);
        EXPECT_LE(error_um(fitter, "ekman6", fit), 0.2) << kernels->name;

        const RealtimeFitter compact(model, "ibug68", with_expressions("ekman6"), *kernels, MeshStorage::int16);
        EXPECT_EQ(compact.mesh_bytes().identity, columns_bytes(model, 60, 2)) << kernels->name;
        EXPECT_EQ(compact.mesh_bytes().expression, columns_bytes(model, 6, 2)) << kernels->name;
        EXPECT_LE(error_um(compact, "ekman6", fit), 5.0) << kernels->name;
        EXPECT_GT(error_um(compact, "ekman6", fit), 0.3) << kernels->name; // what is lost
    }
}

} // namespace
} // namespace lineament
