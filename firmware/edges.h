// SPDX-License-Identifier: MIT
// Edges: how many have come since start, and how many of them began no cycle, where each cycle waits for one; none otherwise.
#ifndef OLS_EDGES_H
#define OLS_EDGES_H

#include <stdint.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

// Forgets what was counted, and readies the receptor if cycles wait for edges.
void edges_arm(enum ols_start_source start, uint32_t debounce_ticks);

// From now on edges count. After player_start, which is then ready for the first one.
void edges_start(void);

// Counts those that have come by now. Once each turn of the main loop, before the counts are asked for.
void edges_count(void);

// Counts for the last time: before player_stop, while the player still knows how many cycles it has begun.
void edges_stop(void);

uint32_t edges_seen(void);
uint32_t edges_missed(void);  // of those seen, the ones that came while a cycle was playing

#ifdef __cplusplus
}
#endif

#endif
