// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
//
// Based on: FIPS 180-4, Secure Hash Standard, 2015.
#include "network.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#ifdef __x86_64__
#include <cpuid.h>
#include <immintrin.h>
#endif

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

const std::array<std::uint32_t, 64>& round_constants()
{
    static const std::array<std::uint32_t, 64> constants = fractions_of_roots(3);
    return constants;
}

void add_block(std::array<std::uint32_t, 8>& state, const unsigned char* block)
{
    const std::array<std::uint32_t, 64>& constants = round_constants();
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

void add_blocks(std::array<std::uint32_t, 8>& state, const unsigned char* blocks, std::size_t count)
{
    for (std::size_t i = 0; i < count; ++i) {
        add_block(state, blocks + 64 * i);
    }
}

#ifdef __x86_64__

bool has_sha_instructions()
{
    unsigned a = 0;
    unsigned b = 0;
    unsigned c = 0;
    unsigned d = 0;
    return __builtin_cpu_supports("sse4.1") && __get_cpuid_count(7, 0, &a, &b, &c, &d) != 0 && (b & bit_SHA) != 0;
}

/// add_blocks by the instructions of x86 processors since about 2017, ten times as fast.
/// @par Reference  Gulley et al., Intel SHA Extensions, 2013.
__attribute__((target("sha,sse4.1"))) void add_blocks_by_instructions(std::array<std::uint32_t, 8>& state,
                                                                      const unsigned char* blocks, std::size_t count)
{
    const std::uint32_t* const constants = round_constants().data();
    const __m128i big_endian = _mm_set_epi64x(0x0c0d0e0f08090a0b, 0x0405060700010203);
    auto* const words = reinterpret_cast<__m128i*>(state.data());
    // The instructions hold the state as (a, b, e, f) and (c, d, g, h), the first in the highest place.
    const __m128i badc = _mm_shuffle_epi32(_mm_loadu_si128(words), 0xb1);
    const __m128i hgfe = _mm_shuffle_epi32(_mm_loadu_si128(words + 1), 0x1b);
    __m128i abef = _mm_alignr_epi8(badc, hgfe, 8);
    __m128i cdgh = _mm_blend_epi16(hgfe, badc, 0xf0);
    for (std::size_t block = 0; block < count; ++block) {
        const __m128i abef_before = abef;
        const __m128i cdgh_before = cdgh;
        __m128i w[4]; // the last 16 words of the schedule
        for (int i = 0; i < 16; ++i) {
            __m128i& next = w[i % 4];
            if (i < 4) {
                const auto* const source = reinterpret_cast<const __m128i*>(blocks + 64 * block + 16 * i);
                next = _mm_shuffle_epi8(_mm_loadu_si128(source), big_endian);
            } else {
                const __m128i last = w[(i + 3) % 4];
                const __m128i sum =
                    _mm_add_epi32(_mm_sha256msg1_epu32(next, w[(i + 1) % 4]), _mm_alignr_epi8(last, w[(i + 2) % 4], 4));
                next = _mm_sha256msg2_epu32(sum, last);
            }
            const auto* const constant = reinterpret_cast<const __m128i*>(constants + 4 * i);
            const __m128i added = _mm_add_epi32(next, _mm_loadu_si128(constant));
            cdgh = _mm_sha256rnds2_epu32(cdgh, abef, added); // two rounds, by which the halves change their places
            abef = _mm_sha256rnds2_epu32(abef, cdgh, _mm_shuffle_epi32(added, 0x0e));
        }
        abef = _mm_add_epi32(abef, abef_before);
        cdgh = _mm_add_epi32(cdgh, cdgh_before);
    }
    const __m128i feba = _mm_shuffle_epi32(abef, 0x1b);
    const __m128i dchg = _mm_shuffle_epi32(cdgh, 0xb1);
    _mm_storeu_si128(words, _mm_blend_epi16(feba, dchg, 0xf0));
    _mm_storeu_si128(words + 1, _mm_alignr_epi8(dchg, feba, 8));
}

#endif

} // namespace

std::string sha256(std::string_view bytes, [[maybe_unused]] ShaCode code)
{
    auto* add = add_blocks;
#ifdef __x86_64__
    if (code == ShaCode::fastest && has_sha_instructions()) {
        add = add_blocks_by_instructions;
    }
#endif
    std::array<std::uint32_t, 8> state = {};
    const std::array<std::uint32_t, 64> start = fractions_of_roots(2);
    std::copy_n(start.begin(), 8, state.begin());
    const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
    add(state, data, bytes.size() / 64);
    const std::size_t position = bytes.size() / 64 * 64;
    std::array<unsigned char, 128> tail = {};
    const std::size_t rest = bytes.size() - position;
    std::copy_n(data + position, rest, tail.begin());
    tail[rest] = 0x80;
    const std::size_t length = rest < 56 ? 64 : 128;
    for (int i = 0; i < 8; ++i) {
        tail[length - 1 - i] = static_cast<unsigned char>((static_cast<std::uint64_t>(bytes.size()) * 8) >> (8 * i));
    }
    add(state, tail.data(), length / 64);
    std::string text;
    for (const std::uint32_t word : state) {
        for (int shift = 28; shift >= 0; shift -= 4) {
            text += "0123456789abcdef"[(word >> shift) & 15];
        }
    }
    return text;
}

} // namespace lineament::network
