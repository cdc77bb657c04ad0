// SPDX-License-Identifier: MIT
// USB line: erratum RP2040-E5. A chip of stepping B0 or B1 leaves a bus reset only after 800 us of idle bus, which a busy hub
// never gives; then the line is made to look idle for as long.
#ifndef OLS_USB_LINE_H
#define OLS_USB_LINE_H

#include <stdbool.h>
#include <stdint.h>

// A bus reset has begun.
void usb_line_reset(void);

// Once each turn: `status` is SIE_STATUS. `may_borrow` says that GPIO 15 may be another's for up to 2 ms: nothing is armed.
void usb_line_poll(uint32_t status, uint32_t now_us, bool may_borrow);

// Gives GPIO 15 back at once, if it is borrowed; what was in doubt is forgotten, for the next bus reset to tell.
void usb_line_release(void);

// True while the line has been left as it is because GPIO 15 was needed, so that the host may not have been heard.
bool usb_line_is_in_doubt(void);

#endif
