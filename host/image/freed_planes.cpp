// SPDX-License-Identifier: MIT
// A list of free planes for each size, of which a take has a few.
#include "image/freed_planes.hpp"

#include <malloc.h>

#include <map>
#include <mutex>
#include <new>
#include <vector>

namespace ols {

namespace {

constexpr std::align_val_t alignment{plane_alignment};

// Never destroyed: planes may be let go of while the program ends.
struct FreedPlanes {
    std::mutex mutex;
    bool keeps = false;
    size_t kept_bytes = 0;
    std::map<size_t, std::vector<void*>> by_size;
};

FreedPlanes& freed() {
    static auto* const planes = new FreedPlanes;
    return *planes;
}

}  // namespace

bool keep_freed_planes() {
    // Larger blocks are mapped and unmapped by themselves. 32 MB is the most that glibc takes on 64 bits (HEAP_MAX_SIZE / 2); once
    // refused, it would map everything from 128 kB on, for M_TRIM_THRESHOLD ends its own adjusting of the two.
    const bool keeps_blocks = mallopt(M_MMAP_THRESHOLD, 32 << 20);
    // Free memory at the heap's end from which it is given back. It holds for the heap of the first thread alone: those of others are
    // given back as soon as they are empty, which is why planes are kept here.
    const bool keeps_end = mallopt(M_TRIM_THRESHOLD, 1 << 30);
    const std::lock_guard lock(freed().mutex);
    freed().keeps = true;
    return keeps_blocks && keeps_end;
}

void* take_plane(size_t bytes) {
    if (bytes >= plane_bytes_min) {
        FreedPlanes& planes = freed();
        const std::lock_guard lock(planes.mutex);
        if (const auto found = planes.by_size.find(bytes); found != planes.by_size.end() && !found->second.empty()) {
            void* const plane = found->second.back();
            found->second.pop_back();
            planes.kept_bytes -= bytes;
            return plane;
        }
    }
    return ::operator new(bytes, alignment);
}

void give_back_plane(void* plane, size_t bytes) noexcept {
    if (bytes >= plane_bytes_min) {
        FreedPlanes& planes = freed();
        const std::lock_guard lock(planes.mutex);
        if (planes.keeps && planes.kept_bytes + bytes <= kept_bytes_max) {
            try {
                planes.by_size[bytes].push_back(plane);
                planes.kept_bytes += bytes;
                return;
            } catch (const std::bad_alloc&) {  // no memory to remember it by
            }
        }
    }
    ::operator delete(plane, alignment);
}

}  // namespace ols
