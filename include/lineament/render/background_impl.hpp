// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/background.hpp" // IWYU pragma: keep

#include "lineament/core/checks.hpp"
#include "lineament/core/image.hpp"
#include "lineament/render/inline.hpp"
#include "lineament/render/rasterizer.hpp"
#include "lineament/render/rasterizer_support_impl.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lineament {

namespace detail {

/// Sums over boxes of an image by its integral image: number of cells, three colour sums, sum of squared norms.
class ColorMoments
{
public:
    ColorMoments(int width, int height) : width_(width), sums_(static_cast<std::size_t>(width + 1) * (height + 1))
    {
        for (Moments& sum : sums_) {
            sum.setZero();
        }
    }
    // Cells must be given row by row.
    void set(int column, int row, bool is_counted, const Eigen::Array3f& color)
    {
        Moments own = Moments::Zero();
        if (is_counted) {
            own << 1.0, color.cast<double>(), color.cast<double>().square().sum();
        }
        at(column + 1, row + 1) = own + at(column, row + 1) + at(column + 1, row) - at(column, row);
    }
    using Moments = Eigen::Array<double, 5, 1>;
    /// Over [left, right) x [top, bottom), which must lie in the image.
    [[nodiscard]] Moments sum(int left, int top, int right, int bottom) const
    {
        return at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top);
    }

private:
    [[nodiscard]] Moments& at(int column, int row)
    {
        return sums_[static_cast<std::size_t>(row) * (width_ + 1) + column];
    }
    [[nodiscard]] const Moments& at(int column, int row) const
    {
        return sums_[static_cast<std::size_t>(row) * (width_ + 1) + column];
    }
    int width_;
    std::vector<Moments> sums_;
};

/// Distance of each cell to the nearest one whose mask is `value`, in cells, by two sweeps (chamfer 3-4, within 8 %).
inline ImageF distance_to(const Image<std::uint8_t>& mask, std::uint8_t value)
{
    ImageF distance(mask.width, mask.height, 1, 1e6F);
    const auto relax = [&](int column, int row, int from_column, int from_row, float step) {
        if (from_column >= 0 && from_column < mask.width && from_row >= 0 && from_row < mask.height) {
            distance.at(column, row) = std::min(distance.at(column, row), distance.at(from_column, from_row) + step);
        }
    };
    constexpr float diagonal = 4.0F / 3.0F;
    for (int row = 0; row < mask.height; ++row) {
        for (int column = 0; column < mask.width; ++column) {
            if (mask.at(column, row) == value) {
                distance.at(column, row) = 0.0F;
            }
            relax(column, row, column - 1, row, 1.0F);
            relax(column, row, column - 1, row - 1, diagonal);
            relax(column, row, column, row - 1, 1.0F);
            relax(column, row, column + 1, row - 1, diagonal);
        }
    }
    for (int row = mask.height - 1; row >= 0; --row) {
        for (int column = mask.width - 1; column >= 0; --column) {
            relax(column, row, column + 1, row, 1.0F);
            relax(column, row, column + 1, row + 1, diagonal);
            relax(column, row, column, row + 1, 1.0F);
            relax(column, row, column - 1, row + 1, diagonal);
        }
    }
    return distance;
}

} // namespace detail

LINEAMENT_RENDER_INLINE void BackgroundOptions::check() const
{
    const char* const function = "BackgroundOptions";
    require(strip_mm >= 5 && strip_mm <= 60, function, "strip_mm", "a number in [5, 60]", to_text(strip_mm));
    require(prior_inside >= 0 && prior_inside <= 20, function, "prior_inside", "a number in [0, 20]",
            to_text(prior_inside));
    require(color_noise >= 1 && color_noise <= 100, function, "color_noise", "a number in [1, 100]",
            to_text(color_noise));
}

LINEAMENT_RENDER_INLINE ImageF foreground_probability(const Image<std::uint8_t>& covered, const ImageF& colors,
                                                      const Image<std::uint8_t>& in_picture, double cell_mm,
                                                      const BackgroundOptions& options)
{
    const char* const function = "foreground_probability";
    options.check();
    require(cell_mm > 0, function, "cell_mm", "a number > 0", to_text(cell_mm));
    const int width = covered.width;
    const int height = covered.height;
    require_size(colors.width, width, function, "colors.width");
    require_size(colors.height, height, function, "colors.height");
    require_size(colors.channels, 3, function, "colors.channels");
    require_size(in_picture.width, width, function, "in_picture.width");
    require_size(in_picture.height, height, function, "in_picture.height");
    constexpr double clear_of_outline_mm = 2.5; // outside; the outline itself is blurred
    constexpr double near_outside_mm = 25.0;
    const double near_inside_mm = options.strip_mm + 20.0;
    constexpr double min_area_mm2 = 100.0; // a distribution of less says nothing
    const ImageF inwards = detail::distance_to(covered, 0);
    const ImageF outwards = detail::distance_to(covered, 1);

    detail::ColorMoments inside(width, height);
    detail::ColorMoments outside(width, height);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            const bool is_seen = in_picture.at(column, row) != 0;
            const Eigen::Array3f color(colors.at(column, row, 0), colors.at(column, row, 1), colors.at(column, row, 2));
            inside.set(column, row, is_seen && inwards.at(column, row) * cell_mm > options.strip_mm, color);
            outside.set(column, row, is_seen && outwards.at(column, row) * cell_mm > clear_of_outline_mm, color);
        }
    }
    struct Normal
    {
        Eigen::Array3d mean = Eigen::Array3d::Zero();
        double variance = 0.0;
        double log_density(const Eigen::Array3d& color) const
        {
            return -0.5 * (color - mean).square().sum() / variance - 1.5 * std::log(variance);
        }
    };
    const double noise = options.color_noise * options.color_noise;
    const double min_cells = min_area_mm2 / (cell_mm * cell_mm);
    const auto around = [&](const detail::ColorMoments& moments, int column, int row, double reach_mm, Normal& normal) {
        const int reach = static_cast<int>(std::lround(reach_mm / cell_mm));
        const detail::ColorMoments::Moments sum =
            moments.sum(std::max(0, column - reach), std::max(0, row - reach), std::min(width, column + reach + 1),
                        std::min(height, row + reach + 1));
        if (sum[0] < min_cells) {
            return false;
        }
        normal.mean = sum.segment<3>(1) / sum[0];
        normal.variance = std::max(0.0, (sum[4] / sum[0] - normal.mean.square().sum()) / 3.0) + noise;
        return true;
    };

    ImageF probability(width, height, 1, 1.0F);
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            const double depth = inwards.at(column, row) * cell_mm / options.strip_mm;
            Normal in;
            Normal out;
            if (covered.at(column, row) == 0 || depth > 1.0 || !around(inside, column, row, near_inside_mm, in) ||
                !around(outside, column, row, near_outside_mm, out)) {
                continue;
            }
            const Eigen::Array3d color(colors.at(column, row, 0), colors.at(column, row, 1), colors.at(column, row, 2));
            const double log_odds = in.log_density(color) - out.log_density(color) + options.prior_inside * depth;
            probability.at(column, row) = static_cast<float>(1.0 / (1.0 + std::exp(-log_odds)));
        }
    }
    return probability;
}

