// SPDX-License-Identifier: MIT
// Light limits: lamps and their times, counted bit by bit.
#include "light_limits.h"

uint32_t light_add(struct light_use* use, const uint32_t* pattern, uint32_t words, uint32_t ticks) {
    uint32_t lamps = 0;
    for (uint32_t word = 0; word < words; word++) {
        uint64_t* lit_ticks = &use->lit_ticks[32 * word];
        for (uint32_t bits = pattern[word]; bits != 0; bits <<= 1, lit_ticks++) {
            if (!(bits >> 31)) continue;
            *lit_ticks += ticks;
            lamps++;
        }
    }
    return lamps;
}

uint64_t light_longest_ticks(const struct light_use* use, uint32_t* lamp) {
    *lamp = 0;
    for (uint32_t n = 1; n < OLS_CHAIN_BITS_MAX; n++)
        if (use->lit_ticks[n] > use->lit_ticks[*lamp]) *lamp = n;
    return use->lit_ticks[*lamp];
}
