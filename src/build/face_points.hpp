// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace lineament::build {

/// Base vertices of the landmarks 1 to 68 of the scheme ibug68 (their image left is the subject's right).
inline constexpr std::array<int, 68> landmark_base_vertices = {
    5738, 5661, 5421, 5242, 895,  5298,  5295, 5221, 5296, 11831, 11901, 11903, 7597, 11851, 12020, 12258, 12335, // jaw
    261,  225,  222,  205,  208,                                              // right brow
    6983, 6980, 6996, 6999, 7030,                                             // left brow
    132,  131,  201,  5054, 358,  359,   343,  7120, 7119,                    // nose
    21,   0,    54,   66,   47,   41,                                         // right eye
    6850, 6838, 6784, 6805, 6825, 6831,                                       // left eye
    425,  5354, 450,  455,  7210, 11956, 7185, 7239, 7241, 492,   486,   484, // outer lips
    429,  471,  474,  7227, 7189, 7242,  493,  487};                          // inner lips

/// Base vertices of the contour candidates of the subject's right, ear to chin; the left ones are their partners.
inline constexpr std::array<int, 30> right_contour_base_vertices = {
    5738, 5426, 5448, 5470, 5670, 5615, 5638, 5661, 5477, 5434, 5443, 5421, 5728, 5759, 5097,
    869,  5242, 5241, 895,  5240, 737,  5298, 5297, 5295, 5294, 5293, 5292, 5221, 5291, 5296};

} // namespace lineament::build