LINEAMENT_RENDER_INLINE ForegroundTest::ForegroundTest(const Eigen::Matrix3Xf& vertices,
                                                       const Eigen::Matrix3Xi& triangles, const Camera& camera,
                                                       const ImageU8& picture, const BackgroundOptions& options)
{
    detail::require_scene(vertices, triangles, camera, picture.width, picture.height, "ForegroundTest");
    options.check();
    constexpr double finest_cell_mm = 2.0;
    constexpr double border_mm = 25.0;
    const detail::Bounds bounds = detail::bounds_in_picture(vertices, camera);
    const double border_px = border_mm * camera.scale_px_per_mm;
    const Eigen::Vector2d low = (bounds.low.array() - border_px).max(-border_px);
    const Eigen::Vector2d high =
        (bounds.high.array() + border_px).min(Eigen::Array2d(picture.width, picture.height) + border_px);
    if (picture.empty() || !((high - low).minCoeff() > 0)) {
        return;
    }
    origin_px_ = low;
    constexpr double most_cells = 512.0; // a side: reached only by a mesh that the camera nearly touches
    cell_px_ = std::max({1.0, finest_cell_mm * camera.scale_px_per_mm, (high - low).maxCoeff() / most_cells});
    const int width = static_cast<int>(std::ceil((high.x() - low.x()) / cell_px_));
    const int height = static_cast<int>(std::ceil((high.y() - low.y()) / cell_px_));
    Camera grid_camera = camera;
    grid_camera.scale_px_per_mm /= cell_px_;
    grid_camera.principal_point_px = (camera.principal_point_px - low) / cell_px_;
    const ImageF depth = render_depth(vertices, triangles, grid_camera, width, height);

    Image<std::uint8_t> covered(width, height, 1);
    Image<std::uint8_t> in_picture(width, height, 1);
    ImageF colors(width, height, 3);
    const int num_samples = std::min(4, static_cast<int>(std::ceil(cell_px_))); // per side of a cell
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            covered.at(column, row) = std::isfinite(depth.at(column, row)) ? 1 : 0;
            const Eigen::Vector2d corner_px = low + cell_px_ * Eigen::Vector2d(column, row);
            const Eigen::Vector2d end_px = corner_px.array() + cell_px_;
            in_picture.at(column, row) =
                corner_px.minCoeff() >= 0 && end_px.x() <= picture.width && end_px.y() <= picture.height ? 1 : 0;
            if (in_picture.at(column, row) == 0) {
                continue;
            }
            int sums[3] = {};
            for (int j = 0; j < num_samples; ++j) {
                const int y = static_cast<int>(corner_px.y() + cell_px_ * (j + 0.5) / num_samples);
                for (int i = 0; i < num_samples; ++i) {
                    const int x = static_cast<int>(corner_px.x() + cell_px_ * (i + 0.5) / num_samples);
                    for (int channel = 0; channel < 3; ++channel) {
                        sums[channel] += picture.at(x, y, picture.channels == 1 ? 0 : channel);
                    }
                }
            }
            for (int channel = 0; channel < 3; ++channel) {
                colors.at(column, row, channel) =
                    static_cast<float>(sums[channel]) / static_cast<float>(num_samples * num_samples);
            }
        }
    }
    const ImageF probability =
        foreground_probability(covered, colors, in_picture, cell_px_ / camera.scale_px_per_mm, options);
    probability_ = probability;
    for (int row = 0; row < height; ++row) { // cells beside the background hold some of it
        for (int column = 0; column < width; ++column) {
            for (int j = std::max(0, row - 1); j <= std::min(height - 1, row + 1); ++j) {
                for (int i = std::max(0, column - 1); i <= std::min(width - 1, column + 1); ++i) {
                    probability_.at(column, row) = std::min(probability_.at(column, row), probability.at(i, j));
                }
            }
        }
    }
}

} // namespace lineament
