// SPDX-License-Identifier: MIT
// Philox4x32-10, a counter-based random generator (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3"):
// the numbers of a counter and a key, in any order, on any number of threads.
#pragma once

#include <array>
#include <cstdint>

namespace ols {

inline std::array<uint32_t, 4> philox4x32(std::array<uint32_t, 4> counter, std::array<uint32_t, 2> key) {
    for (int round = 0; round < 10; ++round) {
        const uint64_t a = uint64_t(0xD2511F53) * counter[0], b = uint64_t(0xCD9E8D57) * counter[2];
        counter = {uint32_t(b >> 32) ^ counter[1] ^ key[0], uint32_t(b), uint32_t(a >> 32) ^ counter[3] ^ key[1],
                   uint32_t(a)};
        key[0] += 0x9E3779B9;
        key[1] += 0xBB67AE85;
    }
    return counter;
}

// Four independent samples of the standard normal distribution (Box and Muller 1958) from four random words.
std::array<float, 4> standard_normals(const std::array<uint32_t, 4>& words);

}  // namespace ols
