// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "support/count_allocations.hpp"
#include "support/sanitized.hpp"

#include <atomic>
#include <cerrno>
#include <cstddef>

namespace {
std::atomic<long> count = 0;
}
namespace lineament::test {
long num_allocations()
{
    return count;
}
} // namespace lineament::test

extern "C" {
#ifdef LINEAMENT_IS_SANITIZED // its own allocator calls these
void __sanitizer_malloc_hook(const volatile void*, std::size_t)
{
    ++count;
}
void __sanitizer_free_hook(const volatile void*) {}
#else // glibc's allocator under the names that the whole process finds first; operator new calls them
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size)
{
    ++count;
    return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size)
{
    ++count;
    return __libc_calloc(number, size);
}
void* realloc(void* memory, std::size_t size)
{
    ++count;
    return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size)
{
    ++count;
    return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size)
{
    ++count;
    *memory = __libc_memalign(alignment, size);
    return *memory != nullptr ? 0 : ENOMEM;
}
#endif
}
