// SPDX-License-Identifier: MIT
// USB: a full-speed vendor-class device, the transport of transport.h over bulk OUT 0x01 and bulk IN 0x82.
#ifndef OLS_USB_H
#define OLS_USB_H

#include <stdbool.h>

#include "transport.h"

// Appears on the bus. Once, after board_init.
void usb_init(void);

// Once each turn of the main loop: serves control requests and moves packets. What borrows GPIO 15 (usb_line.h) waits until
// nothing is armed.
void usb_poll(bool nothing_is_armed);

extern const struct transport usb_transport;

#endif
