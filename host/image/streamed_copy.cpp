// SPDX-License-Identifier: MIT
// Whole cache lines by stores that stream; what is beside them as usual.
#include "image/streamed_copy.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "image/streamed_copy.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void stream(const uint8_t* from, size_t bytes, uint8_t* to) {
    const hn::CappedTag<uint8_t, 64> d;
    size_t at = std::min(bytes, (64 - uintptr_t(to) % 64) % 64);
    std::memcpy(to, from, at);
    for (; at + hn::Lanes(d) <= bytes; at += hn::Lanes(d)) hn::Stream(hn::LoadU(d, from + at), d, to + at);
    std::memcpy(to + at, from + at, bytes - at);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(stream);

void copy_past_caches(const std::byte* from, size_t bytes, std::byte* to) {
    HWY_DYNAMIC_DISPATCH(stream)(reinterpret_cast<const uint8_t*>(from), bytes, reinterpret_cast<uint8_t*>(to));
    hwy::FlushStream();  // before another thread is told of it
}

}  // namespace ols
#endif
