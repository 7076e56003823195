// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "engine.hpp"
#include "square_window.hpp"

#include <Eigen/Geometry>

#include <memory>
#include <vector>

namespace lineament {

/// A face as one of the detection networks reports it, in the picture [px].
struct BoxedFace
{
    Eigen::AlignedBox2d box = {};
    Eigen::Vector2d right_eye = Eigen::Vector2d::Zero(); ///< The subject's.
    Eigen::Vector2d left_eye = Eigen::Vector2d::Zero();
    double score = 0.0; ///< (0, 1)
};

/// Shared area over joint area.
[[nodiscard]] double intersection_over_union(const Eigen::AlignedBox2d& a, const Eigen::AlignedBox2d& b);

/// Whether they overlap by more than 0.3.
[[nodiscard]] bool are_rivals(const BoxedFace& a, const BoxedFace& b);

/// Blends boxes that overlap by more than 0.3: each group around its best box becomes their mean weighted by score,
/// with the best score. Ordered by score afterwards.
/// @par Reference  Bazarevsky et al., BlazeFace, CVPR Workshop 2019, section 3.4.
void blend_overlapping(std::vector<BoxedFace>& faces);

/// Appends those faces of `other` that overlap none in `faces` by more than 0.3, or replaces the ones they beat.
/// `other` keeps the losers of both.
void merge_faces(std::vector<BoxedFace>& faces, std::vector<BoxedFace>& other);

/// Where the network places the boxes it answers with, in its input [px]: the centres of the cells of one or two grids.
/// @param size  Of the input: 128 (short range: 16 x 16 cells twice, 8 x 8 six times) or 192 (full range: 48 x 48).
[[nodiscard]] std::vector<Eigen::Vector2d> make_anchors(int size);

/// One of MediaPipe's two detection networks with its anchors.
class BoxDetector
{
public:
    /// @param network  Short range (128 x 128, 896 anchors) or full range (192 x 192, 2304).
    /// @throws IoError if it has another input or other outputs.
    explicit BoxDetector(network::Network network);

    /// As many faces as detect may list before it blends them.
    [[nodiscard]] std::size_t max_faces() const { return anchors_.size(); }

    /// The faces whose score reaches the threshold, best first; allocates nothing if `faces` has room for max_faces().
    void detect(const ImageU8& picture, double score_threshold, std::vector<BoxedFace>& faces);

private:
    std::unique_ptr<network::Engine> engine_;
    int size_ = 0;                              ///< Of the network's input [px].
    std::vector<Eigen::Vector2d> anchors_ = {}; ///< Centres, in the input [px].
};

} // namespace lineament
