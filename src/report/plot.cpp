// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/plot.hpp"

#include "lineament/core/checks.hpp"
#include "report/html.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament {

namespace {

using html::escape;
using html::number;

struct Range
{
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();

    void include(double value)
    {
        if (std::isfinite(value)) {
            low = std::min(low, value);
            high = std::max(high, value);
        }
    }

    // Never empty: [0, 1] without a value, a unit about a single one.
    [[nodiscard]] Range widened(double fraction) const
    {
        if (!(low <= high)) {
            return {0.0, 1.0};
        }
        const double margin = high > low ? fraction * (high - low) : std::max(0.5, std::abs(high) * 0.1);
        return {low - margin, high + margin};
    }
};

// Digits after the point that tell ticks of this distance apart.
int tick_digits(double step)
{
    return std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9);
}

// The area of the plot [px] and the values at its edges.
struct Frame
{
    double left = 64;
    double right = 0;
    double top = 34;
    double bottom = 0;
    Range x = {};
    Range y = {};

    [[nodiscard]] double place_x(double value) const
    {
        return left + (right - left) * (value - x.low) / (x.high - x.low);
    }
    [[nodiscard]] double place_y(double value) const
    {
        return bottom - (bottom - top) * (value - y.low) / (y.high - y.low);
    }
};

std::string text_at(double x, double y, const char* style_class, const std::string& text)
{
    return "<text class=\"" + std::string(style_class) + "\" x=\"" + number(x, 1) + "\" y=\"" + number(y, 1) + "\">" +
           escape(text) + "</text>";
}

std::string line_from(double x1, double y1, double x2, double y2, const char* style_class)
{
    return "<path class=\"" + std::string(style_class) + "\" d=\"M" + number(x1, 1) + " " + number(y1, 1) + "L" +
           number(x2, 1) + " " + number(y2, 1) + "\"/>";
}

std::string open_svg(int width, int height, const std::string& title)
{
    return "<svg class=\"plot\" role=\"img\" viewBox=\"0 0 " + std::to_string(width) + " " + std::to_string(height) +
           "\"><title>" + escape(title) + "</title>" + text_at(0, 14, "plot-title", title);
}

std::string y_axis(const Frame& frame, const std::string& label)
{
    const std::vector<double> ticks = nice_ticks(frame.y.low, frame.y.high, 6);
    const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 1.0;
    std::string svg;
    for (const double tick : ticks) {
        const double y = frame.place_y(tick);
        svg += line_from(frame.left, y, frame.right, y, std::abs(tick) < 1e-9 * step ? "plot-zero" : "plot-grid");
        svg += text_at(frame.left - 8, y + 4, "plot-tick end", number(tick, tick_digits(step)));
    }
    const std::string middle = number((frame.top + frame.bottom) / 2, 1);
    svg += "<text class=\"plot-label middle\" transform=\"translate(13 " + middle + ") rotate(-90)\">" + escape(label) +
           "</text>";
    return svg;
}

std::string x_axis(const Frame& frame, const std::string& label)
{
    const std::vector<double> ticks = nice_ticks(frame.x.low, frame.x.high, 10);
    const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 1.0;
    std::string svg = line_from(frame.left, frame.bottom, frame.right, frame.bottom, "plot-axis");
    for (const double tick : ticks) {
        const double x = frame.place_x(tick);
        svg += line_from(x, frame.bottom, x, frame.bottom + 4, "plot-axis");
        svg += text_at(x, frame.bottom + 17, "plot-tick middle", number(tick, tick_digits(step)));
    }
    svg += text_at((frame.left + frame.right) / 2, frame.bottom + 34, "plot-label middle", label);
    return svg;
}

// Path data of one series: a new subpath after each gap; a lone point is a line of no length, drawn as a dot.
class PathWriter
{
public:
    explicit PathWriter(const Frame& frame) : frame_(frame) {}

    void add(double x, double y)
    {
        if (!std::isfinite(y)) {
            finish_run();
            return;
        }
        data_ += run_length_ == 0 ? 'M' : 'L';
        last_ = number(frame_.place_x(x), 1) + " " + number(frame_.place_y(y), 1);
        data_ += last_;
        ++run_length_;
    }

