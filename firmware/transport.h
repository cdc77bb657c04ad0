// SPDX-License-Identifier: MIT
// Transport: a byte stream to the host and back. usb.c is one.
#ifndef OLS_TRANSPORT_H
#define OLS_TRANSPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TRANSPORT_PACKET_BYTES = 64 };

// True while a host has set the board up and the bus is alive.
bool transport_is_attached(void);

// Counts attachments: when it changes, bytes before and after do not belong together.
uint32_t transport_session(void);

// Moves a received packet to `bytes` (room for TRANSPORT_PACKET_BYTES); 0 when there is none.
size_t transport_receive(uint8_t* bytes);

// True when the previous send is over.
bool transport_can_send(void);

// Sends; `bytes` must stay as they are until transport_can_send.
void transport_send(const uint8_t* bytes, size_t byte_count);

#endif
