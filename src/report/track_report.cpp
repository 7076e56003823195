// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/track_report.hpp"

#include "lineament/report/plot.hpp"
#include "report/html.hpp"
#include "report/page.hpp"
#include "report/track_series.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lineament {

namespace {

using html::escape;
using html::number;
using html::TrackSeries;

constexpr std::size_t max_played_frames = 3000;
constexpr std::size_t max_expression_lines = 6;

std::string time_plot(const std::string& title, const std::string& y_label, const TrackSeries& series,
                      std::vector<PlotSeries> lines)
{
    LinePlot plot;
    plot.title = title;
    plot.x_label = "time [s]";
    plot.y_label = y_label;
    plot.x = series.time_s;
    plot.series = std::move(lines);
    return format_line_plot(plot);
}

double range_of(const std::vector<double>& values)
{
    double low = INFINITY;
    double high = -INFINITY;
    for (const double value : values) {
        if (std::isfinite(value)) {
            low = std::min(low, value);
            high = std::max(high, value);
        }
    }
    return low <= high ? high - low : 0.0;
}

std::string motion_section(const TrackSeries& series)
{
    std::string plots = time_plot("Head angles", "angle [°]", series,
                                  {{"yaw", series.yaw_deg}, {"pitch", series.pitch_deg}, {"roll", series.roll_deg}});
    plots += time_plot("Head position in the picture plane", "position [mm]", series,
                       {{"x (right)", series.x_mm}, {"y (down)", series.y_mm}});
    plots += time_plot("Scale", "scale [px/mm]", series, {{"scale", series.scale_px_per_mm}});
    plots += time_plot("Distance of the landmarks from the fitted face", "rms [px]", series, {{"rms", series.rms_px}});
    return html::card("Over time", "<div class=\"scroll plots\">" + plots +
                                       "</div><p class=\"note\">Lines break where the face was not found. yaw > 0: the "
                                       "subject turns to its own left; pitch > 0: nose down; roll > 0: tilt towards "
                                       "the subject's right shoulder.</p>");
}

std::string expression_section(const TrackReport& report, const TrackReportFace& face, const TrackSeries& series)
{
    const std::size_t count = report.expression_names.size();
    if (count == 0) {
        return "";
    }
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return range_of(series.expressions[a]) > range_of(series.expressions[b]);
    });
    order.resize(std::min(count, max_expression_lines));
    std::sort(order.begin(), order.end());
    std::vector<PlotSeries> lines;
    for (const std::size_t k : order) {
        lines.push_back({report.expression_names[k], series.expressions[k]});
    }
    const std::string title =
        count > order.size() ? "The " + std::to_string(order.size()) + " that change most" : std::string("Values");
    std::string content =
        "<div class=\"scroll plots\">" + time_plot(title, "value", series, std::move(lines)) + "</div>";
    if (count > order.size() && !series.time_s.empty()) {
        std::string names;
        for (const std::string& name : report.expression_names) {
            names += "<span>" + escape(name) + "</span>";
        }
        content += "<h3>All over time</h3><div class=\"scroll\"><div class=\"heat\"><div class=\"names\">" + names +
                   "</div><img alt=\"Expression values over time, one row an expression\" src=\"" +
                   html::image_address(html::expression_heat_map(series, 900), 1 << 20) + "\"></div></div>" +
                   "<p class=\"note\">From left to right the whole video, " + number(series.time_s.front(), 1) +
                   " to " + number(series.time_s.back(), 1) +
                   " s. The stronger the colour, the larger the value, full from 1 on; grey: face not found.</p>";
    }
    if (!face.unobservable_expressions.empty()) {
        std::string names;
        for (const std::string& name : face.unobservable_expressions) {
            names += (names.empty() ? "" : ", ") + escape(name);
        }
        content +=
            "<p class=\"note\">Not observable: " + names + ". The landmarks do not move enough to tell the value.</p>";
    }
    return html::card("Expression", content);
}

std::string status_section(const TrackSeries& series)
{
    const double total = std::max<double>(1.0, static_cast<double>(series.time_s.size()));
    std::string rows;
    for (const auto& [status, count] : series.status_counts) {
        rows += "<tr><th scope=\"row\">" + html::status_label(status) + "</th><td>" + std::to_string(count) +
                "</td><td>" + number(100.0 * count / total, 1) +
                "</td><td style=\"width:50%\"><span class=\"meter\" style=\"width:" + number(100.0 * count / total, 1) +
                "%\"></span></td></tr>";
    }
    return html::card("Status of the frames",
                      "<div class=\"scroll\"><table><thead><tr><th scope=\"col\">status</th><th scope=\"col\">frames"
                      "</th><th scope=\"col\">%</th><th></th></tr></thead><tbody>" +
                          rows + "</tbody></table></div>");
}

