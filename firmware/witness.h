// SPDX-License-Identifier: MIT
// Witness: measures the trigger times at the pin. Stamps count down from 2^32 - 1, one every second tick since start.
#ifndef OLS_WITNESS_H
#define OLS_WITNESS_H

#include <stdint.h>

#include "wire.h"

enum { WITNESS_RING_STAMPS = 1024 };
enum { WITNESS_STAMPED = 0, WITNESS_LIGHT_TOO_LONG = 1 };  // flags of PIO block 1, as in pulse.pio

void witness_init(void);
// By an edge: counts from the first rise of GENLOCK, or of PHOTO (receptor.h), after witness_start, not from that.
void witness_arm(enum ols_start_source start);

// Before player_start: an edge between the two is then one that both know of.
void witness_start(void);

// Rising edges of TRIG0 seen since start.
uint32_t witness_count(void);

// The stamp of edge n, one of the last WITNESS_RING_STAMPS.
uint32_t witness_stamp(uint32_t n);

#endif
