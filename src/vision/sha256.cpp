// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: FIPS 180-4, Secure Hash Standard, 2015.
#include "network.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace lineament::network {
namespace {

/// The first 32 bits behind the point of the `root`-th root of the first 64 primes.
std::array<std::uint32_t, 64> fractions_of_roots(int root)
{
    std::array<std::uint32_t, 64> fractions = {};
    int count = 0;
    for (int candidate = 2; count < 64; ++candidate) {
        bool prime = true;
        for (int divisor = 2; divisor * divisor <= candidate; ++divisor) {
            prime = prime && candidate % divisor != 0;
        }
        if (prime) {
            const long double value = root == 2 ? std::sqrt(static_cast<long double>(candidate))
                                                : std::cbrt(static_cast<long double>(candidate));
            fractions[count++] = static_cast<std::uint32_t>((value - std::floor(value)) * 4294967296.0L);
        }
    }
    return fractions;
}

void add_block(std::array<std::uint32_t, 8>& state, const unsigned char* block)
{
    static const std::array<std::uint32_t, 64> constants = fractions_of_roots(3);
    std::array<std::uint32_t, 64> w = {};
    for (int i = 0; i < 16; ++i) {
        w[i] = static_cast<std::uint32_t>(block[4 * i]) << 24 | static_cast<std::uint32_t>(block[4 * i + 1]) << 16 |
               static_cast<std::uint32_t>(block[4 * i + 2]) << 8 | block[4 * i + 3];
    }
    for (int i = 16; i < 64; ++i) {
        const std::uint32_t s0 = std::rotr(w[i - 15], 7) ^ std::rotr(w[i - 15], 18) ^ (w[i - 15] >> 3);
        const std::uint32_t s1 = std::rotr(w[i - 2], 17) ^ std::rotr(w[i - 2], 19) ^ (w[i - 2] >> 10);
        w[i] = w[i - 16] + s0 + w[i - 7] + s1;
    }
    auto [a, b, c, d, e, f, g, h] = state;
    for (int i = 0; i < 64; ++i) {
        const std::uint32_t s1 = std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25);
        const std::uint32_t t1 = h + s1 + ((e & f) ^ (~e & g)) + constants[i] + w[i];
        const std::uint32_t s0 = std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22);
        const std::uint32_t t2 = s0 + ((a & b) ^ (a & c) ^ (b & c));
        h = g;
        g = f;
        f = e;
        e = d + t1;
        d = c;
        c = b;
        b = a;
        a = t1 + t2;
    }
    const std::array<std::uint32_t, 8> end = {a, b, c, d, e, f, g, h};
    for (int i = 0; i < 8; ++i) {
        state[i] += end[i];
    }
}

} // namespace

std::string sha256(std::string_view bytes)
{
    std::array<std::uint32_t, 8> state = {};
    const std::array<std::uint32_t, 64> start = fractions_of_roots(2);
    std::copy_n(start.begin(), 8, state.begin());
    const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
    std::size_t position = 0;
    for (; position + 64 <= bytes.size(); position += 64) {
        add_block(state, data + position);
    }
    std::array<unsigned char, 128> tail = {};
    const std::size_t rest = bytes.size() - position;
    std::copy_n(data + position, rest, tail.begin());
    tail[rest] = 0x80;
    const std::size_t length = rest < 56 ? 64 : 128;
    for (int i = 0; i < 8; ++i) {
        tail[length - 1 - i] = static_cast<unsigned char>((static_cast<std::uint64_t>(bytes.size()) * 8) >> (8 * i));
    }
    for (std::size_t i = 0; i < length; i += 64) {
        add_block(state, tail.data() + i);
    }
    std::string text;
    for (const std::uint32_t word : state) {
        for (int shift = 28; shift >= 0; shift -= 4) {
            text += "0123456789abcdef"[(word >> shift) & 15];
        }
    }
    return text;
}

} // namespace lineament::network
