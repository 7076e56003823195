// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/angles.hpp"
#include "lineament/report/fit_report.hpp"
#include "lineament/report/track_report.hpp"
#include "support/synthetic_face.hpp"

#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace lineament::test {

/// A text that would break out of HTML text, attributes and scripts if it were not escaped.
inline const std::string canary = "</script><img src=x onerror=alert(1)>\"'&amp;<!--";

/// A fit of the model with known coefficients, landmarks 2 px off, every ninth unused.
inline FitResult make_fit(const MorphableModel& model, std::uint64_t seed)
{
    Random random(seed);
    const Blendshapes& expressions = model.expression_sets.front();
    FitResult fit;
    fit.status = FitStatus::success;
    fit.camera = random_camera(random, 30.0);
    fit.shape_coefficients = random_normal(random, model.shape.num_coefficients());
    fit.expression_set = expressions.name;
    fit.expression_names = expressions.names;
    fit.expression_coefficients = random_uniform(random, expressions.num_coefficients(), 0.0, 0.8);
    const LandmarkSet exact = project_landmarks(model, "ibug68", fit.shape_coefficients, fit.expression_coefficients,
                                                fit.camera, 0.0, random);
    for (std::size_t i = 0; i < exact.landmarks.size(); ++i) {
        const Eigen::Vector2d fitted = exact.landmarks[i].point_px;
        const Eigen::Vector2d seen = fitted + Eigen::Vector2d{2.0 * random.normal(), 2.0 * random.normal()};
        fit.landmarks.push_back({exact.landmarks[i].name, seen, fitted, i % 9 == 0 ? 0.0 : 1.0});
    }
    fit.rms_px = 2.83;
    fit.timing.total_us = 140;
    return fit;
}

inline ImageU8 make_texture(int channels)
{
    ImageU8 texture(64, 64, channels);
    for (int row = 0; row < texture.height; ++row) {
        for (int column = 0; column < texture.width; ++column) {
            for (int c = 0; c < channels; ++c) {
                texture.at(column, row, c) = static_cast<std::uint8_t>(c == 3 ? 255 : 120 + 40 * c + column / 2);
            }
        }
    }
    return texture;
}

inline FitReport make_fit_report(int num_faces, const std::string& name)
{
    const MorphableModel model = make_synthetic_face();
    FitReport report;
    report.title = name;
    report.picture = ImageU8(640, 480, 3, 90);
    report.overlay = ImageU8(640, 480, 3, 120);
    report.model_name = name;
    for (int i = 0; i < num_faces; ++i) {
        FitReportFace face;
        face.id = name + std::to_string(i);
        face.fit = make_fit(model, static_cast<std::uint64_t>(i) + 1);
        face.view = make_face_view(model, face.fit, make_texture(4));
        face.frontal = ImageU8(64, 64, 3, 200);
        face.shape_standard_deviations = Eigen::VectorXd::Constant(face.fit.shape_coefficients.size(), 0.3);
        report.faces.push_back(std::move(face));
    }
    return report;
}

/// Thirty frames at 25 a second, the face lost from frame 10 to 14.
inline TrackReport make_track_report(const std::string& name)
{
    const MorphableModel model = make_synthetic_face({.num_expressions = 8});
    TrackReport report;
    report.title = name;
    report.width = 640;
    report.height = 480;
    report.frame_rate = 25.0;
    report.model_name = name;
    report.expression_names = model.expression_sets.front().names;
    for (int i = 0; i < 30; ++i) {
        TrackRow row;
        row.frame = i;
        row.time_s = i / 25.0;
        row.status = "no_face";
        if (i < 10 || i >= 15) {
            row.face = 1;
            row.status = "success";
            row.camera = Camera{};
            row.camera->camera_from_model = rotation_from_angles({0.02 * i, -0.01 * i, 0.005 * i});
            row.rms_px = 2.0 + 0.1 * i;
            row.expression_coefficients = Eigen::VectorXd::Constant(8, 0.03 * i);
        }
        report.rows.push_back(row);
    }
    TrackReportFace face;
    FitResult neutral;
    neutral.expression_set = model.expression_sets.front().name;
    face.view = make_face_view(model, neutral, make_texture(3));
    face.texture_confidence = ImageU8(64, 64, 1, 100);
    report.faces.push_back(std::move(face));
    report.thumbnails.push_back({0.4, ImageU8(320, 240, 3, 100)});
    return report;
}

/// Elements that are opened and never closed, or closed and never opened; empty for a well-formed page.
inline std::string unbalanced_elements(const std::string& page)
{
    static const std::vector<std::string> empty_elements = {"meta", "img", "input", "br"};
    std::vector<std::string> open;
    for (std::size_t i = page.find('<'); i != std::string::npos; i = page.find('<', i)) {
        const std::size_t end = page.find('>', i);
        if (end == std::string::npos) {
            return "an element without its end";
        }
        const bool is_closing = page[i + 1] == '/';
        const std::size_t begin = i + (is_closing ? 2 : 1);
        const std::string name = page.substr(begin, page.find_first_of(" >/\n", begin) - begin);
        const bool closes_itself = page[end - 1] == '/';
        i = end;
        if (name.starts_with("!") || closes_itself ||
            std::find(empty_elements.begin(), empty_elements.end(), name) != empty_elements.end()) {
            continue;
        }
        if (!is_closing) {
            open.push_back(name);
            if (name == "script" || name == "style") { // their text is not HTML
                i = page.find("</" + name, i);
            }
        } else if (open.empty() || open.back() != name) {
            return "</" + name + "> within <" + (open.empty() ? "" : open.back()) + ">";
        } else {
            open.pop_back();
        }
    }
    return open.empty() ? "" : "<" + open.back() + "> without an end";
}

/// The text between two marks after the first occurrence of `start`.
inline std::string text_between(const std::string& page, const std::string& start, const std::string& end)
{
    const std::size_t begin = page.find(start);
    if (begin == std::string::npos) {
        return "";
    }
    return page.substr(begin + start.size(), page.find(end, begin + start.size()) - begin - start.size());
}

/// RFC 4648 decoding, written apart from the encoder.
inline std::string decode_base64(const std::string& text)
{
    std::map<char, unsigned> value_of;
    const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (unsigned i = 0; i < alphabet.size(); ++i) {
        value_of[alphabet[i]] = i;
    }
    std::string bytes;
    unsigned bits = 0;
    int num_bits = 0;
    for (const char c : text) {
        if (c == '=') {
            break;
        }
        bits = bits << 6 | value_of.at(c);
        num_bits += 6;
        if (num_bits >= 8) {
            num_bits -= 8;
            bytes += static_cast<char>(bits >> num_bits & 255);
        }
    }
    return bytes;
}

} // namespace lineament::test
