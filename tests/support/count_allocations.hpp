// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lineament::test {

/// Allocations so far, by every part of the process and in all threads: malloc and its kin, which operator new calls.
/// For programs that compile count_allocations.cpp; with a sanitizer too.
[[nodiscard]] long num_allocations();

} // namespace lineament::test
