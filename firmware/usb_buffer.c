// SPDX-License-Identifier: MIT
// USB buffers. Whoever has AVAILABLE set owns the buffer, its control and its memory; the two sides have clocks of their own.
#include "usb_buffer.h"

#include "board.h"
#include "rp2040.h"

enum { MEMORY_BYTES = 4096 };
enum {
    TRANSACTION_US = 100
};  // the longest there is, a packet of 64 bytes with its tokens, takes 52 us (USB 2.0 5.8.4)

static volatile uint32_t* control_of(uint32_t half) {
    return &USB_BUFFER_CONTROL_IN(0) + half;
}

void usb_buffer_clear_all(void) {
    for (uint32_t offset = 0; offset < MEMORY_BYTES; offset += 4) REGISTER(USB_MEMORY + offset) = 0;
}

void usb_buffer_give(uint32_t half, uint32_t fields) {
    volatile uint32_t* const control = control_of(half);
    *control = fields;
    // AVAILABLE must reach the controller after the rest: a cycle of its 48 MHz are three of ours (4.1.2.5.1).
    __asm volatile("nop\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nnop\nnop");
    *control = fields | USB_BUFFER_AVAILABLE;
}

// Lets a transaction that is under way end; the endpoint answers NAK from then on. Erratum RP2040-E2: chips before B2 do not
// come out of it again, so there the buffer is taken without asking.
static void abort_transactions(uint32_t half) {
    if (SYSINFO_CHIP_REVISION < REVISION_B2) return;
    REGISTER_SET(USB_EP_ABORT) = 1u << half;
    for (const uint64_t begin_us = board_time_us(); board_time_us() - begin_us < TRANSACTION_US;)
        if (USB_EP_ABORT_DONE & 1u << half) return;
}

static void allow_transactions(uint32_t half) {
    if (SYSINFO_CHIP_REVISION < REVISION_B2) return;
    REGISTER_CLEAR(USB_EP_ABORT) = 1u << half;
    USB_EP_ABORT_DONE_CLEAR = 1u << half;
}

bool usb_buffer_revoke(uint32_t half) {
    volatile uint32_t* const control = control_of(half);
    if (!(*control & USB_BUFFER_AVAILABLE)) return false;
    abort_transactions(half);
    const bool unused = *control & USB_BUFFER_AVAILABLE;
    if (unused) *control = 0;
    allow_transactions(half);
    return unused;
}
