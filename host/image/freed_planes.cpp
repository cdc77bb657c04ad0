// SPDX-License-Identifier: MIT
// The settings of glibc's allocator.
#include "image/freed_planes.hpp"

#include <malloc.h>

namespace ols {

bool keep_freed_planes() {
    // Larger blocks are mapped and unmapped by themselves. 32 MB is the most that glibc takes on 64 bits (HEAP_MAX_SIZE / 2); once
    // refused, it would map everything from 128 kB on, for M_TRIM_THRESHOLD ends its own adjusting of the two.
    const bool keeps_planes = mallopt(M_MMAP_THRESHOLD, 32 << 20);
    // Free memory at the heap's end from which it is given back.
    const bool keeps_end = mallopt(M_TRIM_THRESHOLD, 1 << 30);
    return keeps_planes && keeps_end;
}

}  // namespace ols
