// SPDX-License-Identifier: MIT
// Heartbeat: for how long the host that armed may be silent. Longer is OLS_FAULT_HEARTBEAT, whose handler (interrupts.h) ends
// the light.
#ifndef OLS_HEARTBEAT_H
#define OLS_HEARTBEAT_H

#include <stdint.h>

// From now on it must be heard at least this often; 0: it may be silent.
void heartbeat_begin(uint32_t ticks);

// It has been heard.
void heartbeat_renew(void);

// Nothing can be lit any more: it may be silent.
void heartbeat_end(void);

#endif
