// SPDX-License-Identifier: MIT
// Light watch: one machine that counts, and its flag; interrupts.c has the handler.
#include "light_watch.h"

#include "board.h"
#include "pio.h"
#include "pulse.h"
#include "witness.h"

enum { ORIGIN = WITNESS_WORDS };
_Static_assert(ORIGIN + LIGHT_WATCH_WORDS <= 32, "both programs fit the block's instruction memory");

static const struct pio_machine machine = {PIO1_BASE, 1};

void light_watch_allow(uint32_t longest_ticks) {
    // As many steps as the longest light takes, and the one after them raises the flag (pulse.pio).
    PIO_TXF(PIO1_BASE, machine.machine) = longest_ticks / LIGHT_WATCH_STEP_TICKS;
    pio_execute(machine, PIO_PULL);
    pio_execute(machine, PIO_MOV_Y_OSR);
}

void light_watch_arm(uint32_t longest_ticks) {
    static const uint16_t program[] = LIGHT_WATCH_PROGRAM;
    pio_stop(machine, 0);
    pio_load(PIO1_BASE, ORIGIN, program, LIGHT_WATCH_WORDS);
    PIO_SM_CLKDIV(PIO1_BASE, machine.machine) = PIO_CLKDIV(1);
    PIO_SM_EXECCTRL(PIO1_BASE, machine.machine) =
        PIO_EXEC_WRAP(ORIGIN + LIGHT_WATCH_WRAP_TARGET, ORIGIN + LIGHT_WATCH_WRAP) |
        PIO_EXEC_JMP_PIN(BOARD_PIN_LIGHT_EN);
    PIO_SM_PINCTRL(PIO1_BASE, machine.machine) = PIO_PINS_IN(BOARD_PIN_LIGHT_EN);
    PIO_IRQ(PIO1_BASE) = 1u << WITNESS_LIGHT_TOO_LONG;
    light_watch_allow(longest_ticks);
    pio_execute(machine, PIO_JMP | (ORIGIN + LIGHT_WATCH_WRAP_TARGET));
    REGISTER(PIO_IRQ0_INTE(PIO1_BASE)) = PIO_INTE_FLAG(WITNESS_LIGHT_TOO_LONG);
    REGISTER_SET(PIO_CTRL(PIO1_BASE)) = PIO_CTRL_ENABLE(machine.machine);
}
