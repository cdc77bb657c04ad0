// SPDX-License-Identifier: MIT
// Light limits: what lamps and supply stand, checked when a program is made ready and before anything is lit.
#ifndef OLS_LIGHT_LIMITS_H
#define OLS_LIGHT_LIMITS_H

#include <stdint.h>

#include "wire.h"

struct light_limits {
    uint16_t lamps_lit_max;           // at once: the supply's current
    uint16_t lamp_duty_max_permille;  // of a cycle
};

// How long each lamp is lit in the part of a cycle that has been added.
struct light_use {
    uint64_t lit_ticks[OLS_CHAIN_BITS_MAX];
};

// Adds a stretch in which `pattern` is lit; returns how many lamps that are.
uint32_t light_add(struct light_use* use, const uint32_t* pattern, uint32_t words, uint32_t ticks);

// The longest time that any lamp is lit; *lamp is its chain bit.
uint64_t light_longest_ticks(const struct light_use* use, uint32_t* lamp);

#endif
