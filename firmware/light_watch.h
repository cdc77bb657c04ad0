// SPDX-License-Identifier: MIT
// Light watch: PIO block 1 measures every light at LIGHT_EN's pad. One that is longer than allowed is the fault
// OLS_FAULT_OVER_DUTY: what was loaded kept the limits, so something between its words and the pad has failed.
#ifndef OLS_LIGHT_WATCH_H
#define OLS_LIGHT_WATCH_H

#include <stdint.h>

// From now on no light may be longer, until the next call. While pins are dark. Loads the PIO program, behind the witness's.
void light_watch_arm(uint32_t longest_ticks);

// From the next rise of the light on, this is the longest; one that is lit already keeps its own. While a program plays.
void light_watch_allow(uint32_t longest_ticks);

#endif
