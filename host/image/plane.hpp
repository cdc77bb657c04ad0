// SPDX-License-Identifier: MIT
// Planes: long rows of samples whose memory suits vector instructions.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <utility>
#include <vector>

#include "image/freed_planes.hpp"

namespace ols {

// Begins on a cache line, so that what is written in whole lines streams past the cache (the inversion of 156 lamps takes four
// times as long without), and does not set to zero what will be written anyway: Plane(n) has no values, Plane(n, 0.0f) zeros.
template <typename T>
struct PlaneAllocator {
    using value_type = T;
    PlaneAllocator() = default;
    template <typename U>
    PlaneAllocator(const PlaneAllocator<U>&) {}

    T* allocate(size_t n) {
        if (n > size_t(-1) / sizeof(T)) throw std::bad_alloc();
        return static_cast<T*>(take_plane(n * sizeof(T)));
    }
    void deallocate(T* p, size_t n) { give_back_plane(p, n * sizeof(T)); }
    template <typename U>
    void construct(U* p) {
        ::new (static_cast<void*>(p)) U;
    }
    template <typename U, typename... Args>
    void construct(U* p, Args&&... args) {
        ::new (static_cast<void*>(p)) U(std::forward<Args>(args)...);
    }
    bool operator==(const PlaneAllocator&) const { return true; }
};

using Plane = std::vector<float, PlaneAllocator<float>>;

}  // namespace ols