    [[nodiscard]] std::string finish()
    {
        finish_run();
        return std::move(data_);
    }

private:
    void finish_run()
    {
        if (run_length_ == 1) {
            data_ += "L" + last_;
        }
        run_length_ = 0;
    }

    const Frame& frame_;
    std::string data_ = {};
    std::string last_ = {};
    int run_length_ = 0;
};

std::string path_data(const Frame& frame, const std::vector<double>& x, const std::vector<double>& y)
{
    PathWriter path(frame);
    const auto column = [&](std::size_t i) { return static_cast<long>(frame.place_x(x[i])); };
    for (std::size_t begin = 0; begin < x.size();) {
        std::size_t end = begin;
        while (end < x.size() && column(end) == column(begin) && std::isfinite(y[end]) == std::isfinite(y[begin])) {
            ++end;
        }
        if (end - begin <= 4 || !std::isfinite(y[begin])) {
            for (std::size_t i = begin; i < end; ++i) {
                path.add(x[i], y[i]);
            }
        } else {
            const auto [smallest, largest] = std::minmax_element(y.begin() + begin, y.begin() + end);
            std::size_t kept[4] = {begin, static_cast<std::size_t>(smallest - y.begin()),
                                   static_cast<std::size_t>(largest - y.begin()), end - 1};
            std::sort(std::begin(kept), std::end(kept));
            const auto last = std::unique(std::begin(kept), std::end(kept));
            std::for_each(std::begin(kept), last, [&](std::size_t i) { path.add(x[i], y[i]); });
        }
        begin = end;
    }
    return path.finish();
}

std::string legend(const LinePlot& plot, const Frame& frame)
{
    std::string svg;
    double x = frame.right;
    for (std::size_t i = plot.series.size(); i-- > 0;) { // right to left, from the upper right corner
        x -= 30.0 + 6.8 * static_cast<double>(plot.series[i].name.size());
        const std::string color = "plot-line s" + std::to_string(i % 8);
        svg += line_from(x, 20, x + 16, 20, color.c_str());
        svg += text_at(x + 21, 24, "plot-tick", plot.series[i].name);
    }
    return svg;
}

} // namespace

std::vector<double> nice_ticks(double low, double high, int max_count)
{
    require(std::isfinite(low) && std::isfinite(high) && low < high, "nice_ticks", "low, high",
            "finite numbers with low < high", to_text(low) + ", " + to_text(high));
    require(max_count >= 2, "nice_ticks", "max_count", "at least 2", std::to_string(max_count));
    const double span = high - low;
    double power = std::pow(10.0, std::floor(std::log10(span / max_count)));
    const double slack = 1e-9;
    for (;; power *= 10.0) {
        for (const double factor : {1.0, 2.0, 5.0}) {
            const double step = factor * power;
            const double first = std::ceil(low / step - slack);
            const double last = std::floor(high / step + slack);
            if (last - first + 1.0 > max_count) {
                continue;
            }
            std::vector<double> ticks;
            for (double i = first; i <= last; i += 1.0) {
                ticks.push_back(i * step);
            }
            if (ticks.empty()) {
                ticks.push_back(low);
            }
            return ticks;
        }
    }
}

