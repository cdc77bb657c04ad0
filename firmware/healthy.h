// SPDX-License-Identifier: MIT
// Healthy: the main loop's proof of life, and that LIGHT_EN's pad obeys, as changes of the pin HEALTHY. A charge pump behind
// it holds a contactor in the lamps' supply (docs/hardware.md, "Healthy"): no pulse, no supply, whatever failed.
#ifndef OLS_HEALTHY_H
#define OLS_HEALTHY_H

#ifdef __cplusplus
extern "C" {
#endif

// A turn of the main loop sleeps for 1 ms at most and works for 0.7 ms at most, for 2.2 ms with as many triggers a second as can
// be played: HEALTHY changes at least this often.
enum { HEALTHY_CHANGE_US_MAX = 2500 };

// At the end of each turn of the main loop, when it has done all its parts. Changes the pin, unless the pad is lit while it must
// be dark, which is the fault OLS_FAULT_LIGHT_STUCK, or the light watch has seen too long a light: not again then before the
// fault is cleared.
void healthy_turn(void);

#ifdef __cplusplus
}
#endif

#endif
