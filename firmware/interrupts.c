// SPDX-License-Identifier: MIT
// Interrupts: from a cause to stop_now. docs/firmware.md, "How each doubt ends dark", has the times; tests/hil/12_faults.py
// measures them, and firmware/tools/count_cycles.py counts what they are bounded by.
#include "interrupts.h"

#include "board.h"
#include "board_rp2040.h"
#include "link.h"
#include "player.h"
#include "rp2040.h"
#include "schedule.h"
#include "stop.h"
#include "witness.h"

// A trigger's stamp is there a microsecond after its rise; the timer's steps and the handler's own delay add three.
enum { TRIGGER_LATE_US = 4 };

void interrupts_init(void) {
    NVIC_IPR(IRQ_TIMER_2) = NVIC_PRIORITY(IRQ_TIMER_2, 1);
    NVIC_IPR(IRQ_PIO1_1) = NVIC_PRIORITY(IRQ_PIO1_1, 1);
    NVIC_ISER = 1u << IRQ_TIMER_0 | 1u << IRQ_TIMER_1 | 1u << IRQ_TIMER_2 | 1u << IRQ_USBCTRL | 1u << IRQ_PIO0_0 |
                1u << IRQ_PIO1_0 | 1u << IRQ_PIO1_1 | 1u << IRQ_GPIO;
}

void interrupt_tick(void) {
    TIMER_INTR = 1u << BOARD_ALARM_TICK;
    board_wake();
}

void interrupt_heartbeat(void) {
    TIMER_INTR = 1u << BOARD_ALARM_HEARTBEAT;
    stop_now(OLS_FAULT_HEARTBEAT);
    board_wake();
}

void interrupt_usb(void) {
    const uint32_t interrupts = USB_INTS;
    // The suspend state's change is no loss by itself: the end of a suspension is one, too.
    const bool is_lost =
        interrupts & USB_INT_BUS_RESET || (interrupts & USB_INT_SUSPEND && USB_SIE_STATUS & USB_SIE_SUSPENDED);
    if (is_lost && link_usb_has_armed()) stop_now(OLS_FAULT_HOST_LOST);
    REGISTER_CLEAR(USB_INTE) = interrupts;  // until usb_poll
    board_wake();
}

void interrupt_player(void) {
    const uint32_t events = player_events();
    if (events & PLAYER_TIMELINE_STARVED) stop_now(OLS_FAULT_TIMELINE_STARVED);
    if (events & PLAYER_SHIFTER_STARVED) stop_now(OLS_FAULT_SHIFTER_STARVED);
    REGISTER_CLEAR(PIO_IRQ0_INTE(PIO0_BASE)) = events * PIO_INTE_FLAG(0);  // until player_stop
    board_wake();
}

void interrupt_light(void) {
    stop_now(OLS_FAULT_OVER_DUTY);
    REGISTER_CLEAR(PIO_IRQ0_INTE(PIO1_BASE)) = PIO_INTE_FLAG(WITNESS_LIGHT_TOO_LONG);  // until light_watch_arm
    board_wake();
}

// GPIO_EDGE_LOW(n) for stop input n; their pins are in one register, or in two.
static uint32_t fallen_stop_inputs(void) {
    enum { FIRST = BOARD_PIN_STOP_INPUTS % 8 };
    uint32_t fallen = GPIO_INTS(BOARD_PIN_STOP_INPUTS) >> 4 * FIRST;
    if (FIRST + BOARD_STOP_INPUTS > 8)
        fallen |= GPIO_INTS(BOARD_PIN_STOP_INPUTS + BOARD_STOP_INPUTS - 1) << 4 * (8 - FIRST) % 32;
    return fallen;
}

void interrupt_stop_inputs(void) {
    static const enum ols_fault causes[BOARD_STOP_INPUTS] = {
        [BOARD_EMERGENCY_STOP] = OLS_FAULT_EMERGENCY_STOP,
        [BOARD_OVER_TEMPERATURE] = OLS_FAULT_OVER_TEMPERATURE,
        [BOARD_OPEN_LAMP] = OLS_FAULT_OPEN_LAMP,
    };
    const uint32_t fallen = fallen_stop_inputs();
    for (uint32_t n = 0; n < BOARD_STOP_INPUTS; n++) {
        const uint32_t pin = BOARD_PIN_STOP_INPUTS + n;
        if (!(fallen & GPIO_EDGE_LOW(n))) continue;
        stop_now(causes[n]);
        REGISTER_CLEAR((uint32_t)&GPIO_INTE(pin)) = GPIO_EDGE_LOW(pin);  // until stop_guard
    }
    REGISTER_CLEAR((uint32_t)&GPIO_INTE(BOARD_PIN_GENLOCK)) = GPIO_EDGE_HIGH(BOARD_PIN_GENLOCK);  // until stage_poll
    if (GPIO_INTS(BOARD_PIN_CAN_INTERRUPT) & GPIO_EDGE_LOW(BOARD_PIN_CAN_INTERRUPT)) {
        REGISTER_CLEAR((uint32_t)&GPIO_INTE(BOARD_PIN_CAN_INTERRUPT)) = GPIO_EDGE_LOW(BOARD_PIN_CAN_INTERRUPT);
        board_raise_can_interrupt();  // until it has looked
    }
    board_wake();
}

// Only this handler uses the divider, which is shared state, and needs no software division of 200 instructions.
static uint32_t whole_us(uint32_t ticks) {
    SIO_DIV_UDIVIDEND = ticks;
    SIO_DIV_UDIVISOR = BOARD_TICKS_PER_US;
    __asm volatile("b 1f\n1:\tb 1f\n1:\tb 1f\n1:\tb 1f\n1:");  // two cycles each
    return SIO_DIV_QUOTIENT;
}

void interrupt_trigger(void) {
    const uint32_t now_us = TIMER_RAW_LOW;
    TIMER_ARMED = 1u << BOARD_ALARM_TRIGGER;  // it is not late
    TIMER_INTR = 1u << BOARD_ALARM_TRIGGER;
    PIO_IRQ(PIO1_BASE) = 1u << WITNESS_STAMPED;
    while (schedule_taken() != witness_count()) {
        if (!schedule_take(witness_stamp(schedule_taken()))) {
            stop_now(OLS_FAULT_SLIPPED);
            return board_wake();
        }
        schedule_seek();
    }
    const uint32_t ticks = schedule_ticks_to_next();
    if (ticks > 0) TIMER_ALARM(BOARD_ALARM_TRIGGER) = now_us + whole_us(ticks) + TRIGGER_LATE_US;
}

void interrupt_trigger_late(void) {
    const bool is_late = TIMER_INTR & 1u << BOARD_ALARM_TRIGGER;
    TIMER_INTR = 1u << BOARD_ALARM_TRIGGER;
    // Without a stamp; with one, interrupt_trigger is about to judge it.
    if (is_late && schedule_taken() == witness_count()) stop_now(OLS_FAULT_SLIPPED);
    board_wake();
}