std::string format_line_plot(const LinePlot& plot)
{
    const char* const function = "format_line_plot";
    for (const PlotSeries& series : plot.series) {
        require(series.y.size() == plot.x.size(), function, "series.y", std::to_string(plot.x.size()) + " values",
                std::to_string(series.y.size()));
    }
    Frame frame;
    for (std::size_t i = 0; i < plot.x.size(); ++i) {
        require(std::isfinite(plot.x[i]) && (i == 0 || plot.x[i] >= plot.x[i - 1]), function, "x",
                "finite numbers in ascending order", to_text(plot.x[i]) + " at " + std::to_string(i));
        frame.x.include(plot.x[i]);
    }
    for (const PlotSeries& series : plot.series) {
        for (const double y : series.y) {
            frame.y.include(y);
        }
    }
    const bool has_values = frame.y.low <= frame.y.high;
    frame.x = frame.x.widened(0.0);
    frame.y = frame.y.widened(0.06);
    frame.right = plot.width_px - 12;
    frame.bottom = plot.height_px - 42;

    std::string svg = open_svg(plot.width_px, plot.height_px, plot.title);
    svg += y_axis(frame, plot.y_label) + x_axis(frame, plot.x_label) + legend(plot, frame);
    for (std::size_t i = 0; i < plot.series.size(); ++i) {
        const std::string data = path_data(frame, plot.x, plot.series[i].y);
        if (!data.empty()) {
            svg += "<path class=\"plot-line s" + std::to_string(i % 8) + "\" d=\"" + data + "\"/>";
        }
    }
    if (!has_values) {
        svg +=
            text_at((frame.left + frame.right) / 2, (frame.top + frame.bottom) / 2, "plot-label middle", "no values");
    }
    return svg + "</svg>";
}

std::string format_bar_plot(const BarPlot& plot)
{
    const char* const function = "format_bar_plot";
    const std::size_t count = plot.values.size();
    require(plot.names.size() == count, function, "names", std::to_string(count) + " names",
            std::to_string(plot.names.size()));
    require(plot.standard_deviations.empty() || plot.standard_deviations.size() == count, function,
            "standard_deviations", "none or " + std::to_string(count), std::to_string(plot.standard_deviations.size()));
    Frame frame;
    frame.y.include(0.0);
    for (std::size_t i = 0; i < count; ++i) {
        const double spread = plot.standard_deviations.empty() ? 0.0 : plot.standard_deviations[i];
        frame.y.include(plot.values[i] - spread);
        frame.y.include(plot.values[i] + spread);
    }
    frame.y = frame.y.widened(0.06);
    frame.x = {0.0, static_cast<double>(std::max<std::size_t>(count, 1))};
    frame.right = plot.width_px - 12;
    frame.bottom = plot.height_px - 42;
    frame.top = 26;

    std::string svg = open_svg(plot.width_px, plot.height_px, plot.title) + y_axis(frame, plot.y_label);
    const double pitch = (frame.right - frame.left) / frame.x.high;
    const double bar_width = std::min(0.72 * pitch, 42.0);
    const double zero = frame.place_y(0.0);
    std::size_t longest = 1;
    for (const std::string& name : plot.names) {
        longest = std::max(longest, name.size());
    }
    const auto label_every =
        static_cast<std::size_t>(std::max(1.0, std::ceil((7.0 * static_cast<double>(longest) + 4) / pitch)));
    for (std::size_t i = 0; i < count; ++i) {
        const double middle = frame.place_x(static_cast<double>(i) + 0.5);
        if (i % label_every == 0) {
            svg += text_at(middle, frame.bottom + 17, "plot-tick middle", plot.names[i]);
        }
        if (!std::isfinite(plot.values[i])) {
            continue;
        }
        const double end = frame.place_y(plot.values[i]);
        svg += "<rect class=\"plot-bar\" x=\"" + number(middle - bar_width / 2, 1) + "\" y=\"" +
               number(std::min(zero, end), 1) + "\" width=\"" + number(bar_width, 1) + "\" height=\"" +
               number(std::abs(zero - end), 1) + "\"><title>" + escape(plot.names[i]) + ": " +
               number(plot.values[i], 3) + "</title></rect>";
        if (!plot.standard_deviations.empty() && std::isfinite(plot.standard_deviations[i])) {
            svg += line_from(middle, frame.place_y(plot.values[i] - plot.standard_deviations[i]), middle,
                             frame.place_y(plot.values[i] + plot.standard_deviations[i]), "plot-spread");
        }
    }
    svg += line_from(frame.left, zero, frame.right, zero, "plot-axis");
    svg += text_at((frame.left + frame.right) / 2, frame.bottom + 34, "plot-label middle", plot.x_label);
    return svg + "</svg>";
}

} // namespace lineament
