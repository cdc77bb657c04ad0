// SPDX-License-Identifier: MIT
// Fault: the first doubt ends the light. It is latched with its cause, slot and tick until the host clears it.
#ifndef OLS_FAULT_H
#define OLS_FAULT_H

#include <stdbool.h>
#include <stdint.h>

#include "wire.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fault {
    enum ols_fault cause;  // OLS_FAULT_NONE: no fault is latched
    uint16_t slot;
    uint64_t ticks;  // since start
};

// After boot: latches what ended the previous run, if the watchdog did.
void fault_init(void);

// Dark first, then latches. A fault that is already latched stays, for what follows it is mostly its consequence.
void fault_latch(enum ols_fault cause, uint16_t slot, uint64_t ticks);

// What is latched.
struct fault fault_latched(void);

#define FAULT_LIGHT_STUCK_TEXT "LIGHT_EN's pad is lit although the firmware holds it dark: switch the lamps' supply off"

// False while the light's pad is lit, which is the fault that is latched from then on. While nothing may be lit.
bool fault_clear(void);

// While a program plays: where it is, so that a hang is reported with slot and tick after the watchdog's reset.
void fault_note_progress(uint16_t slot, uint64_t ticks);
void fault_note_idle(void);

// From an exception handler: dark, note the cause, reset. The fault is latched after the reset.
__attribute__((noreturn)) void fault_in_exception(void);

#ifdef __cplusplus
}
#endif

#endif
