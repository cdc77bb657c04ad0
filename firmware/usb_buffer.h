// SPDX-License-Identifier: MIT
// USB buffers: handing one to the controller, and taking it back (RP2040 datasheet 4.1.2.5.1). Buffer 0 of each endpoint.
#ifndef OLS_USB_BUFFER_H
#define OLS_USB_BUFFER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// An endpoint's half: its bit in BUFF_STATUS, EP_ABORT and EP_ABORT_DONE (4.1.4).
#define USB_IN(endpoint) (2u * (endpoint))
#define USB_OUT(endpoint) (2u * (endpoint) + 1)

// Clears the controller's memory: no endpoint, no buffer. Only while the controller is off.
void usb_buffer_clear_all(void);

// `fields` are the buffer control's without AVAILABLE.
void usb_buffer_give(uint32_t half, uint32_t fields);

// The buffer is the program's from now on, whoever had it. True when the controller had it, so that nothing went through it.
bool usb_buffer_revoke(uint32_t half);

#endif
