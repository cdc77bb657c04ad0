// SPDX-License-Identifier: MIT
// Flow looked up through flow: both components and both rows of a pixel's neighbourhood are one vector of four.
#include <algorithm>
#include <cassert>
#include <vector>

#include "flow/flow_field.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "flow/flow_lookup.cpp"
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include <hwy/highway.h>

#ifndef OLS_FLOW_LOOKUP_TYPES
#define OLS_FLOW_LOOKUP_TYPES
namespace ols {

// Where pixels are among the samples of a field.
struct LookupPlaces {
    std::vector<int32_t> x, y;
    std::vector<float> fx, fy;

    explicit LookupPlaces(int count) : x(size_t(count)), y(size_t(count)), fx(size_t(count)), fy(size_t(count)) {}
};

}  // namespace ols
#endif

HWY_BEFORE_NAMESPACE();
namespace ols {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// begin + step * i + vectors[i], edges held, as whole samples and fractions; what is no number goes to the first.
void find_places(const float* vectors, float begin, float step, int count, int size, int32_t* at, float* fraction) {
    const auto places = [&](auto d, int i) HWY_ATTR {
        const hn::RebindToSigned<decltype(d)> di;
        const auto pixel = hn::Add(hn::Set(d, begin), hn::Mul(hn::Iota(d, float(i)), hn::Set(d, step)));
        const auto place = hn::Add(pixel, hn::LoadU(d, vectors + i));
        const auto zero = hn::Zero(d);
        const auto held = hn::IfThenElse(hn::Gt(place, zero), hn::Min(place, hn::Set(d, float(size - 1))), zero);
        const auto whole = hn::Min(hn::ConvertTo(di, held), hn::Set(di, std::max(size - 2, 0)));
        hn::StoreU(whole, di, at + i);
        hn::StoreU(hn::Sub(held, hn::ConvertTo(d, whole)), d, fraction + i);
    };
    const hn::CappedTag<float, 16> d;
    int i = 0;
    for (; i + int(hn::Lanes(d)) <= count; i += int(hn::Lanes(d))) places(d, i);
    for (; i < count; ++i) places(hn::CappedTag<float, 1>(), i);
}

#if HWY_TARGET == HWY_SCALAR

void look_up_row(const float* u, const float* v, int pitch, const LookupPlaces& places, int count, float* u_out,
                 float* v_out) {
    for (int i = 0; i < count; ++i) {
        const size_t k = size_t(i), at = size_t(places.y[k]) * size_t(pitch) + size_t(places.x[k]);
        const auto bilinear = [&](const float* plane) {
            const float* const row = plane + at;
            const float top = row[0] + places.fx[k] * (row[1] - row[0]);
            const float bottom = row[pitch] + places.fx[k] * (row[pitch + 1] - row[pitch]);
            return top + places.fy[k] * (bottom - top);
        };
        u_out[i] = bilinear(u);
        v_out[i] = bilinear(v);
    }
}

#else

using Four = hn::FixedTag<float, 4>;
using FourVector = hn::Vec<Four>;

// Left to right: u above, u below, v above, v below.
HWY_INLINE FourVector across(const float* u, const float* v, size_t pitch, float weight) {
    const Four d;
    const hn::Half<Four> half;
    const FourVector us = hn::Combine(d, hn::LoadU(half, u + pitch), hn::LoadU(half, u));
    const FourVector vs = hn::Combine(d, hn::LoadU(half, v + pitch), hn::LoadU(half, v));
    const FourVector left = hn::ConcatEven(d, vs, us), right = hn::ConcatOdd(d, vs, us);
    return hn::Add(left, hn::Mul(hn::Set(d, weight), hn::Sub(right, left)));
}

// Two pixels: u, v of the first, u, v of the second.
HWY_INLINE FourVector two_pixels(const float* u, const float* v, size_t pitch, const LookupPlaces& places, size_t i) {
    const Four d;
    const auto pixel = [&](size_t k) HWY_ATTR {
        const size_t at = size_t(places.y[k]) * pitch + size_t(places.x[k]);
        return across(u + at, v + at, pitch, places.fx[k]);
    };
    const FourVector first = pixel(i), second = pixel(i + 1);
    const FourVector above = hn::ConcatEven(d, second, first), below = hn::ConcatOdd(d, second, first);
    const hn::Half<Four> half;
    const auto weights = hn::LoadU(half, &places.fy[i]);
    const FourVector weight =
        hn::InterleaveLower(d, hn::Combine(d, weights, weights), hn::Combine(d, weights, weights));
    return hn::Add(above, hn::Mul(weight, hn::Sub(below, above)));
}

// `count` is a multiple of 4. A field of `pitch` columns at least 2, rows at least 2.
void look_up_row(const float* u, const float* v, int pitch, const LookupPlaces& places, int count, float* u_out,
                 float* v_out) {
    const Four d;
    for (int i = 0; i < count; i += 4) {
        const FourVector first = two_pixels(u, v, size_t(pitch), places, size_t(i));
        const FourVector second = two_pixels(u, v, size_t(pitch), places, size_t(i) + 2);
        hn::StoreU(hn::ConcatEven(d, second, first), d, u_out + i);
        hn::StoreU(hn::ConcatOdd(d, second, first), d, v_out + i);
    }
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace ols
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ols {

HWY_EXPORT(find_places);
HWY_EXPORT(look_up_row);

namespace {

// With a column and a row repeated where the field has but one.
FlowField at_least_two(const FlowField& field) {
    FlowField out(std::max(field.width, 2), std::max(field.height, 2));
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            const size_t to = size_t(y) * size_t(out.width) + size_t(x);
            const size_t from =
                size_t(std::min(y, field.height - 1)) * size_t(field.width) + size_t(std::min(x, field.width - 1));
            out.u[to] = field.u[from], out.v[to] = field.v[from];
        }
    return out;
}

// `field` is base's size, but for what at_least_two adds.
FlowField seen_through(const FlowField& base, const FlowField& field) {
    FlowField out(base.width, base.height);
    const int padded = (base.width + 3) / 4 * 4;
    LookupPlaces places(padded);
    std::vector<float> u(places.fx.size()), v(places.fx.size());
    for (int y = 0; y < base.height; ++y) {
        const size_t at = size_t(y) * size_t(base.width);
        HWY_DYNAMIC_DISPATCH(find_places)
        (&base.u[at], 0, 1, base.width, base.width, places.x.data(), places.fx.data());
        HWY_DYNAMIC_DISPATCH(find_places)
        (&base.v[at], float(y), 0, base.width, base.height, places.y.data(), places.fy.data());
        HWY_DYNAMIC_DISPATCH(look_up_row)
        (field.u.data(), field.v.data(), field.width, places, padded, u.data(), v.data());
        std::copy_n(u.begin(), base.width, &out.u[at]);
        std::copy_n(v.begin(), base.width, &out.v[at]);
    }
    return out;
}

}  // namespace

FlowField seen_from_target(const FlowField& base, const FlowField& local) {
    assert(base.width == local.width && base.height == local.height && base.size() > 0);
    if (local.width < 2 || local.height < 2) return seen_through(base, at_least_two(local));
    return seen_through(base, local);
}

FlowField concatenated(const FlowField& a, const FlowField& b) {
    FlowField out = seen_from_target(a, b);
    for (size_t p = 0; p < out.size(); ++p) out.u[p] = a.u[p] + out.u[p], out.v[p] = a.v[p] + out.v[p];
    return out;
}

}  // namespace ols
#endif
