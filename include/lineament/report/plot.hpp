// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace lineament {

/// One line of a plot: y over the plot's x. NaN is a gap: the line breaks there and is not bridged.
struct PlotSeries
{
    std::string name = {};
    std::vector<double> y = {};
};

/// Lines over one axis.
struct LinePlot
{
    std::string title = {};
    std::string x_label = {};   ///< With its unit: "time [s]".
    std::string y_label = {};   ///< With its unit: "angle [deg]".
    std::vector<double> x = {}; ///< Ascending, finite.
    std::vector<PlotSeries> series = {};
    int width_px = 960;
    int height_px = 260;
};

/// Named bars from zero, with an optional +- standard deviation each.
struct BarPlot
{
    std::string title = {};
    std::string x_label = {};
    std::string y_label = {};
    std::vector<std::string> names = {};
    std::vector<double> values = {};              ///< NaN: no bar.
    std::vector<double> standard_deviations = {}; ///< Empty, or one a bar.
    int width_px = 960;
    int height_px = 240;
};

/// Round numbers (1, 2 or 5 times a power of ten apart), at most `max_count` of them and at least one, within
/// [low, high].
/// @throws InvalidArgument unless low < high, both finite, and max_count >= 2.
[[nodiscard]] std::vector<double> nice_ticks(double low, double high, int max_count);

/// The plot as one svg element with classes (`plot-line s0` ...) for the page's style sheet, a title for screen
/// readers, axes with round ticks and a legend. Where a line has far more points than the plot has pixels, each pixel
/// column keeps its first, last, smallest and largest value. All texts are escaped.
/// @throws InvalidArgument if a series is not as long as x, or x is not finite and ascending.
[[nodiscard]] std::string format_line_plot(const LinePlot& plot);

/// @throws InvalidArgument if the lists disagree in length.
[[nodiscard]] std::string format_bar_plot(const BarPlot& plot);

} // namespace lineament
