// SPDX-License-Identifier: MIT
// Witness: PIO block 1 watches TRIG0 through the pin's input; DMA writes its stamps to a ring in SRAM.
#include "witness.h"

#include "board.h"
#include "board_rp2040.h"
#include "pio.h"
#include "pulse.h"

enum { CHANNEL = 4, RING_BYTES_LOG2 = 12 };
#define COUNT_MAX 0xffffffffu  // three weeks at 2160 triggers a second
_Static_assert(sizeof(uint32_t) * WITNESS_RING_STAMPS == 1 << RING_BYTES_LOG2, "the DMA's ring is the buffer");

static const struct pio_machine machine = {PIO1_BASE, 0};
static uint32_t ring[WITNESS_RING_STAMPS] __attribute__((aligned(1 << RING_BYTES_LOG2)));

void witness_init(void) {
    static const uint16_t program[] = WITNESS_PROGRAM;
    pio_load(PIO1_BASE, 0, program, WITNESS_WORDS);
    PIO_SM_CLKDIV(PIO1_BASE, machine.machine) = PIO_CLKDIV(1);
    PIO_SM_EXECCTRL(PIO1_BASE, machine.machine) =
        PIO_EXEC_WRAP(WITNESS_WRAP_TARGET, WITNESS_WRAP) | PIO_EXEC_JMP_PIN(BOARD_PIN_TRIG0);
    REGISTER(PIO_IRQ1_INTE(PIO1_BASE)) = PIO_INTE_FLAG(WITNESS_STAMPED);
}

void witness_arm(enum ols_start_source start) {
    TIMER_ARMED = 1u << BOARD_ALARM_TRIGGER;  // of the run before
    PIO_IRQ(PIO1_BASE) = 1u << WITNESS_STAMPED;
    DMA_AL1_CTRL(CHANNEL) = DMA_CTRL_STOPPED(CHANNEL);
    DMA_CHAN_ABORT = 1u << CHANNEL;
    while (DMA_AL1_CTRL(CHANNEL) & DMA_CTRL_BUSY) {
    }
    pio_stop(machine, PIO_SHIFT_JOIN_RX);
    PIO_SM_PINCTRL(PIO1_BASE, machine.machine) =
        PIO_PINS_IN(start == OLS_START_EACH_CYCLE_BY_EDGE ? BOARD_PIN_PHOTO : BOARD_PIN_GENLOCK);
    pio_execute(machine, PIO_MOV_X_ONES);
    pio_execute(machine, PIO_JMP | (start == OLS_START_BY_COMMAND ? WITNESS_WRAP_TARGET : WITNESS_GENLOCK));
    DMA_READ_ADDR(CHANNEL) = (uint32_t)&PIO_RXF(PIO1_BASE, machine.machine);
    DMA_WRITE_ADDR(CHANNEL) = (uint32_t)ring;
    DMA_TRANS_COUNT(CHANNEL) = COUNT_MAX;
    DMA_CTRL_TRIG(CHANNEL) = DMA_CTRL_ENABLE | DMA_CTRL_WORDS | DMA_CTRL_INCREMENT_WRITE |
                             DMA_CTRL_WRITE_RING(RING_BYTES_LOG2) | DMA_CTRL_CHAIN_TO(CHANNEL) |
                             DMA_CTRL_PACE(DMA_REQUEST_PIO1_RX0);
}

void witness_start(void) {
    REGISTER_SET(PIO_CTRL(PIO1_BASE)) = PIO_CTRL_ENABLE(machine.machine);
}

uint32_t witness_count(void) {
    return COUNT_MAX - DMA_TRANS_COUNT(CHANNEL);
}

uint32_t witness_stamp(uint32_t n) {
    return *(volatile uint32_t*)&ring[n % WITNESS_RING_STAMPS];
}
