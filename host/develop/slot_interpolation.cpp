// SPDX-License-Identifier: MIT
// Blending by vectors; where nothing moves, nothing is touched.
#include "develop/slot_interpolation.hpp"

#include <algorithm>
#include <cstdint>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "develop/slot_interpolation.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#include "develop/sample_lanes_inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <typename Sum>
void blend(const AcrossBlend<Sum>& blend) {
    const Floats d;
    const auto own = hn::Set(d, blend.share), others = hn::Set(d, 1 - blend.share), part = hn::Set(d, 2 * blend.part);
    Sum* const samples = blend.samples.data();
    for (size_t at = 0; at < blend.samples.size(); at += hn::Lanes(d)) {
        const auto trust = hn::LoadU(d, blend.trust_across + at);
        const Samples nearer = load(samples + at), across = load(blend.across + at);
        const auto changes = hn::And(hn::Gt(trust, hn::Zero(d)), hn::And(nearer.is_seen, across.is_seen));
        if (hn::AllFalse(d, changes)) continue;
        const auto trusted = hn::Mul(trust, others), weight = hn::Div(trusted, hn::Add(own, trusted));
        store(changes, hn::Add(nearer.value, hn::Mul(weight, hn::Sub(across.value, nearer.value))), samples + at);
        // 1 - (1 - w)^2 - w^2 = 2 w (1 - w)
        const auto less = hn::Mul(part, hn::Mul(weight, hn::Sub(hn::Set(d, 1.0f), weight)));
        hn::StoreU(hn::Sub(hn::LoadU(d, blend.noise + at), hn::IfThenElseZero(changes, less)), d, blend.noise + at);
    }
}

void blend_shorts(const AcrossBlend<int16_t>& of_shorts) {
    blend(of_shorts);
}
void blend_longs(const AcrossBlend<int32_t>& of_longs) {
    blend(of_longs);
}
void blend_floats(const AcrossBlend<float>& of_floats) {
    blend(of_floats);
}

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(blend_shorts);
HWY_EXPORT(blend_longs);
HWY_EXPORT(blend_floats);

std::vector<float> trust_across(const Alignment& alignment, size_t nearer_interval, size_t across_interval) {
    constexpr float least = 1 / 30.0f;
    constexpr size_t slack = 16;
    const std::vector<float>&here = alignment.confidence(nearer_interval),
          &there = alignment.confidence(across_interval);
    std::vector<uint8_t> moves(here.size());
    for (const size_t interval : {nearer_interval, across_interval}) alignment.motion(interval).mark_moving(moves);
    std::vector<float> trust(here.size() + slack);
    for (size_t p = 0; p < moves.size(); ++p) {
        const float quotient = std::max(there[p], least) / std::max(here[p], least);
        if (moves[p]) trust[p] = std::min(1.0f, quotient * quotient);
    }
    return trust;
}

template <>
void blend_across(const AcrossBlend<int16_t>& blend) {
    HWY_DYNAMIC_DISPATCH(blend_shorts)(blend);
}
template <>
void blend_across(const AcrossBlend<int32_t>& blend) {
    HWY_DYNAMIC_DISPATCH(blend_longs)(blend);
}
template <>
void blend_across(const AcrossBlend<float>& blend) {
    HWY_DYNAMIC_DISPATCH(blend_floats)(blend);
}

}  // namespace ols
#endif
