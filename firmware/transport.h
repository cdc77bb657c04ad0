// SPDX-License-Identifier: MIT
// Transport: a byte stream to a host and back. usb.c and can.c are the two.
#ifndef OLS_TRANSPORT_H
#define OLS_TRANSPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TRANSPORT_PACKET_BYTES = 64 };

struct transport {
    // True while a host has set the board up and the bus is alive.
    bool (*is_attached)(void);

    // Counts attachments: when it changes, bytes before and after do not belong together.
    uint32_t (*session)(void);

    // Moves what was received to `bytes` (room for TRANSPORT_PACKET_BYTES); 0 when there is nothing.
    size_t (*receive)(uint8_t* bytes);

    // True when the previous send is over.
    bool (*can_send)(void);

    // Sends; `bytes` must stay as they are until can_send.
    void (*send)(const uint8_t* bytes, size_t byte_count);
};

#endif
