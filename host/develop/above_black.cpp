// SPDX-License-Identifier: MIT
// Loops for the compiler to vectorise: the step, and whether there is a white, are known when compiled, and counts stay in 16 bits.
#include "develop/above_black.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "demultiplex/masked_sample.hpp"

namespace ols {

namespace {

template <size_t step, bool has_white, typename Sample>
bool subtract_counts(const uint16_t* samples, const SampleLimits& limits, const Sample* black, size_t width,
                     Sample* out) {
    const auto limit = uint16_t(std::ceil(std::min(limits.white, 65535.0f))), most = uint16_t(limits.most);
    uint16_t largest = 0;
    for (size_t x = 0; x < width; ++x) {
        const uint16_t counts = samples[x * step], held = std::min(counts, most);
        largest = std::max(largest, counts);
        Sample value;
        if constexpr (std::is_same_v<Sample, int16_t>)
            value = Sample(uint16_t(held - uint16_t(black[x])));
        else
            value = Sample(held) - black[x];
        out[x] = !has_white || counts < limit ? value : masked_sample<Sample>;
    }
    return has_white && largest >= limit;
}

template <size_t step, typename Sample>
bool subtract(const uint16_t* samples, const SampleLimits& limits, const Sample* black, size_t width, Sample* out) {
    return limits.white <= 65535 ? subtract_counts<step, true>(samples, limits, black, width, out)
                                 : subtract_counts<step, false>(samples, limits, black, width, out);
}

template <size_t step>
bool subtract(const float* samples, const SampleLimits& limits, const float* black, size_t width, float* out) {
    bool masked = false;
    for (size_t x = 0; x < width; ++x) {
        const float value = samples[x * step];
        const bool is_seen = std::isfinite(value) && value < limits.white;
        masked |= !is_seen;
        out[x] = is_seen ? value - black[x] : masked_sample<float>;
    }
    return masked;
}

}  // namespace

template <typename Count, typename Sample>
bool subtract_black(const Count* samples, size_t step, const SampleLimits& limits, const Sample* black, size_t width,
                    Sample* out) {
    assert(step == 1 || step == 3);
    return step == 3 ? subtract<3>(samples, limits, black, width, out)
                     : subtract<1>(samples, limits, black, width, out);
}

template bool subtract_black(const uint16_t*, size_t, const SampleLimits&, const int16_t*, size_t, int16_t*);
template bool subtract_black(const uint16_t*, size_t, const SampleLimits&, const int32_t*, size_t, int32_t*);
template bool subtract_black(const uint16_t*, size_t, const SampleLimits&, const float*, size_t, float*);
template bool subtract_black(const float*, size_t, const SampleLimits&, const float*, size_t, float*);

}  // namespace ols
