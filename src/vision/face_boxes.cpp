// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: Bazarevsky et al., BlazeFace: Sub-millisecond Neural Face Detection on Mobile GPUs, CVPR Workshop 2019.
#include "face_boxes.hpp"

#include <algorithm>
#include <cmath>

namespace lineament {
namespace {

constexpr double max_overlap = 0.3;
constexpr std::size_t values_per_anchor = 16; // x, y, width, height, six points; relative to the anchor

void append_anchors(int size, int cells, int per_cell, std::vector<Eigen::Vector2d>& anchors)
{
    const double cell = static_cast<double>(size) / cells;
    for (int row = 0; row < cells; ++row) {
        for (int column = 0; column < cells; ++column) {
            anchors.insert(anchors.end(), per_cell, {cell * (column + 0.5), cell * (row + 0.5)});
        }
    }
}

} // namespace

std::vector<Eigen::Vector2d> make_anchors(int size)
{
    std::vector<Eigen::Vector2d> anchors;
    if (size == 128) {
        append_anchors(size, 16, 2, anchors);
        append_anchors(size, 8, 6, anchors);
    } else {
        append_anchors(size, 48, 1, anchors);
    }
    return anchors;
}

double intersection_over_union(const Eigen::AlignedBox2d& a, const Eigen::AlignedBox2d& b)
{
    const Eigen::AlignedBox2d shared = a.intersection(b);
    if (shared.isEmpty()) {
        return 0.0;
    }
    const double joint = a.volume() + b.volume() - shared.volume();
    return joint > 0.0 ? shared.volume() / joint : 0.0;
}

bool are_rivals(const BoxedFace& a, const BoxedFace& b)
{
    return intersection_over_union(a.box, b.box) > max_overlap;
}

void blend_overlapping(std::vector<BoxedFace>& faces)
{
    std::sort(faces.begin(), faces.end(), [](const BoxedFace& a, const BoxedFace& b) {
        return a.score != b.score ? a.score > b.score : a.box.min().x() < b.box.min().x();
    });
    // Faces before i are blended; those from i on belong to no group yet, best first.
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const BoxedFace best = faces[i];
        const auto grouped = [&best](const BoxedFace& face) { return are_rivals(face, best); };
        BoxedFace sum = {.box = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()}};
        for (std::size_t k = i; k < faces.size(); ++k) {
            if (k == i || grouped(faces[k])) {
                const double weight = faces[k].score;
                sum.box.min() += weight * faces[k].box.min();
                sum.box.max() += weight * faces[k].box.max();
                sum.right_eye += weight * faces[k].right_eye;
                sum.left_eye += weight * faces[k].left_eye;
                sum.score += weight;
            }
        }
        const auto behind = faces.begin() + static_cast<std::ptrdiff_t>(i) + 1;
        faces.erase(std::remove_if(behind, faces.end(), grouped), faces.end());
        faces[i].box = {Eigen::Vector2d(sum.box.min() / sum.score), Eigen::Vector2d(sum.box.max() / sum.score)};
        faces[i].right_eye = sum.right_eye / sum.score;
        faces[i].left_eye = sum.left_eye / sum.score;
    }
}

void merge_faces(std::vector<BoxedFace>& faces, std::vector<BoxedFace>& other)
{
    std::size_t num_losers = 0;
    for (BoxedFace face : other) {
        const auto rival = std::find_if(faces.begin(), faces.end(),
                                        [&](const BoxedFace& present) { return are_rivals(face, present); });
        if (rival == faces.end()) {
            faces.push_back(face);
            continue;
        }
        if (face.score > rival->score) {
            std::swap(*rival, face);
        }
        other[num_losers++] = face;
    }
    other.resize(num_losers);
}

BoxDetector::BoxDetector(network::Network network)
{
    const std::vector<int>& input = network.tensors[network.input].shape;
    const bool short_range = input.size() == 4 && input[1] == 128;
    size_ = short_range ? 128 : 192;
    anchors_ = make_anchors(size_);
    network::expect_shapes(network, {1, size_, size_, 3}, {values_per_anchor * anchors_.size(), anchors_.size()});
    engine_ = network::make_engine(std::move(network));
}

void BoxDetector::detect(const ImageU8& picture, double score_threshold, std::vector<BoxedFace>& faces)
{
    faces.clear();
    const SquareWindow window = window_around(picture);
    sample_window(picture, window, size_, Border::black, -1.0f, 1.0f, engine_->input());
    engine_->run();
    const std::span<const float> boxes = engine_->output(0);
    const std::span<const float> logits = engine_->output(1); // of the score
    const SquareWindow::Affine picture_from_window = window.picture_from_window(size_);
    for (std::size_t i = 0; i < anchors_.size(); ++i) {
        const double score = 1.0 / (1.0 + std::exp(-static_cast<double>(logits[i])));
        if (!(score >= score_threshold)) {
            continue;
        }
        const float* const values = &boxes[values_per_anchor * i];
        const auto pair = [values](int k) -> Eigen::Vector2d {
            return Eigen::Vector2f(values[k], values[k + 1]).cast<double>();
        };
        if (!Eigen::Map<const Eigen::Array<float, 8, 1>>(values).isFinite().all()) {
            continue;
        }
        const Eigen::Vector2d half = 0.5 * pair(2).cwiseAbs();
        const Eigen::Vector2d center = anchors_[i] + pair(0);
        faces.push_back({.box = {picture_from_window(center - half), picture_from_window(center + half)},
                         .right_eye = picture_from_window(anchors_[i] + pair(4)),
                         .left_eye = picture_from_window(anchors_[i] + pair(6)),
                         .score = score});
    }
    blend_overlapping(faces);
}

} // namespace lineament
