// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/fit_report.hpp"

#include "report/report_fixtures.hpp"
#include "support/matchers.hpp"

#include <charconv>
#include <cstring>

namespace lineament {
namespace {

using test::canary;
using test::make_fit_report;
using test::text_between;
using test::throws;

TEST(FitReport, LoadsNothing)
{
    const std::string page = format_fit_report(make_fit_report(2, "two people.jpg"));
    EXPECT_EQ(page.find("http:"), std::string::npos);
    EXPECT_EQ(page.find("https:"), std::string::npos);
    EXPECT_EQ(page.find("@import"), std::string::npos);
    EXPECT_EQ(page.find("url("), std::string::npos);
    EXPECT_EQ(page.find("fetch("), std::string::npos);
    EXPECT_NE(page.find("default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"),
              std::string::npos);
}

TEST(FitReport, IsWellFormed)
{
    for (const int num_faces : {0, 1, 3}) {
        EXPECT_EQ(test::unbalanced_elements(format_fit_report(make_fit_report(num_faces, "a.jpg"))), "");
    }
    EXPECT_EQ(test::unbalanced_elements(format_fit_report({})), "");
}

TEST(FitReport, EscapesEveryText)
{
    FitReport report = make_fit_report(2, canary);
    report.program = canary;
    for (FitReportFace& face : report.faces) {
        face.fit.reason = canary;
        face.fit.method = canary;
        face.fit.expression_set = canary;
        face.view.expressions.names.assign(face.view.expressions.names.size(), canary);
        face.fit.expression_names.assign(face.fit.expression_names.size(), canary);
        face.unobservable_expressions = {canary};
        face.fit.landmarks[0].name = canary;
    }
    const std::string page = format_fit_report(report);
    EXPECT_EQ(page.find("<img src=x"), std::string::npos);
    EXPECT_EQ(page.find("alert(1)>"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(page), "");
    EXPECT_NE(page.find("&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;"), std::string::npos);
}

TEST(FitReport, SaysThatNoFaceWasFound)
{
    EXPECT_NE(format_fit_report(make_fit_report(0, "a.jpg")).find("No face was found"), std::string::npos);
    EXPECT_EQ(format_fit_report(make_fit_report(1, "a.jpg")).find("No face was found"), std::string::npos);
}

TEST(FitReport, StatesStatusReasonPoseAndUnits)
{
    FitReport report = make_fit_report(1, "a.jpg");
    report.faces[0].fit.status = FitStatus::implausible;
    report.faces[0].fit.reason = "jaw at its bound";
    report.faces[0].fit.camera.camera_from_model = rotation_from_angles({radians(12.3), radians(-4.5), radians(6.7)});
    const std::string page = format_fit_report(report);
    EXPECT_NE(page.find("implausible</span> jaw at its bound"), std::string::npos);
    EXPECT_NE(page.find("yaw</th><td>12.3</td><td class=\"text\">°"), std::string::npos);
    EXPECT_NE(page.find("pitch</th><td>-4.5</td><td class=\"text\">°"), std::string::npos);
    EXPECT_NE(page.find("roll</th><td>6.7</td><td class=\"text\">°"), std::string::npos);
    EXPECT_NE(page.find("rms</th><td>2.83</td><td class=\"text\">px"), std::string::npos);
}

TEST(FitReport, UnusedLandmarksHaveNoDistance)
{
    FitReport report = make_fit_report(1, "a.jpg");
    report.faces[0].fit.landmarks = {{"used", {10, 20}, {13, 24}, 1.0}, {"unused", {1, 2}, {0, 0}, 0.0}};
    const std::string page = format_fit_report(report);
    EXPECT_NE(page.find("used</th><td>10.0</td><td>20.0</td><td>13.0</td><td>24.0</td><td>5.00</td>"),
              std::string::npos);
    EXPECT_NE(page.find("unused</th><td>1.0</td><td>2.0</td><td>–</td><td>–</td><td>–</td>"), std::string::npos);
}

TEST(FitReport, HoldsTheMeshExactlyAndTheMorphTargetsToTheirStep)
{
    const FitReport report = make_fit_report(1, "a.jpg");
    const FaceView& view = report.faces[0].view;
    const std::string page = format_fit_report(report);
    const std::string vertices = test::decode_base64(text_between(page, "\"vertices\":\"", "\""));
    ASSERT_EQ(vertices.size(), 4u * view.neutral.vertices.size());
    EXPECT_EQ(std::memcmp(vertices.data(), view.neutral.vertices.data(), vertices.size()), 0); // little-endian machine
    const std::string scale_text = text_between(page, "\"scale\":", ",");
    float scale = 0.0f;
    std::from_chars(scale_text.data(), scale_text.data() + scale_text.size(), scale);
    const std::string steps = test::decode_base64(text_between(page, "\"offsets\":\"", "\""));
    ASSERT_EQ(steps.size(), 2u * view.expressions.offsets.rows());
    double largest = 0.0;
    for (Eigen::Index i = 0; i < view.expressions.offsets.rows(); ++i) {
        std::int16_t step;
        std::memcpy(&step, steps.data() + 2 * i, 2);
        largest = std::max(largest, static_cast<double>(std::abs(scale * step - view.expressions.offsets(i, 0))));
    }
    EXPECT_LE(largest, 0.51 * scale);
    EXPECT_NEAR(scale * 32767, view.expressions.offsets.col(0).cwiseAbs().maxCoeff(), 1e-4);
}

TEST(FitReport, SeamsKeepBothTexturePoints)
{
    FitReport report = make_fit_report(1, "a.jpg");
    Mesh& mesh = report.faces[0].view.neutral;
    mesh.uv_coordinates.conservativeResize(2, mesh.uv_coordinates.cols() + 1);
    mesh.uv_coordinates.rightCols(1).setConstant(0.25f);
    const std::string before = test::decode_base64(text_between(format_fit_report(report), "\"vertexOf\":\"", "\""));
    mesh.uv_triangles(0, 0) = static_cast<int>(mesh.uv_coordinates.cols()) - 1; // a second point for one vertex
    const std::string after = test::decode_base64(text_between(format_fit_report(report), "\"vertexOf\":\"", "\""));
    EXPECT_EQ(after.size(), before.size() + 4);
}

TEST(FitReport, LeavesOutWhatIsNotThere)
{
    FitReport report = make_fit_report(1, "a.jpg");
    report.overlay = {};
    report.faces[0].frontal = {};
    report.faces[0].view = {};
    report.faces[0].shape_standard_deviations = {};
    const std::string page = format_fit_report(report);
    EXPECT_EQ(page.find("data-face=\""), std::string::npos);
    EXPECT_EQ(page.find("Frontal view"), std::string::npos);
    EXPECT_EQ(page.find("data-switch>"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(page), "");
}

TEST(FitReport, ShowsTheUncertaintyWhereThereIsOne)
{
    FitReport report = make_fit_report(1, "a.jpg");
    const std::string without = format_fit_report(report);
    EXPECT_EQ(without.find("Certainty"), std::string::npos);
    EXPECT_EQ(without.find("Expected error of the neutral face"), std::string::npos);
    report.faces[0].uncertainty = ImageU8(8, 8, 3, 90);
    report.faces[0].predicted_rms_mm = 2.34;
    const std::string with = format_fit_report(report);
    EXPECT_NE(with.find("Expected error of the neutral face: 2.3 mm"), std::string::npos);
    EXPECT_NE(with.find("Certainty"), std::string::npos);
    EXPECT_GT(with.size(), without.size());
    EXPECT_EQ(test::unbalanced_elements(with), "");
}

TEST(FitReport, RefusesSizesThatDisagree)
{
    FitReport report = make_fit_report(1, "a.jpg");
    report.faces[0].shape_standard_deviations = Eigen::VectorXd::Zero(1);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_fit_report(report); }, "shape_standard_deviations"));
    report = make_fit_report(1, "a.jpg");
    report.faces[0].view.neutral.triangles(0, 0) = static_cast<int>(report.faces[0].view.neutral.num_vertices());
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_fit_report(report); }, "neutral.triangles"));
    report = make_fit_report(1, "a.jpg");
    report.faces[0].view.expressions.names.pop_back();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_fit_report(report); }, "expressions.names"));
    report = make_fit_report(1, "a.jpg");
    report.faces[0].view.neutral.vertices(0, 0) = std::numeric_limits<float>::quiet_NaN();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_fit_report(report); }, "neutral.vertices"));
}

TEST(FaceView, IsTheFitWithoutExpressionAndItsMorphTargets)
{
    const MorphableModel model = test::make_synthetic_face();
    const FitResult fit = test::make_fit(model, 7);
    const FaceView view = make_face_view(model, fit);
    const Eigen::VectorXf expected = model.shape.instance(fit.shape_coefficients);
    EXPECT_THAT(view.neutral.vertices.reshaped(), test::IsNear(expected, 0.0));
    EXPECT_THAT(view.expression_values, test::IsNear(fit.expression_coefficients, 0.0));
    FitResult other = fit;
    other.expression_set = "no such set";
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)make_face_view(model, other); }, "no such set"));
}

} // namespace
} // namespace lineament
