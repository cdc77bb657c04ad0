// SPDX-License-Identifier: MIT
// Start-up: vector tables, copying the image from flash to SRAM, and what happens on an unexpected exception.
#include <stdint.h>

#include "board_rp2040.h"
#include "clocks.h"
#include "fault.h"
#include "interrupts.h"
#include "rp2040.h"

// Addresses from stage.ld.
extern uint32_t ram_image_begin[], ram_image_end[], ram_image_in_flash[], bss_begin[], bss_end[], stack_top[];

int main(void);

typedef union {
    const void* stack;
    void (*handler)(void);
} vector;

// Runs in flash: nothing of the image is in SRAM yet, so no call may leave flash before the copy.
__attribute__((section(".reset"), noreturn)) static void reset(void) {
    clocks_start();
    const volatile uint32_t* from = ram_image_in_flash;
    for (volatile uint32_t* to = ram_image_begin; to < ram_image_end;) *to++ = *from++;
    for (volatile uint32_t* to = bss_begin; to < bss_end;) *to++ = 0;
    extern const vector vectors[];
    SCB_VTOR = (uint32_t)vectors;
    main();
    for (;;) {
    }
}

static void unexpected_exception(void) {
    fault_in_exception();
}

__attribute__((section(".flash_vectors"), used)) static const vector flash_vectors[] = {{stack_top},
                                                                                        {.handler = reset}};

// ARMv6-M B1.5.3, then RP2040 datasheet 2.3.2. VTOR wants 256-byte alignment.
__attribute__((aligned(256))) const vector vectors[16 + IRQ_COUNT] = {
    [0] = {stack_top},
    [1] = {.handler = reset},
    [2 ... 15] = {.handler = unexpected_exception},
    [16 + IRQ_TIMER_0] = {.handler = interrupt_tick},
    [16 + IRQ_TIMER_1] = {.handler = interrupt_heartbeat},
    [16 + IRQ_TIMER_2] = {.handler = interrupt_trigger_late},
    [17 + IRQ_TIMER_2... 15 + IRQ_USBCTRL] = {.handler = unexpected_exception},
    [16 + IRQ_USBCTRL] = {.handler = interrupt_usb},
    [17 + IRQ_USBCTRL... 15 + IRQ_PIO0_0] = {.handler = unexpected_exception},
    [16 + IRQ_PIO0_0] = {.handler = interrupt_player},
    [17 + IRQ_PIO0_0... 15 + IRQ_PIO1_0] = {.handler = unexpected_exception},
    [16 + IRQ_PIO1_0] = {.handler = interrupt_light},
    [16 + IRQ_PIO1_1] = {.handler = interrupt_trigger},
    [17 + IRQ_PIO1_1... 15 + IRQ_GPIO] = {.handler = unexpected_exception},
    [16 + IRQ_GPIO] = {.handler = interrupt_stop_inputs},
    [17 + IRQ_GPIO... 15 + IRQ_CAN] = {.handler = unexpected_exception},
    [16 + IRQ_CAN] = {.handler = mcp2515_interrupt},
};
