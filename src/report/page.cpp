// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "report/page.hpp"

#include "report/html.hpp"
#include "report/web.hpp"

namespace lineament::html {

std::string page(const std::string& kind, const std::string& title, const std::vector<Fact>& facts,
                 const std::string& body_html)
{
    std::string text = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
                       "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
                       "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:\">\n"
                       "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
                       "<meta name=\"generator\" content=\"Lineament\">\n<title>";
    text += escape(title) + " – " + escape(kind) + "</title>\n<style>\n";
    text += report_css;
    text += "</style>\n</head>\n<body>\n<header>\n<p class=\"kind\">" + escape(kind) + "</p>\n<h1>" + escape(title) +
            "</h1>\n<dl class=\"facts\">";
    for (const auto& [label, value] : facts) {
        text += "<div><dt>" + escape(label) + "</dt><dd>" + escape(value) + "</dd></div>";
    }
    text += "</dl>\n</header>\n<main>\n" + body_html +
            "</main>\n<footer>\n<p>Made by Lineament. This page is one file: it loads nothing and sends nothing."
            "</p>\n</footer>\n<script>\n";
    text += viewer_js;
    text += "</script>\n<script>\n";
    text += page_js;
    text += "</script>\n</body>\n</html>\n";
    return text;
}

std::string card(const std::string& heading, const std::string& content_html)
{
    return "<section class=\"card\">\n<h2>" + escape(heading) + "</h2>\n" + content_html + "\n</section>\n";
}

std::string figure(const std::string& address, const std::string& alternative, const std::string& caption,
                   const std::string& image_class)
{
    if (address.empty()) {
        return "";
    }
    return "<figure><img class=\"" + escape(image_class) + "\" alt=\"" + escape(alternative) + "\" src=\"" + address +
           "\"><figcaption>" + escape(caption) + "</figcaption></figure>\n";
}

std::string tabs(const std::vector<std::pair<std::string, std::string>>& sections_html)
{
    if (sections_html.size() == 1) {
        return sections_html.front().second;
    }
    std::string list;
    std::string panels;
    for (std::size_t i = 0; i < sections_html.size(); ++i) {
        const std::string index = std::to_string(i);
        list += "<button type=\"button\" role=\"tab\" id=\"tab-" + index + "\" aria-controls=\"panel-" + index +
                "\" aria-selected=\"" + (i == 0 ? "true" : "false") + "\">" + escape(sections_html[i].first) +
                "</button>";
        panels += "<div role=\"tabpanel\" id=\"panel-" + index + "\" aria-labelledby=\"tab-" + index + "\">\n" +
                  sections_html[i].second + "</div>\n";
    }
    return list.empty() ? "" : "<div role=\"tablist\" aria-label=\"faces\">" + list + "</div>\n" + panels;
}

std::string viewer(const std::string& id, const FaceView& view, const Eigen::Matrix3d& rotation_of_view,
                   const Playback& playback)
{
    return "<script type=\"application/json\" id=\"" + id + "\">" + viewer_json(view, rotation_of_view, playback) +
           "</script>\n<div class=\"viewer\" data-face=\"" + id +
           "\"><p class=\"note\">The 3D view needs JavaScript and WebGL.</p></div>\n"
           "<p class=\"note\">Drag to turn, wheel or two fingers to zoom, Shift-drag to move, double click to reset; "
           "or arrow keys, + and \xE2\x88\x92, 0.</p>\n";
}

std::string status_label(const std::string& status)
{
    std::string style_class;
    for (const char c : status) {
        const bool is_plain = (c >= 'a' && c <= 'z') || c == '_';
        style_class += is_plain ? c : '-';
    }
    return "<span class=\"status " + style_class + "\">" + escape(status) + "</span>";
}

std::string axes_drawing()
{
    return R"html(<figure><svg class="axes" viewBox="0 0 330 210" role="img">
<title>A head seen from the front with the x axis to the subject's left, y up and z out of the face</title>
<g class="head">
<path d="M150 38c-40 0-58 28-58 66 0 44 26 86 58 86s58-42 58-86c0-38-18-66-58-66z"/>
<path d="M116 98q12-7 24 0M160 98q12-7 24 0M150 104l-8 30q8 6 16 0M130 158q20 10 40 0"/></g>
<g class="arrows">
<path stroke="#d0342c" d="M150 122H250M240 115l11 7-11 7"/>
<path stroke="#2a9d4a" d="M150 122V14M143 25l7-11 7 11"/>
<path stroke="#2f6fd6" d="M150 122l-42 50M111 158l-4 15 14-6"/></g>
<text x="216" y="142">x: subject&#39;s left</text>
<text x="158" y="22">y: up</text><text x="28" y="192">z: out of the face</text>
</svg><figcaption>Model space, seen from the camera, in millimetres. Frontal is (0°, 0°, 0°); the head is turned by
H = R<sub>y</sub>(yaw) R<sub>x</sub>(pitch) R<sub>z</sub>(roll), right-handed.</figcaption></figure>
)html";
}

} // namespace lineament::html
