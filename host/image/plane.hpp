// SPDX-License-Identifier: MIT
// Planes: long rows of samples whose memory suits vector instructions.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace ols {

// Begins on a cache line, so that what is written in whole lines streams past the cache (the inversion of 156 lamps takes four
// times as long without), and does not set to zero what will be written anyway: Plane(n) has no values, Plane(n, 0.0f) zeros.
template <typename T>
struct PlaneAllocator {
    using value_type = T;
    static constexpr std::align_val_t alignment{64};

    PlaneAllocator() = default;
    template <typename U>
    PlaneAllocator(const PlaneAllocator<U>&) {}

    T* allocate(size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), alignment)); }
    void deallocate(T* p, size_t) { ::operator delete(p, alignment); }
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
