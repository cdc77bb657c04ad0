// SPDX-License-Identifier: MIT
// Receptor: PIO block 1 debounces GENLOCK onto the pin PHOTO; DMA counts its rises.
#include "receptor.h"

#include "board.h"
#include "pio.h"
#include "pulse.h"

enum { ORIGIN = WITNESS_WORDS + LIGHT_WATCH_WORDS, CHANNEL = 11, COUNT_MAX = 0x7fffffff };
_Static_assert(ORIGIN + RECEPTOR_WORDS <= 32, "all three programs fit the block's instruction memory");
_Static_assert((int)RECEPTOR_DEBOUNCE_TICKS_LEAST == (int)OLS_DEBOUNCE_TICKS_MIN,
               "the least debounce is what PIO takes");

static const struct pio_machine machine = {PIO1_BASE, 2};
static uint32_t last_word;  // written by DMA: the words only count

void receptor_init(void) {
    static const uint16_t program[] = RECEPTOR_PROGRAM;
    pio_load(PIO1_BASE, ORIGIN, program, RECEPTOR_WORDS);
    PIO_SM_CLKDIV(PIO1_BASE, machine.machine) = PIO_CLKDIV(1);
    PIO_SM_EXECCTRL(PIO1_BASE, machine.machine) =
        PIO_EXEC_WRAP(ORIGIN + RECEPTOR_WRAP_TARGET, ORIGIN + RECEPTOR_WRAP) | PIO_EXEC_JMP_PIN(BOARD_PIN_GENLOCK);
    PIO_SM_PINCTRL(PIO1_BASE, machine.machine) = PIO_PINS_OUT(BOARD_PIN_PHOTO, 1) | PIO_PINS_IN(BOARD_PIN_GENLOCK);
}

void receptor_stop(void) {
    pio_stop(machine, 0);
    pio_execute(machine, PIO_MOV_PINS_NULL);
    DMA_AL1_CTRL(CHANNEL) = DMA_CTRL_STOPPED(CHANNEL);
    DMA_CHAN_ABORT = 1u << CHANNEL;
    while (DMA_AL1_CTRL(CHANNEL) & DMA_CTRL_BUSY) {
    }
}

void receptor_arm(uint32_t debounce_ticks) {
    receptor_stop();
    pio_set_scratch(machine, (debounce_ticks - RECEPTOR_DEBOUNCE_TICKS_LEAST) / 2, PIO_MOV_Y_OSR);
    pio_execute(machine, PIO_JMP | (ORIGIN + RECEPTOR_HIGH));
    DMA_READ_ADDR(CHANNEL) = (uint32_t)&PIO_RXF(PIO1_BASE, machine.machine);
    DMA_WRITE_ADDR(CHANNEL) = (uint32_t)&last_word;
    DMA_TRANS_COUNT(CHANNEL) = COUNT_MAX;
    DMA_CTRL_TRIG(CHANNEL) =
        DMA_CTRL_ENABLE | DMA_CTRL_WORDS | DMA_CTRL_CHAIN_TO(CHANNEL) | DMA_CTRL_PACE(DMA_REQUEST_PIO1_RX2);
}

void receptor_start(void) {
    REGISTER_SET(PIO_CTRL(PIO1_BASE)) = PIO_CTRL_ENABLE(machine.machine);
}

uint32_t receptor_edges(void) {
    return COUNT_MAX - DMA_TRANS_COUNT(CHANNEL);
}
