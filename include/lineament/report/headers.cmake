# SPDX-FileCopyrightText: The Lineament authors
# SPDX-License-Identifier: Apache-2.0
set(headers
    face_view.hpp
    fit_report.hpp
    overlay.hpp
    plot.hpp
    track_report.hpp)