std::string texture_sections(const TrackReportFace& face)
{
    std::string cards;
    const ImageU8& texture = face.view.texture;
    if (!texture.empty()) {
        const std::string address = html::image_address(texture, 900);
        cards += html::card("Texture map", html::figure(address, "The fused texture in the model's uv space",
                                                        "Fused from the video, in the model's uv space.", "checker"));
    }
    if (!face.texture_confidence.empty()) {
        cards += html::card("Confidence of the texture",
                            html::figure(html::image_address(face.texture_confidence, 900),
                                         "The confidence of each texel in the model's uv space",
                                         "Brighter: seen better, from the front and in more frames."));
    }
    return cards;
}

std::string face_section(const TrackReport& report, const TrackReportFace& face, std::size_t index)
{
    const TrackSeries series = html::collect_series(report, face.id);
    const std::size_t num_frames = series.time_s.size();
    const std::size_t stride = std::max<std::size_t>(1, (num_frames + max_played_frames - 1) / max_played_frames);
    std::string body;
    if (face.view.neutral.num_triangles() > 0) {
        std::string content = html::viewer("view-" + std::to_string(index), face.view, Eigen::Matrix3d::Identity(),
                                           html::make_playback(report, series, face.view, stride));
        if (stride > 1) {
            content += "<p class=\"note\">Played: one frame in " + std::to_string(stride) + ".</p>";
        }
        body += html::card("3D view", content);
    }
    body += motion_section(series) + expression_section(report, face, series);
    body += "<div class=\"grid\">" + status_section(series) + html::card("Axes", html::axes_drawing()) +
            texture_sections(face) + "</div>\n";
    return body;
}

std::string strip_section(const TrackReport& report)
{
    std::string pictures;
    for (const TrackReportThumbnail& thumbnail : report.thumbnails) {
        if (!thumbnail.picture.empty()) {
            const std::string time = number(thumbnail.time_s, 2) + " s";
            pictures += html::figure(html::image_address(thumbnail.picture, 320), "Frame at " + time, time);
        }
    }
    return pictures.empty() ? "" : html::card("Pictures", "<div class=\"strip\">" + pictures + "</div>");
}

std::vector<html::Fact> facts_of(const TrackReport& report, const TrackSeries& series)
{
    std::vector<html::Fact> facts;
    if (report.width > 0) {
        facts.emplace_back("video", std::to_string(report.width) + " × " + std::to_string(report.height) + " px");
    }
    facts.emplace_back("frames", std::to_string(series.time_s.size()));
    if (!series.time_s.empty()) {
        facts.emplace_back("duration", number(series.time_s.back() - series.time_s.front(), 2) + " s");
    }
    if (report.frame_rate) {
        facts.emplace_back("frame rate", number(*report.frame_rate, 2) + " /s");
    }
    facts.emplace_back("persons", std::to_string(report.faces.size()));
    if (!report.model_name.empty()) {
        facts.emplace_back("model", report.model_name);
    }
    if (!report.program.empty()) {
        facts.emplace_back("made by", report.program);
    }
    return facts;
}

} // namespace

std::string format_track_report(const TrackReport& report)
{
    const TrackSeries all = html::collect_series(report, report.faces.empty() ? 1 : report.faces.front().id);
    std::vector<std::pair<std::string, std::string>> sections;
    for (std::size_t i = 0; i < report.faces.size(); ++i) {
        sections.emplace_back("face " + std::to_string(report.faces[i].id), face_section(report, report.faces[i], i));
    }
    std::string body;
    if (!report.is_complete) {
        body += html::card("Incomplete", "<p>The run was interrupted or the video broke off: the frames after that are "
                                         "not in this report.</p>");
    }
    body += strip_section(report);
    if (sections.empty()) {
        body += html::card("Result", "<p>No face was found in this video.</p>") + status_section(all);
    }
    body += html::tabs(sections);
    return html::page("Face track", report.title, facts_of(report, all), body);
}

} // namespace lineament
