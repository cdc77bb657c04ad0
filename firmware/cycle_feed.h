// SPDX-License-Identifier: MIT
// Cycle feed: DMA that copies one table after the other to the FIFO of a PIO machine, one table a cycle, without the
// processor. Which table each cycle takes stands in a ring, far enough ahead that the ring can be changed while it is
// being read.
#ifndef OLS_CYCLE_FEED_H
#define OLS_CYCLE_FEED_H

#include <stdint.h>

#include "pio.h"

enum { CYCLE_FEED_RING = 256, CYCLE_FEED_RING_LOG2 = 8 };

struct cycle_feed {
    struct pio_machine machine;
    uint32_t request;                                        // DMA_REQUEST_... of the machine's FIFO
    uint32_t table_channel, count_channel, address_channel;  // of DMA
    uint32_t* counts;                                        // words of cycle n's table, n modulo the ring
    const uint32_t** tables;                                 // both aligned to their size
};

// Cycle n, and all that are as many rings later, takes this table.
static inline void cycle_feed_set(const struct cycle_feed* feed, uint32_t n, const uint32_t* table, uint32_t words) {
    feed->counts[n % CYCLE_FEED_RING] = words;
    feed->tables[n % CYCLE_FEED_RING] = table;
}

// Starts with cycle 0, as far as the FIFO takes it.
void cycle_feed_start(const struct cycle_feed* feed);
void cycle_feed_stop(const struct cycle_feed* feed);

// Cycles whose table has been begun, modulo the ring. Each cycle is begun one cycle's time after the one before it, but
// for the first ones, which fill the FIFO; what is in the FIFO (8 words) is still to be played.
uint32_t cycle_feed_begun(const struct cycle_feed* feed);

// Address of the word that the FIFO takes next.
uint32_t cycle_feed_next_word(const struct cycle_feed* feed);

#endif
