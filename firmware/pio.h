// SPDX-License-Identifier: MIT
// What player, witness and receptor do to a PIO state machine.
#ifndef OLS_PIO_H
#define OLS_PIO_H

#include <stdint.h>

#include "rp2040.h"

struct pio_machine {
    uint32_t block;    // PIO0_BASE or PIO1_BASE
    uint32_t machine;  // 0..3
};

// Writes a program to the block's instruction memory from `origin` on, its jumps relocated.
static inline void pio_load(uint32_t block, uint32_t origin, const uint16_t* program, uint32_t words) {
    for (uint32_t i = 0; i < words; i++) {
        const uint32_t is_jmp = program[i] >> 13 == 0;
        PIO_INSTR_MEM(block, origin + i) = program[i] + (is_jmp ? origin : 0);
    }
}

static inline void pio_execute(struct pio_machine m, uint32_t instruction) {
    PIO_SM_INSTR(m.block, m.machine) = instruction;
}

// Loads a scratch register through the FIFO; the machine must be stopped and its FIFO empty.
static inline void pio_set_scratch(struct pio_machine m, uint32_t value, uint32_t mov_from_osr) {
    PIO_TXF(m.block, m.machine) = value;
    pio_execute(m, PIO_PULL);
    pio_execute(m, mov_from_osr);
}

// Stops the machine, empties its FIFOs (changing FJOIN does, datasheet 3.7 SM0_SHIFTCTRL) and forgets its state.
static inline void pio_stop(struct pio_machine m, uint32_t shift_control) {
    REGISTER_CLEAR(PIO_CTRL(m.block)) = PIO_CTRL_ENABLE(m.machine);
    // The other way of one join, never both joined: neither FIFO would have room.
    PIO_SM_SHIFTCTRL(m.block, m.machine) =
        shift_control ^ (shift_control & PIO_SHIFT_JOIN_RX ? PIO_SHIFT_JOIN_RX : PIO_SHIFT_JOIN_TX);
    PIO_SM_SHIFTCTRL(m.block, m.machine) = shift_control;
    REGISTER_SET(PIO_CTRL(m.block)) = PIO_CTRL_RESTART(m.machine);
}

#endif
