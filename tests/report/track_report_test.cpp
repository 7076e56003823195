// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/track_report.hpp"

#include "report/report_fixtures.hpp"
#include "report/track_series.hpp"
#include "support/matchers.hpp"

namespace lineament {
namespace {

using test::canary;
using test::make_track_report;
using test::throws;

TEST(TrackReport, LoadsNothingAndIsWellFormed)
{
    const std::string page = format_track_report(make_track_report("clip.mp4"));
    EXPECT_EQ(page.find("http:"), std::string::npos);
    EXPECT_EQ(page.find("https:"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(page), "");
    EXPECT_EQ(test::unbalanced_elements(format_track_report({})), "");
}

TEST(TrackReport, SaysFirstThatItIsIncomplete)
{
    TrackReport report = make_track_report("clip.mp4");
    EXPECT_EQ(format_track_report(report).find("Incomplete"), std::string::npos);
    report.is_complete = false;
    const std::string page = format_track_report(report);
    EXPECT_LT(page.find("Incomplete"), page.find("Pictures")); // the strip, which comes before the rest
    EXPECT_LT(page.find("Pictures"), page.find("Over time"));
    EXPECT_EQ(test::unbalanced_elements(page), "");
}

TEST(TrackReport, NamesTheExpressionsThatCannotBeSeen)
{
    TrackReport report = make_track_report("clip.mp4");
    EXPECT_EQ(format_track_report(report).find("Not observable"), std::string::npos);
    report.faces[0].unobservable_expressions = {report.expression_names[2], report.expression_names[5]};
    const std::string page = format_track_report(report);
    EXPECT_NE(page.find("Not observable: " + report.expression_names[2] + ", " + report.expression_names[5] + ". "),
              std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(page), "");
}

TEST(TrackReport, EscapesEveryText)
{
    TrackReport report = make_track_report(canary);
    report.program = canary;
    report.expression_names.assign(report.expression_names.size(), canary);
    report.faces[0].view.expressions.names.assign(report.expression_names.size(), canary);
    report.faces[0].unobservable_expressions = {canary};
    for (TrackRow& row : report.rows) {
        row.status = canary;
    }
    const std::string page = format_track_report(report);
    EXPECT_EQ(page.find("<img src=x"), std::string::npos);
    EXPECT_EQ(page.find("alert(1)>"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(page), "");
}

TEST(TrackReport, CountsEveryFrameOnceByStatus)
{
    const html::TrackSeries series = html::collect_series(make_track_report("clip.mp4"), 1);
    EXPECT_EQ(series.time_s.size(), 30u);
    EXPECT_EQ(series.status_counts.at("success"), 25);
    EXPECT_EQ(series.status_counts.at("no_face"), 5);
}

TEST(TrackReport, FramesWithoutTheFaceAreGaps)
{
    const html::TrackSeries series = html::collect_series(make_track_report("clip.mp4"), 1);
    for (std::size_t i = 0; i < 30; ++i) {
        const bool is_gap = i >= 10 && i < 15;
        EXPECT_EQ(std::isnan(series.yaw_deg[i]), is_gap);
        EXPECT_EQ(std::isnan(series.expressions[3][i]), is_gap);
        if (!is_gap) {
            EXPECT_NEAR(series.yaw_deg[i], degrees(0.02 * static_cast<double>(i)), 1e-9);
            EXPECT_NEAR(series.pitch_deg[i], degrees(-0.01 * static_cast<double>(i)), 1e-9);
        }
    }
}

TEST(TrackReport, TwoFacesInOneFrameAreKeptApart)
{
    TrackReport report = make_track_report("clip.mp4");
    TrackRow other = report.rows[20];
    other.face = 2;
    other.rms_px = 99.0;
    report.rows.insert(report.rows.begin() + 21, other);
    EXPECT_EQ(html::collect_series(report, 1).rms_px[20], 4.0);
    EXPECT_EQ(html::collect_series(report, 2).rms_px[20], 99.0);
    EXPECT_TRUE(std::isnan(html::collect_series(report, 2).rms_px[21]));
    EXPECT_EQ(html::collect_series(report, 2).time_s.size(), 30u);
}

TEST(TrackReport, PlaybackHoldsHeadRotationsAndExpressions)
{
    const TrackReport report = make_track_report("clip.mp4");
    const html::TrackSeries series = html::collect_series(report, 1);
    const html::Playback playback = html::make_playback(report, series, report.faces[0].view, 7);
    ASSERT_EQ(playback.times_s.size(), 5u); // frames 0, 7, 14, 21, 28
    for (std::size_t i = 0; i < 5; ++i) {
        const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> head(playback.rotations.data() + 9 * i);
        if (i == 2) {
            EXPECT_THAT(head, test::IsNear(Eigen::Matrix3f::Zero(), 0.0));
            continue;
        }
        const double frame = 7.0 * static_cast<double>(i);
        const Eigen::Matrix3d expected =
            frontal_rotation() * rotation_from_angles({0.02 * frame, -0.01 * frame, 0.005 * frame});
        EXPECT_THAT(head, test::IsNear(expected, 1e-6));
        EXPECT_NEAR(playback.expressions[i][5], 0.03 * frame, 1e-6);
    }
}

TEST(TrackReport, ExpressionsReachTheViewByName)
{
    TrackReport report = make_track_report("clip.mp4");
    for (TrackRow& row : report.rows) {
        if (row.expression_coefficients.size() > 0) {
            row.expression_coefficients = Eigen::VectorXd::LinSpaced(8, 0.0, 0.7);
        }
    }
    FaceView view = report.faces[0].view;
    view.expressions.names = {report.expression_names[5], "unknown", report.expression_names[2]};
    const html::Playback playback = html::make_playback(report, html::collect_series(report, 1), view, 100);
    ASSERT_EQ(playback.expressions[0].size(), 3u);
    EXPECT_NEAR(playback.expressions[0][0], 0.5, 1e-6);
    EXPECT_EQ(playback.expressions[0][1], 0.0f);
    EXPECT_NEAR(playback.expressions[0][2], 0.2, 1e-6);
}

TEST(TrackReport, HeatMapShowsTheLargestValueOfAColumnAndGaps)
{
    const html::TrackSeries series = html::collect_series(make_track_report("clip.mp4"), 1);
    const ImageU8 map = html::expression_heat_map(series, 6); // five frames a column
    ASSERT_EQ(map.width, 6);
    ASSERT_EQ(map.height, 8);
    EXPECT_EQ(map.at(1, 0, 3), to_u8(0.27f));
    EXPECT_EQ(map.at(5, 7, 3), to_u8(0.87f));
    EXPECT_EQ(map.at(2, 0, 0), 128); // frames 10 to 14
    EXPECT_NE(map.at(3, 0, 0), 128);
}

TEST(TrackReport, SaysThatFramesAreLeftOutOfThePlayback)
{
    TrackReport report = make_track_report("clip.mp4");
    EXPECT_EQ(format_track_report(report).find("one frame in"), std::string::npos);
    const TrackRow last = report.rows.back();
    for (int i = 30; i < 6001; ++i) {
        report.rows.push_back(last);
        report.rows.back().frame = i;
        report.rows.back().time_s = i / 25.0;
    }
    EXPECT_NE(format_track_report(report).find("one frame in 3"), std::string::npos);
}

TEST(TrackReport, SaysThatNoFaceWasFound)
{
    TrackReport report = make_track_report("clip.mp4");
    report.faces.clear();
    EXPECT_NE(format_track_report(report).find("No face was found"), std::string::npos);
}

TEST(TrackReport, RefusesRowsOutOfOrderOrOfAnotherSize)
{
    TrackReport report = make_track_report("clip.mp4");
    std::swap(report.rows[3], report.rows[4]);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_track_report(report); }, "rows[4]"));
    report = make_track_report("clip.mp4");
    report.rows[2].expression_coefficients = Eigen::VectorXd::Zero(3);
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_track_report(report); }, "rows[2]", "none or 8", "3"));
    report = make_track_report("clip.mp4");
    report.rows[2].time_s = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(throws<InvalidArgument>([&] { (void)format_track_report(report); }, "rows[2].time_s"));
}

} // namespace
} // namespace lineament
