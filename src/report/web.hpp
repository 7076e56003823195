// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

/// The files of src/report/web, put into the library when it is built.
namespace lineament::html {

extern const std::string_view viewer_js;
extern const std::string_view page_js;
extern const std::string_view report_css;

} // namespace lineament::html
