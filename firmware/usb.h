// SPDX-License-Identifier: MIT
// USB: a full-speed vendor-class device, the transport of transport.h over bulk OUT 0x01 and bulk IN 0x82.
#ifndef OLS_USB_H
#define OLS_USB_H

#include "transport.h"

// Appears on the bus. Once, after board_init.
void usb_init(void);

// Once each turn of the main loop: serves control requests and moves packets.
void usb_poll(void);

extern const struct transport usb_transport;

#endif
