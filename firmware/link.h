// SPDX-License-Identifier: MIT
// Link: answers the hosts' messages, over USB and CAN at the same time.
#ifndef OLS_LINK_H
#define OLS_LINK_H

#include <stdbool.h>

// Once each turn of the main loop: takes what has arrived and answers it, one request at a time, in order. True when it
// is not to wait for anything before the next turn: a long request is being worked on.
bool link_poll(void);

// True when the host on USB armed last, so that its loss matters; from any handler.
bool link_usb_has_armed(void);

// False when the host that armed has gone: its bus is dead.
bool link_host_is_there(void);

// True once the host has the answer to its OLS_REBOOT_TO_BOOTLOADER, or has gone: the firmware is to end.
bool link_is_leaving(void);

#endif
