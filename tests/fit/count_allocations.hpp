// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lineament::test {

/// Calls of operator new and, in programs linked with -Wl,--wrap=malloc, of malloc, so far and in all threads.
[[nodiscard]] long num_allocations();

/// False in programs built with a sanitizer, which has an operator new of its own.
extern const bool counts_allocations;

} // namespace lineament::test
