// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "grey_crop.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace lineament {
namespace {

/// The source pixels and weights of each pixel along one axis of the crop.
struct Taps
{
    std::vector<int> first;    ///< First source pixel, may lie outside [0, source_size).
    int count = 0;             ///< Taps of each pixel.
    std::vector<float> weight; ///< crop size x count, each row sums to 1.
};

Taps triangle_taps(double start, double scale, int size)
{
    const double radius = std::max(1.0, 1.0 / scale);
    Taps taps;
    taps.count = static_cast<int>(std::ceil(2.0 * radius)) + 1;
    taps.weight.resize(static_cast<std::size_t>(size) * taps.count);
    for (int i = 0; i < size; ++i) {
        const double centre = start + (i + 0.5) / scale - 0.5; // in units of source pixel indices
        const int first = static_cast<int>(std::floor(centre - radius)) + 1;
        float* weight = taps.weight.data() + static_cast<std::size_t>(i) * taps.count;
        float sum = 0.0f;
        for (int k = 0; k < taps.count; ++k) {
            weight[k] = static_cast<float>(std::max(0.0, 1.0 - std::abs(first + k - centre) / radius));
            sum += weight[k];
        }
        for (int k = 0; k < taps.count; ++k) {
            weight[k] /= sum;
        }
        taps.first.push_back(first);
    }
    return taps;
}

float luma(const std::uint8_t* rgb)
{
    return 0.299f * static_cast<float>(rgb[0]) + 0.587f * static_cast<float>(rgb[1]) +
           0.114f * static_cast<float>(rgb[2]);
}

} // namespace

ImageU8 crop_grey(const ImageU8& picture, const CropPlace& place)
{
    const Taps columns = triangle_taps(place.left, place.scale, place.width);
    const Taps rows = triangle_taps(place.top, place.scale, place.height);
    ImageU8 crop(place.width, place.height, 1);
    if (crop.empty()) {
        return crop;
    }
    const int first_column = std::min(columns.first.front(), columns.first.back());
    const int num_columns = columns.first.back() + columns.count - first_column;
    std::vector<float> grey(num_columns); // one source row, border continued
    // Source rows already resampled along x, kept in a ring while the vertical filter needs them.
    std::vector<float> ring(static_cast<std::size_t>(rows.count) * place.width);
    int next_row = rows.first.front();
    const auto slot = [&](int row) {
        return ring.data() + static_cast<std::size_t>(((row % rows.count) + rows.count) % rows.count) * place.width;
    };
    std::vector<float> sum(place.width);
    for (int j = 0; j < place.height; ++j) {
        for (next_row = std::max(next_row, rows.first[j]); next_row < rows.first[j] + rows.count; ++next_row) {
            const std::uint8_t* source = picture.pixel(0, std::clamp(next_row, 0, picture.height - 1));
            for (int i = 0; i < num_columns; ++i) {
                grey[i] = luma(source + 3 * std::clamp(first_column + i, 0, picture.width - 1));
            }
            float* target = slot(next_row);
            for (int i = 0; i < place.width; ++i) {
                const float* weight = columns.weight.data() + static_cast<std::size_t>(i) * columns.count;
                const float* from = grey.data() + (columns.first[i] - first_column);
                float value = 0.0f;
                for (int k = 0; k < columns.count; ++k) {
                    value += weight[k] * from[k];
                }
                target[i] = value;
            }
        }
        std::fill(sum.begin(), sum.end(), 0.5f); // rounds
        for (int k = 0; k < rows.count; ++k) {
            const float weight = rows.weight[static_cast<std::size_t>(j) * rows.count + k];
            const float* from = slot(rows.first[j] + k);
            for (int i = 0; i < place.width; ++i) {
                sum[i] += weight * from[i];
            }
        }
        for (int i = 0; i < place.width; ++i) {
            crop.at(i, j) = static_cast<std::uint8_t>(std::min(sum[i], 255.0f));
        }
    }
    return crop;
}

} // namespace lineament
