// SPDX-License-Identifier: MIT
// A list of free planes for each size, of which a take has a few; they lie side by side in slabs, which are as large as huge pages are of use.
#include "image/freed_planes.hpp"

#include <malloc.h>
#include <sanitizer/asan_interface.h>
#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <mutex>
#include <new>
#include <vector>

namespace ols {

namespace {

constexpr std::align_val_t alignment{plane_alignment};
constexpr size_t slab_bytes = 64 << 20, huge_page_bytes = 2 << 20;

size_t rounded_up(size_t bytes, size_t unit) {
    return (bytes + unit - 1) / unit * unit;
}

// Planes begin on cache lines, an odd number of these apart (row_band.cpp has why).
size_t stride_of(size_t bytes) {
    return (rounded_up(bytes, plane_alignment) / plane_alignment | 1) * plane_alignment;
}

struct Slab {
    std::byte* memory;
    size_t bytes, plane_bytes, planes, lent = 0;

    std::byte* plane(size_t n) const { return memory + n * stride_of(plane_bytes); }
};

// Memory for so many planes, beginning on a huge page. Touched page by page it takes many times as long to come by: the kernel clears
// each at its first use, and 156 planes that are written side by side are more pages than the processor remembers the places of.
Slab map_slab(size_t plane_bytes, size_t planes) {
    const size_t bytes = rounded_up(planes * stride_of(plane_bytes), huge_page_bytes);
    void* const mapped = mmap(nullptr, bytes + huge_page_bytes, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (mapped == MAP_FAILED) throw std::bad_alloc();
    auto* const begin = static_cast<std::byte*>(mapped);
    const size_t before = rounded_up(uintptr_t(begin), huge_page_bytes) - uintptr_t(begin);
    if (before > 0) munmap(begin, before);
    munmap(begin + before + bytes, huge_page_bytes - before);
    (void)madvise(begin + before, bytes, MADV_HUGEPAGE);  // only quicker
    return {begin + before, bytes, plane_bytes, planes};
}

// Never destroyed: planes may be let go of while the program ends.
struct FreedPlanes {
    std::mutex mutex;
    bool keeps = false;
    size_t kept_bytes = 0;
    std::map<size_t, std::vector<void*>> by_size;
    std::map<const void*, Slab> slabs;  // by where they begin

    void* take(size_t bytes) {
        if (bytes > size_t(PTRDIFF_MAX) / 2) throw std::bad_alloc();
        std::vector<void*>& free = by_size[bytes];
        if (free.empty()) add_slab(bytes, free);
        void* const plane = free.back();
        free.pop_back();
        kept_bytes -= bytes;
        ++slab_of(plane)->second.lent;
        ASAN_UNPOISON_MEMORY_REGION(plane, bytes);  // in a checked build what is not lent is not to be touched
        return plane;
    }

    // False for a plane that is of no slab: one that was made before planes were kept.
    bool give_back(void* plane, size_t bytes) noexcept {
        const auto slab = slab_of(plane);
        if (slab == slabs.end()) return false;
        ASAN_POISON_MEMORY_REGION(plane, bytes);
        by_size[bytes].push_back(plane);  // has room (add_slab())
        kept_bytes += bytes;
        if (--slab->second.lent == 0) keep_to_bound(slab);
        return true;
    }

  private:
    using SlabPlace = std::map<const void*, Slab>::iterator;

    SlabPlace slab_of(const void* plane) {
        auto slab = slabs.upper_bound(plane);
        if (slab == slabs.begin()) return slabs.end();
        --slab;
        return static_cast<const std::byte*>(plane) < slab->second.memory + slab->second.bytes ? slab : slabs.end();
    }

    void add_slab(size_t bytes, std::vector<void*>& free) {
        const size_t planes = std::max<size_t>(1, slab_bytes / stride_of(bytes));
        size_t known = 0;
        for (const auto& [begin, slab] : slabs) known += slab.plane_bytes == bytes ? slab.planes : 0;
        free.reserve(known + planes);  // of all, so that giving back needs no memory
        const Slab made = map_slab(bytes, planes);
        try {
            slabs.emplace(made.memory, made);
        } catch (...) {
            munmap(made.memory, made.bytes);
            throw;
        }
        ASAN_POISON_MEMORY_REGION(made.memory, made.bytes);
        for (size_t n = made.planes; n-- > 0;) free.push_back(made.plane(n));  // the first is taken first
        kept_bytes += made.planes * bytes;
    }

    // Planes of the size that came back last are the likeliest to be asked for next: theirs go when no others are left.
    void keep_to_bound(SlabPlace newest) {
        for (auto slab = slabs.begin(); slab != slabs.end() && kept_bytes > kept_bytes_max;) {
            const auto next = std::next(slab);
            if (slab->second.lent == 0 && slab->second.plane_bytes != newest->second.plane_bytes) unmap(slab);
            slab = next;
        }
        if (kept_bytes > kept_bytes_max) unmap(newest);
    }

    void unmap(SlabPlace place) {
        const Slab slab = place->second;
        std::erase_if(by_size[slab.plane_bytes], [&](const void* plane) { return slab_of(plane) == place; });
        kept_bytes -= slab.planes * slab.plane_bytes;
        slabs.erase(place);
        ASAN_UNPOISON_MEMORY_REGION(slab.memory, slab.bytes);
        munmap(slab.memory, slab.bytes);
    }
};

FreedPlanes& freed() {
    static auto* const planes = new FreedPlanes;
    return *planes;
}

bool keeps_planes() {
    const std::lock_guard lock(freed().mutex);
    return freed().keeps;
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

void prepare_planes(size_t bytes, size_t count) {
    if (bytes < plane_bytes_min || !keeps_planes()) return;
    constexpr size_t page_bytes = 4096;
    std::vector<void*> planes;
    try {
        planes.reserve(count = std::min(count, kept_bytes_max / bytes));
        while (planes.size() < count) planes.push_back(take_plane(bytes));
    } catch (const std::bad_alloc&) {
    }
    for (void* const plane : planes) {
        auto* const samples = static_cast<volatile char*>(plane);
        for (size_t at = 0; at < bytes; at += page_bytes) samples[at] = 0;
        samples[bytes - 1] = 0;
    }
    for (size_t n = planes.size(); n-- > 0;) give_back_plane(planes[n], bytes);
}

void* take_plane(size_t bytes) {
    if (bytes >= plane_bytes_min) {
        FreedPlanes& planes = freed();
        const std::lock_guard lock(planes.mutex);
        if (planes.keeps) return planes.take(bytes);
    }
    return ::operator new(bytes, alignment);
}

void give_back_plane(void* plane, size_t bytes) noexcept {
    if (bytes >= plane_bytes_min) {
        FreedPlanes& planes = freed();
        const std::lock_guard lock(planes.mutex);
        if (planes.give_back(plane, bytes)) return;
    }
    ::operator delete(plane, alignment);
}

}  // namespace ols
