// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "lineament/report/fit_report.hpp"

#include "lineament/camera/angles.hpp"
#include "lineament/report/plot.hpp"
#include "report/html.hpp"
#include "report/page.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lineament {

namespace {

using html::escape;
using html::number;

constexpr int max_picture_side_px = 1600;

std::string row(const std::string& name, const std::string& value, const std::string& unit, const std::string& meaning)
{
    return "<tr><th scope=\"row\">" + escape(name) + "</th><td>" + escape(value) + "</td><td class=\"text\">" +
           escape(unit) + "</td><td class=\"text note\">" + escape(meaning) + "</td></tr>";
}

std::string picture_section(const FitReport& report)
{
    if (report.picture.empty()) {
        return "";
    }
    const std::string picture = html::image_address(report.picture, max_picture_side_px);
    if (report.overlay.empty()) {
        return html::card("Picture", html::figure(picture, "The picture", ""));
    }
    const std::string overlay = html::image_address(report.overlay, max_picture_side_px);
    std::string content =
        "<div data-switch><div class=\"tools\"><div class=\"segments\" role=\"group\" "
        "aria-label=\"picture shown\"><button type=\"button\" data-show=\"overlay\" "
        "aria-pressed=\"true\">Overlay</button><button type=\"button\" data-show=\"original\" "
        "aria-pressed=\"false\">Original</button></div></div><figure>"
        "<img data-picture=\"overlay\" alt=\"The picture with the fitted face drawn over it\" src=\"" +
        overlay + "\"><img data-picture=\"original\" hidden alt=\"The picture\" src=\"" + picture +
        "\"><figcaption>Mesh: the fitted face. Discs: landmarks as detected; lines lead to where the "
        "fitted face has them. Axes at the nose: x red, y green, z blue.</figcaption></figure></div>";
    return html::card("Picture", content);
}

std::string pose_section(const FitReport& report, const FitReportFace& face)
{
    const Camera& camera = face.fit.camera;
    const HeadAngles angles = angles_from_rotation(camera.camera_from_model);
    const Eigen::Vector2d origin = camera.image_translation_px();
    std::string rows = row("yaw", number(degrees(angles.yaw), 1), "°", "> 0: the subject turns to its own left");
    rows += row("pitch", number(degrees(angles.pitch), 1), "°", "> 0: nose down");
    rows += row("roll", number(degrees(angles.roll), 1), "°", "> 0: tilt towards the subject's right shoulder");
    rows += row("x", number(camera.translation_mm.x(), 1), "mm", "of the head, to the right in the picture");
    rows += row("y", number(camera.translation_mm.y(), 1), "mm", "of the head, down in the picture");
    rows += row("scale", number(camera.scale_px_per_mm, 4), "px/mm", "at the depth of the head");
    if (camera.phi_per_mm > 0) {
        rows += row("distance", number(1.0 / camera.phi_per_mm, 0), "mm", "from the camera to the model's origin");
    }
    if (report.focal_px) {
        rows += row("focal length", number(*report.focal_px, 1), "px", "");
    }
    rows += row("origin seen at", number(origin.x(), 1) + ", " + number(origin.y(), 1), "px",
                "of the model; pixel centres at +0.5");
    return html::card("Pose",
                      "<div class=\"scroll\"><table><tbody>" + rows + "</tbody></table></div>" + html::axes_drawing());
}

std::string result_section(const FitReportFace& face)
{
    const FitResult& fit = face.fit;
    std::string content = "<p>" + html::status_label(to_string(fit.status));
    content += fit.reason.empty() ? "</p>" : " " + escape(fit.reason) + "</p>";
    const auto used = std::count_if(fit.landmarks.begin(), fit.landmarks.end(),
                                    [](const FittedLandmark& landmark) { return landmark.weight > 0; });
    std::string rows = row("method", fit.method, "", "");
    rows += row("landmarks used", std::to_string(used) + " of " + std::to_string(fit.landmarks.size()), "", "");
    rows += row("rms", number(fit.rms_px, 2), "px", "distance of the used landmarks from the fitted face");
    rows += row("χ²", number(fit.chi_square, 1), "",
                "at " + std::to_string(fit.degrees_of_freedom) + " degrees of freedom");
    rows += row("iterations", std::to_string(fit.iterations), "", "");
    content += "<div class=\"scroll\"><table><tbody>" + rows + "</tbody></table></div><h3>Time</h3>";
    std::string times = row("pose", number(fit.timing.pose_us, 0), "µs", "");
    times += row("identity", number(fit.timing.identity_us, 0), "µs", "");
    times += row("expression", number(fit.timing.expression_us, 0), "µs", "");
    times += row("contour", number(fit.timing.contour_us, 0), "µs", "");
    times += row("total", number(fit.timing.total_us, 0), "µs", "without detection and pictures");
    content += "<div class=\"scroll\"><table><tbody>" + times + "</tbody></table></div>";
    return html::card("Result", content);
}

std::string shape_section(const FitReportFace& face)
{
    const Eigen::VectorXd& alpha = face.fit.shape_coefficients;
    require(face.shape_standard_deviations.size() == 0 || face.shape_standard_deviations.size() == alpha.size(),
            "format_fit_report", "shape_standard_deviations", "none or " + std::to_string(alpha.size()),
            std::to_string(face.shape_standard_deviations.size()));
    if (alpha.size() == 0) {
        return "";
    }
    BarPlot plot;
    plot.title = "Shape coefficients α";
    plot.x_label = "component";
    plot.y_label = "standard deviations";
    for (Eigen::Index i = 0; i < alpha.size(); ++i) {
        plot.names.push_back(std::to_string(i + 1));
        plot.values.push_back(alpha[i]);
    }
    plot.standard_deviations.assign(face.shape_standard_deviations.begin(), face.shape_standard_deviations.end());
    std::string spread = face.shape_standard_deviations.size() > 0
                             ? " Dark lines: plus and minus one posterior standard deviation."
                             : "";
    if (face.predicted_rms_mm) {
        spread += " Expected error of the neutral face: " + number(*face.predicted_rms_mm, 1) +
                  " mm (root mean square over its vertices, the head's size included).";
    }
    return html::card("Identity",
                      "<div class=\"scroll plots\">" + format_bar_plot(plot) +
                          "</div><p class=\"note\">One unit is one standard deviation of the model's population; 0 is "
                          "its mean." +
                          spread + "</p>");
}

std::string expression_section(const FitReportFace& face)
{
    const FitResult& fit = face.fit;
    if (fit.expression_coefficients.size() == 0) {
        return "";
    }
    const double largest = std::max(1.0, fit.expression_coefficients.cwiseAbs().maxCoeff());
    std::string rows;
    for (Eigen::Index k = 0; k < fit.expression_coefficients.size(); ++k) {
        const double value = fit.expression_coefficients[k];
        const std::string name = static_cast<std::size_t>(k) < fit.expression_names.size()
                                     ? fit.expression_names[static_cast<std::size_t>(k)]
                                     : std::to_string(k + 1);
        const auto& hidden = face.unobservable_expressions;
        const bool is_hidden = std::find(hidden.begin(), hidden.end(), name) != hidden.end();
        rows += (is_hidden ? "<tr class=\"unused\"><th scope=\"row\">" : "<tr><th scope=\"row\">") + escape(name) +
                (is_hidden ? " (not observable)" : "") + "</th><td>" + number(value, 2) +
                "</td><td style=\"width:45%\"><span class=\"meter\" style=\"width:" +
                number(100.0 * std::abs(value) / largest, 1) + "%\"></span></td></tr>";
    }
    std::string note = "Set " + escape(fit.expression_set) + "; 0 is neutral, 1 the full expression.";
    if (!face.unobservable_expressions.empty()) {
        note += " Not observable: the landmarks do not move enough to tell the value.";
    }
    return html::card("Expression", "<div class=\"scroll tall\"><table><thead><tr><th scope=\"col\">name</th><th "
                                    "scope=\"col\">value</th><th></th></tr></thead><tbody>" +
                                        rows + "</tbody></table></div><p class=\"note\">" + note + "</p>");
}

std::string residual_section(const FitReportFace& face)
{
    const std::vector<FittedLandmark>& landmarks = face.fit.landmarks;
    if (landmarks.empty()) {
        return "";
    }
    BarPlot plot;
    plot.title = "Distance of each landmark from the fitted face";
    plot.x_label = "landmark";
    plot.y_label = "distance [px]";
    std::string rows;
    std::vector<double> used;
    for (const FittedLandmark& landmark : landmarks) {
        const bool is_used = landmark.weight > 0;
        const double distance = (landmark.fitted_px - landmark.point_px).norm();
        plot.names.push_back(landmark.name);
        plot.values.push_back(is_used ? distance : std::numeric_limits<double>::quiet_NaN());
        if (is_used) {
            used.push_back(distance);
        }
        const std::string none = "\xE2\x80\x93";
        rows += (is_used ? "<tr><th scope=\"row\">" : "<tr class=\"unused\"><th scope=\"row\">") +
                escape(landmark.name) + "</th><td>" + number(landmark.point_px.x(), 1) + "</td><td>" +
                number(landmark.point_px.y(), 1) + "</td><td>" + (is_used ? number(landmark.fitted_px.x(), 1) : none) +
                "</td><td>" + (is_used ? number(landmark.fitted_px.y(), 1) : none) + "</td><td>" +
                (is_used ? number(distance, 2) : none) + "</td><td>" + number(landmark.weight, 2) + "</td></tr>";
    }
    std::string summary = "No landmark was used.";
    if (!used.empty()) {
        std::sort(used.begin(), used.end());
        summary = "Median " + number(used[used.size() / 2], 2) + " px, largest " + number(used.back(), 2) +
                  " px, rms " + number(face.fit.rms_px, 2) + " px. Landmarks without a bar were not used.";
    }
    return html::card(
        "Residuals",
        "<div class=\"scroll plots\">" + format_bar_plot(plot) + "</div><p class=\"note\">" + summary +
            "</p><details><summary>Table of all landmarks</summary><div class=\"scroll tall\"><table><thead><tr><th "
            "scope=\"col\">landmark</th><th scope=\"col\">seen x [px]</th><th scope=\"col\">y [px]</th><th "
            "scope=\"col\">fitted x [px]</th><th scope=\"col\">y [px]</th><th scope=\"col\">distance [px]</th><th "
            "scope=\"col\">weight</th></tr></thead><tbody>" +
            rows + "</tbody></table></div></details>");
}

std::string pictures_section(const FitReportFace& face)
{
    std::string cards;
    if (!face.frontal.empty()) {
        cards += html::card("Frontal view", html::figure(html::image_address(face.frontal, 900),
                                                         "The fitted face from the front, without expression",
                                                         "The face turned to the front, its expression taken away."));
    }
    const ImageU8& texture = face.view.texture;
    if (!texture.empty()) {
        const std::string address = html::image_address(texture, 900);
        cards += html::card("Texture map", html::figure(address, "The texture in the model's uv space",
                                                        "The picture's colours in the model's uv space; chequered: not "
                                                        "seen in the picture.",
                                                        "checker"));
    }
    if (!face.uncertainty.empty()) {
        cards += html::card("Certainty",
                            html::figure(html::image_address(face.uncertainty, 900),
                                         "The face coloured by the standard deviation of each vertex",
                                         "Posterior standard deviation of each vertex of the neutral face, the size of "
                                         "the head included. It holds for faces that the model can show; of a real "
                                         "face it is a lower bound."));
    }
    return cards.empty() ? "" : "<div class=\"grid\">" + cards + "</div>\n";
}

std::string face_section(const FitReport& report, const FitReportFace& face, std::size_t index)
{
    std::string body;
    if (face.view.neutral.num_triangles() > 0) {
        const Eigen::Matrix3d head = frontal_rotation() * face.fit.camera.camera_from_model;
        body += html::card("3D view", html::viewer("view-" + std::to_string(index), face.view, head));
    }
    body += "<div class=\"grid\">" + pose_section(report, face) + result_section(face) + "</div>\n";
    body += pictures_section(face);
    body += shape_section(face) + expression_section(face) + residual_section(face);
    return body;
}

} // namespace

std::string format_fit_report(const FitReport& report)
{
    std::vector<html::Fact> facts;
    if (!report.picture.empty()) {
        facts.emplace_back("picture", std::to_string(report.picture.width) + " × " +
                                          std::to_string(report.picture.height) + " px");
    }
    facts.emplace_back("faces", std::to_string(report.faces.size()));
    if (!report.model_name.empty()) {
        facts.emplace_back("model", report.model_name);
    }
    if (!report.program.empty()) {
        facts.emplace_back("made by", report.program);
    }
    std::string body = picture_section(report);
    if (report.faces.empty()) {
        body += html::card("Result", "<p>No face was found in this picture.</p>");
    }
    std::vector<std::pair<std::string, std::string>> sections;
    for (std::size_t i = 0; i < report.faces.size(); ++i) {
        sections.emplace_back(report.faces[i].id, face_section(report, report.faces[i], i));
    }
    body += html::tabs(sections);
    return html::page("Face fit", report.title, facts, body);
}

} // namespace lineament
