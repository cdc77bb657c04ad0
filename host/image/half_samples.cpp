// SPDX-License-Identifier: MIT
// F16C (Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1, 14.4) is asked for at run time; Imath's conversion elsewhere.
#include "image/half_samples.hpp"

#include <cmath>
#include <cstddef>

#if defined(__x86_64__)
#include <cpuid.h>
#include <immintrin.h>
#endif

namespace ols {

namespace {

#if defined(__x86_64__)
__attribute__((target("avx,f16c"))) size_t to_halves_by_eight(std::span<const float> floats, half* halves) {
    size_t i = 0;
    for (; i + 8 <= floats.size(); i += 8)
        _mm_storeu_si128(reinterpret_cast<__m128i*>(halves + i),
                         _mm256_cvtps_ph(_mm256_loadu_ps(floats.data() + i), _MM_FROUND_TO_NEAREST_INT));
    return i;
}

// Not __builtin_cpu_supports("f16c"), which clang 14 does not know.
bool has_f16c() {
    unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
    return __builtin_cpu_supports("avx") && __get_cpuid(1, &eax, &ebx, &ecx, &edx) && (ecx & bit_F16C);
}

// How many of the first were converted.
size_t to_halves_fast(std::span<const float> floats, half* halves) {
    static const bool by_eight = has_f16c();
    return by_eight ? to_halves_by_eight(floats, halves) : 0;
}
#else
size_t to_halves_fast(std::span<const float>, half*) {
    return 0;
}
#endif

}  // namespace

void to_halves(std::span<const float> floats, half* halves) {
    for (size_t i = to_halves_fast(floats, halves); i < floats.size(); ++i) halves[i] = half(floats[i]);
}

bool all_within(std::span<const float> values, float largest) {
    int outside = 0;  // counted, so that the loop has no way out and becomes vectors
    for (const float value : values) outside |= !(std::abs(value) <= largest);
    return outside == 0;
}

}  // namespace ols
