// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/overlay.hpp"

#include "report/report_fixtures.hpp"
#include "support/matchers.hpp"

namespace lineament {
namespace {

using test::throws;

constexpr OverlayOptions nothing{
    .mesh_opacity = 0.0, .axis_length_mm = 0.0, .landmarks = OverlayLandmarks::none, .caption = OverlayCaption::none};

Eigen::AlignedBox2d changed_box(const ImageU8& a, const ImageU8& b)
{
    Eigen::AlignedBox2d box;
    for (int row = 0; row < a.height; ++row) {
        for (int column = 0; column < a.width; ++column) {
            if (!std::equal(a.pixel(column, row), a.pixel(column, row) + 3, b.pixel(column, row))) {
                box.extend(Eigen::Vector2d(column + 0.5, row + 0.5));
            }
        }
    }
    return box;
}

struct Scene
{
    MorphableModel model = test::make_synthetic_face();
    FitResult fit = test::make_fit(model, 4);
    ImageU8 picture = ImageU8(640, 480, 3, 60);

    [[nodiscard]] Eigen::AlignedBox2d face_box() const
    {
        const Eigen::VectorXf shape = model.shape.instance(fit.shape_coefficients) +
                                      model.expression_sets[0].displacement(fit.expression_coefficients);
        Eigen::AlignedBox2d box;
        for (Eigen::Index v = 0; v < model.num_vertices(); ++v) {
            box.extend(fit.camera.project(Eigen::Vector3d(shape.segment<3>(3 * v).cast<double>())));
        }
        return box;
    }
};

TEST(Overlay, WithEverythingOffThePictureStays)
{
    const Scene scene;
    EXPECT_EQ(draw_overlay(scene.picture, scene.model, scene.fit, nothing), scene.picture);
}

TEST(Overlay, MeshCoversTheFaceAndNothingElse)
{
    const Scene scene;
    OverlayOptions options = nothing;
    options.mesh_opacity = 1.0;
    const ImageU8 drawn = draw_overlay(scene.picture, scene.model, scene.fit, options);
    const Eigen::AlignedBox2d changed = changed_box(scene.picture, drawn);
    const Eigen::AlignedBox2d face = scene.face_box();
    EXPECT_THAT(changed.min(), test::IsNear(face.min(), 2.5));
    EXPECT_THAT(changed.max(), test::IsNear(face.max(), 2.5));
}

TEST(Overlay, HiddenTrianglesAreNotDrawn)
{
    const auto count_drawn = [](double yaw) {
        Scene scene;
        scene.fit.camera.camera_from_model = rotation_from_angles({yaw, 0, 0});
        OverlayOptions options = nothing;
        options.mesh_opacity = 1.0;
        const ImageU8 drawn = draw_overlay(scene.picture, scene.model, scene.fit, options);
        return std::count_if(drawn.data.begin(), drawn.data.end(), [](std::uint8_t value) { return value > 70; });
    };
    // From behind, the open mask shows its back, but for triangles at the rim that bend outwards.
    EXPECT_GT(count_drawn(0.0), 10000);
    EXPECT_LT(count_drawn(std::numbers::pi), 500);
}

TEST(Overlay, LandmarksStandWhereTheyWereSeen)
{
    Scene scene;
    scene.fit.landmarks = {{"1", {100.5, 50.5}, {120.5, 50.5}, 1.0}, {"2", {300.5, 50.5}, {400.5, 50.5}, 0.0}};
    OverlayOptions options = nothing;
    options.landmarks = OverlayLandmarks::residuals;
    const ImageU8 drawn = draw_overlay(scene.picture, scene.model, scene.fit, options);
    EXPECT_GT(drawn.at(100, 50, 0), 200);                    // the landmark, yellow
    EXPECT_LT(drawn.at(100, 50, 2), 100);                    //
    EXPECT_GT(drawn.at(110, 50, 0), 120);                    // the residual line
    EXPECT_GT(drawn.at(120, 50, 2), 120);                    // the fitted point, blue-green
    EXPECT_NE(drawn.at(300, 50), scene.picture.at(300, 50)); // unused: marked, without a line
    EXPECT_EQ(drawn.at(350, 50), 60);
    EXPECT_EQ(drawn.at(400, 50), 60);
}

TEST(Overlay, AxesPointWhereTheCameraSeesThem)
{
    Scene scene;
    scene.fit.camera.camera_from_model = rotation_from_angles({radians(25), radians(15), 0});
    OverlayOptions options = nothing;
    options.axis_length_mm = 60.0;
    const ImageU8 drawn = draw_overlay(scene.picture, scene.model, scene.fit, options);
    const LandmarkMap& map = *scene.model.find_landmark_map("ibug68");
    const Eigen::VectorXf shape = scene.model.shape.instance(scene.fit.shape_coefficients) +
                                  scene.model.expression_sets[0].displacement(scene.fit.expression_coefficients);
    const Eigen::Map<const Eigen::Matrix3Xf> vertices(shape.data(), 3, scene.model.num_vertices());
    const Eigen::Vector3d nose = map.points_on(vertices).col(map.index_of("31")).cast<double>();
    for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector2d point =
            scene.fit.camera.project(Eigen::Vector3d(nose + 40.0 * Eigen::Vector3d::Unit(axis)));
        const std::uint8_t* pixel = drawn.pixel(static_cast<int>(point.x()), static_cast<int>(point.y()));
        EXPECT_EQ(std::max_element(pixel, pixel + 3) - pixel, axis) << "axis " << axis; // red, green, blue
        EXPECT_GT(pixel[axis], 150);
    }
}

TEST(Overlay, AFitWithoutAnAnswerShowsItsLandmarksOnly)
{
    Scene scene;
    scene.fit.status = FitStatus::degenerate;
    scene.fit.landmarks = {{"1", {100.5, 50.5}, {0, 0}, 0.0}};
    OverlayOptions options;
    options.caption = OverlayCaption::none;
    const ImageU8 drawn = draw_overlay(scene.picture, scene.model, scene.fit, options);
    const Eigen::AlignedBox2d changed = changed_box(scene.picture, drawn);
    EXPECT_TRUE(changed.contains(Eigen::Vector2d(100.5, 50.5)));
    EXPECT_LT(changed.sizes().maxCoeff(), 12.0);
}

TEST(Overlay, CaptionStandsBelowTheFaceAndInsideThePicture)
{
    Scene scene;
    OverlayOptions options = nothing;
    options.caption = OverlayCaption::pose_and_status;
    const Eigen::AlignedBox2d caption =
        changed_box(scene.picture, draw_overlay(scene.picture, scene.model, scene.fit, options));
    EXPECT_GT(caption.min().y(), scene.face_box().max().y());
    scene.fit.camera.principal_point_px += Eigen::Vector2d(-300, 300); // the face leaves at the lower left
    const Eigen::AlignedBox2d moved =
        changed_box(scene.picture, draw_overlay(scene.picture, scene.model, scene.fit, options));
    EXPECT_THAT(moved.sizes(), test::IsNear(caption.sizes(), 0.0)); // nothing of it is cut off
    scene.fit.status = FitStatus::implausible;
    const Eigen::AlignedBox2d longer =
        changed_box(scene.picture, draw_overlay(scene.picture, scene.model, scene.fit, options));
    EXPECT_GT(longer.sizes().x(), moved.sizes().x());
}

TEST(Overlay, AFaceOutsideThePictureIsNoError)
{
    Scene scene;
    scene.fit.camera.principal_point_px = {1e6, -1e6};
    for (FittedLandmark& landmark : scene.fit.landmarks) {
        landmark.point_px += Eigen::Vector2d(1e6, -1e6);
        landmark.fitted_px += Eigen::Vector2d(1e6, -1e6);
    }
    OverlayOptions options;
    options.caption = OverlayCaption::none;
    EXPECT_EQ(draw_overlay(scene.picture, scene.model, scene.fit, options), scene.picture);
}

TEST(Overlay, GreyAndTransparentPicturesBecomeRgb)
{
    const Scene scene;
    const ImageU8 grey = draw_overlay(ImageU8(8, 8, 1, 77), scene.model, scene.fit, nothing);
    EXPECT_EQ(grey, ImageU8(8, 8, 3, 77));
    EXPECT_EQ(draw_overlay(ImageU8(8, 8, 4, 0), scene.model, scene.fit, nothing), ImageU8(8, 8, 3, 255));
    EXPECT_TRUE(
        throws<InvalidArgument>([&] { (void)draw_overlay(ImageU8(8, 8, 2), scene.model, scene.fit); }, "channels"));
}

TEST(Overlay, RefusesBadOptions)
{
    const Scene scene;
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)draw_overlay(scene.picture, scene.model, scene.fit, {.mesh_opacity = 1.5}); }, "mesh_opacity"));
    EXPECT_TRUE(throws<InvalidArgument>(
        [&] { (void)draw_overlay(scene.picture, scene.model, scene.fit, {.axis_length_mm = -1}); }, "axis_length_mm"));
}

} // namespace
} // namespace lineament
