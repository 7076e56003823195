// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/plot.hpp"

#include "report/report_fixtures.hpp"
#include "support/matchers.hpp"

#include <cmath>
#include <limits>

namespace lineament {
namespace {

using test::throws;

constexpr double gap = std::numeric_limits<double>::quiet_NaN();

// The path data of series i.
std::string path_of(const std::string& svg, int i)
{
    const std::string mark = "plot-line s" + std::to_string(i) + "\" d=\"";
    const std::size_t last = svg.rfind(mark); // the first one is the legend's
    return svg.substr(last + mark.size(), svg.find('"', last + mark.size()) - last - mark.size());
}

TEST(Plot, TicksAreRoundAndWithinTheRange)
{
    Random random(2);
    for (int i = 0; i < 2000; ++i) {
        const double size = std::pow(10.0, random.uniform(-6, 6));
        const double low = size * random.normal();
        const double high = low + std::pow(10.0, random.uniform(-3, 6));
        const std::vector<double> ticks = nice_ticks(low, high, 6);
        ASSERT_GE(ticks.size(), 1u);
        ASSERT_LE(ticks.size(), 6u);
        for (const double tick : ticks) {
            ASSERT_TRUE(tick >= low - 1e-6 * (high - low) && tick <= high + 1e-6 * (high - low));
        }
        if (ticks.size() > 1) {
            const double step = ticks[1] - ticks[0];
            const double mantissa = step / std::pow(10.0, std::floor(std::log10(step * 1.0001)));
            ASSERT_TRUE(std::abs(mantissa - 1) < 1e-3 || std::abs(mantissa - 2) < 1e-3 || std::abs(mantissa - 5) < 1e-3)
                << mantissa;
        }
    }
    EXPECT_THAT(nice_ticks(0.0, 10.0, 6), testing::ElementsAre(0.0, 2.0, 4.0, 6.0, 8.0, 10.0));
}

TEST(Plot, TicksRefuseAnEmptyRange)
{
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)nice_ticks(1.0, 1.0, 5); }, "nice_ticks"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)nice_ticks(0.0, gap, 5); }, "nice_ticks"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)nice_ticks(0.0, 1.0, 1); }, "max_count"));
}

TEST(Plot, GapsBreakTheLine)
{
    const std::string whole = path_of(format_line_plot({.x = {0, 1, 2, 3}, .series = {{"a", {1, 2, 3, 4}}}}), 0);
    const std::string broken = path_of(format_line_plot({.x = {0, 1, 2, 3}, .series = {{"a", {1, gap, 3, 4}}}}), 0);
    EXPECT_EQ(std::count(whole.begin(), whole.end(), 'M'), 1);
    EXPECT_EQ(std::count(broken.begin(), broken.end(), 'M'), 2);
    EXPECT_EQ(broken.find("nan"), std::string::npos);
    EXPECT_EQ(std::count(broken.begin(), broken.end(), 'L'), 2); // the lone first point is a dot
}

TEST(Plot, PointsLieWhereTheAxesPutThem)
{
    // The range of y is widened by 6 % at both ends: 0 and 1 lie at 0.06/1.12 of the height from the frame.
    const std::string path = path_of(format_line_plot({.x = {0, 10}, .series = {{"a", {0, 1}}}}), 0);
    const double top = 34;
    const double bottom = 260 - 42;
    double x1, y1, x2, y2;
    ASSERT_EQ(std::sscanf(path.c_str(), "M%lf %lfL%lf %lf", &x1, &y1, &x2, &y2), 4) << path;
    EXPECT_NEAR(x1, 64, 0.06);
    EXPECT_NEAR(x2, 948, 0.06);
    EXPECT_NEAR(y1, bottom - (bottom - top) * 0.06 / 1.12, 0.06);
    EXPECT_NEAR(y2, top + (bottom - top) * 0.06 / 1.12, 0.06);
}

TEST(Plot, LongSeriesKeepTheirExtremesAndBecomeShort)
{
    LinePlot plot;
    plot.series = {{"a", {}}};
    for (int i = 0; i < 200000; ++i) {
        plot.x.push_back(i);
        plot.series[0].y.push_back(i == 123456 ? 100.0 : std::sin(i * 0.1));
    }
    const std::string with_peak = path_of(format_line_plot(plot), 0);
    EXPECT_LT(with_peak.size(), 80000u);
    EXPECT_NE(with_peak.find(" 43.9"), std::string::npos); // the peak: 34 + 184 * 0.06 / 1.12
}

TEST(Plot, TextsAreEscaped)
{
    LinePlot plot{.title = test::canary, .x_label = test::canary, .y_label = test::canary, .x = {0, 1}};
    plot.series = {{test::canary, {0, 1}}};
    const std::string svg = format_line_plot(plot);
    EXPECT_EQ(svg.find("<img"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(svg), "");
    const std::string bars = format_bar_plot({.title = test::canary, .names = {test::canary}, .values = {1.0}});
    EXPECT_EQ(bars.find("<img"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(bars), "");
}

TEST(Plot, WithoutValuesItSaysSo)
{
    EXPECT_NE(format_line_plot({}).find("no values"), std::string::npos);
    EXPECT_NE(format_line_plot({.x = {0, 1}, .series = {{"a", {gap, gap}}}}).find("no values"), std::string::npos);
    EXPECT_EQ(format_line_plot({.x = {0, 1}, .series = {{"a", {1, gap}}}}).find("no values"), std::string::npos);
    EXPECT_EQ(test::unbalanced_elements(format_bar_plot({})), "");
}

TEST(Plot, RefusesListsThatDisagree)
{
    EXPECT_TRUE(throws<InvalidArgument>(
        [] {
            (void)format_line_plot({.x = {0, 1}, .series = {{"a", {1}}}});
        },
        "series.y", "2 values", "1"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_line_plot({.x = {1, 0}}); }, "x", "ascending"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_line_plot({.x = {gap}}); }, "x", "nan"));
    EXPECT_TRUE(throws<InvalidArgument>([] { (void)format_bar_plot({.names = {"a"}, .values = {}}); }, "names"));
    EXPECT_TRUE(throws<InvalidArgument>(
        [] {
            (void)format_bar_plot({.names = {"a"}, .values = {1.0}, .standard_deviations = {1, 2}});
        },
        "standard_deviations"));
}

TEST(Plot, BarsWithoutAValueAreLeftOut)
{
    const std::string svg = format_bar_plot({.names = {"a", "b"}, .values = {1.0, gap}});
    EXPECT_NE(svg.find("<title>a: 1.000"), std::string::npos);
    EXPECT_EQ(svg.find("<title>b:"), std::string::npos);
}

} // namespace
} // namespace lineament
