// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "count_allocations.hpp"

#include "support/sanitizers.hpp"

#include <atomic>
#include <cstdlib>
#include <new>

// Everything that allocates here: operator new, and malloc, which Eigen calls and the linker wraps.
namespace {
std::atomic<long> count = 0;
}
namespace lineament::test {
#ifdef LINEAMENT_IS_SANITIZED
const bool counts_allocations = false;
#else
const bool counts_allocations = true;
#endif
long num_allocations()
{
    return count;
}
} // namespace lineament::test

extern "C" void* __real_malloc(std::size_t size);
extern "C" void* __wrap_malloc(std::size_t size)
{
    ++count;
    return __real_malloc(size);
}
#ifndef LINEAMENT_IS_SANITIZED
void* operator new(std::size_t size)
{
    ++count;
    if (void* memory = __real_malloc(size)) {
        return memory;
    }
    throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment)
{
    ++count;
    const std::size_t step = static_cast<std::size_t>(alignment);
    if (void* memory = std::aligned_alloc(step, (size + step - 1) / step * step)) {
        return memory;
    }
    throw std::bad_alloc();
}
void operator delete(void* memory) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept
{
    std::free(memory);
}
#endif
