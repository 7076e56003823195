// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/camera/camera.hpp"
#include "report/viewer_data.hpp"

#include <string>
#include <utility>
#include <vector>

/// Pieces that the fit report and the track report share. Arguments named `..._html` are HTML already, all others text.
namespace lineament::html {

/// A label and its value, both text.
using Fact = std::pair<std::string, std::string>;

/// The whole page: head with style and content policy (nothing may be loaded), heading, facts, body, scripts.
/// @param kind   What the page is: "Face fit".
/// @param title  What it is about: the name of the picture.
[[nodiscard]] std::string page(const std::string& kind, const std::string& title, const std::vector<Fact>& facts,
                               const std::string& body_html);

/// <section class="card"> with a heading.
[[nodiscard]] std::string card(const std::string& heading, const std::string& content_html);

/// <figure> of one picture. An empty address gives an empty text.
[[nodiscard]] std::string figure(const std::string& address, const std::string& alternative, const std::string& caption,
                                 const std::string& image_class = "");

/// Sections (name, HTML) under tabs; a single one stands without a tab.
[[nodiscard]] std::string tabs(const std::vector<std::pair<std::string, std::string>>& sections_html);

/// The viewer's place in the page and its data; `id` is unique in the page and of letters, digits and "-".
[[nodiscard]] std::string viewer(const std::string& id, const FaceView& view, const Eigen::Matrix3d& rotation_of_view,
                                 const Playback& playback = {});

/// The rounded label of a status; a status the style sheet does not know is shown as a warning.
[[nodiscard]] std::string status_label(const std::string& status);

/// How the angles are meant: a drawing of a head with its three axes and turning directions, with a caption.
[[nodiscard]] std::string axes_drawing();

} // namespace lineament::html
