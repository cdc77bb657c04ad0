// SPDX-License-Identifier: MIT
// Cycle feed: three DMA channels in a circle (RP2040 datasheet 2.5.1 to 2.5.3). The table channel copies a table at the
// machine's pace; then the count channel puts the next entry of one ring into the table channel's TRANS_COUNT, and the
// address channel the next entry of the other ring into its READ_ADDR, which starts it again.
#include "cycle_feed.h"

#include "rp2040.h"

#define RING_BYTES_LOG2 (CYCLE_FEED_RING_LOG2 + 2)
#define RING_CONTROL                                                                       \
    (DMA_CTRL_ENABLE | DMA_CTRL_HIGH_PRIORITY | DMA_CTRL_WORDS | DMA_CTRL_INCREMENT_READ | \
     DMA_CTRL_READ_RING(RING_BYTES_LOG2) | DMA_CTRL_PACE(DMA_REQUEST_NONE))
_Static_assert(CYCLE_FEED_RING == 1 << CYCLE_FEED_RING_LOG2, "the ring's two sizes agree");

static void set_ring_channel(uint32_t channel, const volatile void* from, volatile uint32_t* to) {
    DMA_READ_ADDR(channel) = (uint32_t)from;
    DMA_WRITE_ADDR(channel) = (uint32_t)to;
    DMA_TRANS_COUNT(channel) = 1;
}

void cycle_feed_start(const struct cycle_feed* feed) {
    const uint32_t table = feed->table_channel;
    DMA_WRITE_ADDR(table) = (uint32_t)&PIO_TXF(feed->machine.block, feed->machine.machine);
    DMA_AL1_CTRL(table) = DMA_CTRL_ENABLE | DMA_CTRL_HIGH_PRIORITY | DMA_CTRL_WORDS | DMA_CTRL_INCREMENT_READ |
                          DMA_CTRL_CHAIN_TO(feed->count_channel) | DMA_CTRL_PACE(feed->request);
    set_ring_channel(feed->address_channel, feed->tables, &DMA_AL3_READ_ADDR_TRIG(table));
    DMA_AL1_CTRL(feed->address_channel) = RING_CONTROL | DMA_CTRL_CHAIN_TO(feed->address_channel);
    set_ring_channel(feed->count_channel, feed->counts, &DMA_TRANS_COUNT(table));
    DMA_CTRL_TRIG(feed->count_channel) = RING_CONTROL | DMA_CTRL_CHAIN_TO(feed->address_channel);
}

void cycle_feed_stop(const struct cycle_feed* feed) {
    // All disabled first, and chained to themselves, lest one restarts another during the abort. BUSY tells when that is over
    // (2.5.5.3); the interrupt that it may raise (erratum RP2040-E13) is nobody's.
    const uint32_t channels[] = {feed->table_channel, feed->count_channel, feed->address_channel};
    for (int i = 0; i < 3; i++) DMA_AL1_CTRL(channels[i]) = DMA_CTRL_STOPPED(channels[i]);
    for (int i = 0; i < 3; i++) {
        DMA_CHAN_ABORT = 1u << channels[i];
        while (DMA_AL1_CTRL(channels[i]) & DMA_CTRL_BUSY) {
        }
    }
}

uint32_t cycle_feed_begun(const struct cycle_feed* feed) {
    return (DMA_READ_ADDR(feed->address_channel) - (uint32_t)feed->tables) / 4 % CYCLE_FEED_RING;
}

uint32_t cycle_feed_next_word(const struct cycle_feed* feed) {
    return DMA_READ_ADDR(feed->table_channel);
}
