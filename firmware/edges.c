// SPDX-License-Identifier: MIT
// Edges: the receptor's count less the cycles that the player has begun.
#include "edges.h"

#include <stdbool.h>

#include "player.h"
#include "receptor.h"

static bool cycles_wait;  // for edges
static bool counting;     // since edges_start
static uint32_t seen, missed;

void edges_arm(enum ols_start_source start, uint32_t debounce_ticks) {
    cycles_wait = start == OLS_START_EACH_CYCLE_BY_EDGE;
    counting = false;
    seen = missed = 0;
    if (cycles_wait) receptor_arm(debounce_ticks);
}

void edges_start(void) {
    if (cycles_wait) receptor_start();
    counting = cycles_wait;
}

// Each edge begins a cycle, or came while one played and is missed. Reading takes longer than a cycle takes to begin after
// its edge, so with as many cycles before as after, all of them are of the edges read in between.
void edges_count(void) {
    if (!counting) return;
    uint32_t cycles;
    do {
        cycles = player_cycles_begun();
        seen = receptor_edges();
    } while (cycles != player_cycles_begun());
    missed = seen - cycles;
}

void edges_stop(void) {
    edges_count();
    counting = false;
    receptor_stop();
}

uint32_t edges_seen(void) {
    return seen;
}

uint32_t edges_missed(void) {
    return missed;
}
