// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lineament/render/texture_fusion.hpp" // IWYU pragma: keep

#include "lineament/render/inline.hpp"
#include "lineament/render/texture.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace lineament {

namespace detail {

/// Mean and variance in one pass (Welford).
class RunningVariance
{
public:
    void add(double value)
    {
        ++count_;
        const double difference = value - mean_;
        mean_ += difference / static_cast<double>(count_);
        squares_ += difference * (value - mean_);
    }
    [[nodiscard]] double variance() const { return count_ > 0 ? squares_ / static_cast<double>(count_) : 0.0; }

private:
    std::int64_t count_ = 0;
    double mean_ = 0.0;
    double squares_ = 0.0;
};

inline double brightness(const ImageU8& image, int column, int row)
{
    const std::uint8_t* const pixel = image.pixel(column, row);
    return image.channels < 3 ? pixel[0] : (pixel[0] + 2.0 * pixel[1] + pixel[2]) / 4.0;
}

inline double laplacian(const ImageU8& image, int column, int row)
{
    return brightness(image, column - 1, row) + brightness(image, column + 1, row) +
           brightness(image, column, row - 1) + brightness(image, column, row + 1) -
           4.0 * brightness(image, column, row);
}

} // namespace detail

LINEAMENT_RENDER_INLINE void FusionOptions::check() const
{
    const char* const function = "FusionOptions";
    require(std::isfinite(max_gain) && max_gain >= 1, function, "max_gain", "a finite number >= 1", to_text(max_gain));
    require(min_overlap >= 2, function, "min_overlap", "at least 2", std::to_string(min_overlap));
}

LINEAMENT_RENDER_INLINE TextureAccumulator::TextureAccumulator(int size, const FusionOptions& options)
    : options_(options), size_(size)
{
    options.check();
    require(size >= 1 && size <= 8192, "TextureAccumulator", "size", "1 to 8192", std::to_string(size));
    mean_ = ImageF(size, size, 3);
    weight_sum_ = ImageF(size, size, 1);
    visibility_ = Image<std::uint8_t>(size, size, 1, static_cast<std::uint8_t>(Visibility::unmapped));
}

LINEAMENT_RENDER_INLINE ExposureMatch TextureAccumulator::match(const TextureMap& map) const
{
    ExposureMatch match;
    Eigen::Vector3d sum_new = Eigen::Vector3d::Zero();
    Eigen::Vector3d sum_old = Eigen::Vector3d::Zero();
    Eigen::Vector3d squares_new = Eigen::Vector3d::Zero();
    Eigen::Vector3d squares_old = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
        const double weight = map.weight.data[i];
        if (!(weight > 0) || !(weight_sum_.data[i] > 0)) {
            continue;
        }
        ++match.num_texels;
        const Eigen::Vector3d now =
            Eigen::Map<const Eigen::Matrix<std::uint8_t, 3, 1>>(&map.color.data[3 * i]).cast<double>();
        const Eigen::Vector3d old = Eigen::Map<const Eigen::Vector3f>(&mean_.data[3 * i]).cast<double>();
        weights += weight;
        sum_new += weight * now;
        sum_old += weight * old;
        squares_new += weight * now.cwiseAbs2();
        squares_old += weight * old.cwiseAbs2();
    }
    if (match.num_texels < options_.min_overlap) {
        return match;
    }
    for (int channel = 0; channel < 3; ++channel) {
        const double mean_new = sum_new[channel] / weights;
        const double mean_old = sum_old[channel] / weights;
        const double variance_new = squares_new[channel] / weights - mean_new * mean_new;
        const double variance_old = squares_old[channel] / weights - mean_old * mean_old;
        constexpr double flat = 1.0; // below one level of contrast a gain would be noise
        double gain = 1.0;
        if (variance_new > flat && variance_old > flat) {
            gain = std::clamp(std::sqrt(variance_old / variance_new), 1.0 / options_.max_gain, options_.max_gain);
        }
        match.gain[channel] = static_cast<float>(gain);
        match.offset[channel] = static_cast<float>(mean_old - gain * mean_new);
    }
    return match;
}

LINEAMENT_RENDER_INLINE ExposureMatch TextureAccumulator::add(const TextureMap& map, double frame_weight)
{
    const char* const function = "TextureAccumulator::add";
    require(std::isfinite(frame_weight) && frame_weight >= 0, function, "frame_weight", "a finite number >= 0",
            to_text(frame_weight));
    require(map.color.width == size_ && map.color.height == size_ && map.color.channels == 3, function, "map.color",
            "RGB of side " + std::to_string(size_),
            std::to_string(map.color.width) + " x " + std::to_string(map.color.height));
    require_size(static_cast<Eigen::Index>(map.weight.data.size()), static_cast<Eigen::Index>(weight_sum_.data.size()),
                 function, "map.weight");
    require_size(static_cast<Eigen::Index>(map.visibility.data.size()),
                 static_cast<Eigen::Index>(visibility_.data.size()), function, "map.visibility");
    if (frame_weight == 0) {
        return {};
    }
    const ExposureMatch exposure = options_.match_exposure ? match(map) : ExposureMatch{};
    for (std::size_t i = 0; i < map.weight.data.size(); ++i) {
        visibility_.data[i] = std::min(visibility_.data[i], map.visibility.data[i]);
        const float weight = map.weight.data[i] * static_cast<float>(frame_weight);
        if (!(weight > 0)) {
            continue;
        }
        weight_sum_.data[i] += weight;
        const float share = weight / weight_sum_.data[i];
        for (int channel = 0; channel < 3; ++channel) {
            float& mean = mean_.data[3 * i + channel];
            const float color =
                exposure.gain[channel] * static_cast<float>(map.color.data[3 * i + channel]) + exposure.offset[channel];
            mean += share * (color - mean);
        }
    }
    ++num_frames_;
    return exposure;
}

LINEAMENT_RENDER_INLINE TextureMap TextureAccumulator::texture() const
{
    TextureMap map{ImageU8(size_, size_, 3), weight_sum_, visibility_};
    for (std::size_t i = 0; i < map.color.data.size(); ++i) {
        map.color.data[i] = to_u8(mean_.data[i] / 255.0f);
    }
    return map;
}

LINEAMENT_RENDER_INLINE double sharpness(const TextureMap& map)
{
    const auto is_seen = [&](int column, int row) { return map.weight.at(column, row) > 0; };
    detail::RunningVariance variance;
    for (int row = 1; row + 1 < map.color.height; ++row) {
        for (int column = 1; column + 1 < map.color.width; ++column) {
            if (is_seen(column, row) && is_seen(column - 1, row) && is_seen(column + 1, row) &&
                is_seen(column, row - 1) && is_seen(column, row + 1)) {
                variance.add(detail::laplacian(map.color, column, row));
            }
        }
    }
    return variance.variance();
}

LINEAMENT_RENDER_INLINE double sharpness(const ImageU8& picture, int left, int top, int right, int bottom)
{
    detail::RunningVariance variance;
    for (int row = std::max(1, top); row < std::min(picture.height - 1, bottom); ++row) {
        for (int column = std::max(1, left); column < std::min(picture.width - 1, right); ++column) {
            variance.add(detail::laplacian(picture, column, row));
        }
    }
    return variance.variance();
}

} // namespace lineament
