// SPDX-License-Identifier: MIT
// What becomes of planes that are let go of.
#pragma once

#include <cstddef>

namespace ols {

// From here on planes that are let go of are kept with the process, for those of the same size that are made next, target after
// target and in whichever thread: memory that went back to the kernel in between is cleared page by page, which takes as long as an
// inversion or a flow. They lie in huge pages, where the kernel gives such (transparent_hugepage/enabled: madvise or always). Freed
// blocks of up to 32 MB of other kinds stay, too. To be called before the first plane is made. False where the allocator has no such
// settings (a sanitizer's): other blocks may go back, slower, and otherwise the same.
bool keep_freed_planes();

// Has so many planes there with their memory cleared, as far as they are kept, so that those who make them first need not wait for that.
// Where there is not so much memory, fewer.
void prepare_planes(size_t bytes, size_t count);

// What PlaneAllocator calls: memory that begins on a cache line. Blocks of less than plane_bytes_min are not kept, nor, once all that
// lies beside them was given back, more than kept_bytes_max altogether. Throws std::bad_alloc.
void* take_plane(size_t bytes);
void give_back_plane(void* plane, size_t bytes) noexcept;

inline constexpr size_t plane_bytes_min = 128 << 10, kept_bytes_max = size_t(1) << 30;
inline constexpr size_t plane_alignment = 64;

}  // namespace ols
