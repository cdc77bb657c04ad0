// SPDX-License-Identifier: MIT
// Receptor: the edges of a photo-receptor at GENLOCK, debounced and counted.
#ifndef OLS_RECEPTOR_H
#define OLS_RECEPTOR_H

#include <stdint.h>

// Loads the PIO program, behind witness's and light watch's. Once.
void receptor_init(void);

// Watches GENLOCK from receptor_start on: a level counts once it stayed for `debounce_ticks`, even and at least
// OLS_DEBOUNCE_TICKS_MIN. Start it after the player, which is then ready for the first edge.
void receptor_arm(uint32_t debounce_ticks);
void receptor_start(void);
void receptor_stop(void);

// Rises since receptor_arm.
uint32_t receptor_edges(void);

#endif
