// SPDX-License-Identifier: MIT
// USB watch: whether the controller still answers (erratum RP2040-E15: a bus error on a bulk IN can lock it up, and nothing but
// a reset as a peripheral ends that).
#ifndef OLS_USB_WATCH_H
#define OLS_USB_WATCH_H

#include <stdbool.h>
#include <stdint.h>

// The controller is as new.
void usb_watch_begin(void);

// A bus reset: the host will ask for something soon.
void usb_watch_reset(uint32_t now_us);

// Something has come that proves that the controller answers: a setup packet, or a buffer that is done.
void usb_watch_answered(void);

// A bus error while the host has a packet to fetch.
void usb_watch_error(uint32_t now_us);

// True once it has answered nothing for so long that it must be taken for locked up.
bool usb_watch_is_locked_up(uint32_t now_us);

#endif
