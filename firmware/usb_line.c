// SPDX-License-Identifier: MIT
// USB line. The work-around of erratum RP2040-E5 (RP2040 datasheet, appendix B): after the reset the controller is moved from
// its PHY to the digital pads, where GPIO 15 is D+ and GPIO 16, with any function but 8, a low D-: the idle state J. The PHY's
// pull-up is held meanwhile, so that the host sees nothing of it. A host talks to the device 10 ms after a reset (USB 2.0
// 7.1.7.5); this takes one turn until the reset's end is seen, 1 ms, and 2 ms at most.
#include "usb_line.h"

#include "board.h"
#include "rp2040.h"

enum { PIN_DP = 15, GIVE_UP_US = 2000 };

static enum { NOTHING_TO_DO, WAITING_FOR_END, BORROWING } state;
static bool in_doubt;
static uint32_t begin_us, gpio_before, pad_before, can_before;

static void borrow(uint32_t now_us) {
    // On a board whose CAN controller hears its SPI through this pin, nobody talks to it meanwhile.
    can_before = (int)BOARD_PIN_CAN_MOSI == (int)PIN_DP ? NVIC_ISER & 1u << IRQ_CAN : 0;
    NVIC_ICER = can_before;
    gpio_before = GPIO_CTRL(PIN_DP);
    pad_before = PAD_GPIO(PIN_DP);
    PAD_GPIO(PIN_DP) = pad_before | PAD_PULL_UP | PAD_PULL_DOWN;  // both: keeps the level that the wire has
    GPIO_CTRL(PIN_DP) = GPIO_FUNCTION_USB_MUXING | GPIO_OUTPUT_NEVER | GPIO_INPUT_HIGH;
    USB_PHY_DIRECT = USB_PHY_DP_PULLUP;
    USB_PHY_DIRECT_OVERRIDE = USB_PHY_DP_PULLUP_OVERRIDE;
    USB_MUXING = USB_MUXING_TO_DIGITAL_PAD | USB_MUXING_SOFTCON;
    begin_us = now_us;
    state = BORROWING;
}

void usb_line_release(void) {
    if (state == BORROWING) {
        USB_MUXING = USB_MUXING_TO_PHY | USB_MUXING_SOFTCON;
        USB_PHY_DIRECT_OVERRIDE = 0;
        USB_PHY_DIRECT = 0;
        GPIO_CTRL(PIN_DP) = gpio_before;
        PAD_GPIO(PIN_DP) = pad_before;
        NVIC_ISER = can_before;
    }
    state = NOTHING_TO_DO;
    in_doubt = false;
}

void usb_line_reset(void) {
    usb_line_release();
    if (SYSINFO_CHIP_REVISION < REVISION_B2) state = WAITING_FOR_END;
}

void usb_line_poll(uint32_t status, uint32_t now_us, bool may_borrow) {
    const bool connected = status & USB_SIE_CONNECTED;
    if (state == BORROWING && (connected || now_us - begin_us >= GIVE_UP_US)) usb_line_release();
    if (state != WAITING_FOR_END || (status & USB_SIE_LINE_STATE) == USB_SIE_LINE_SE0) return;
    state = NOTHING_TO_DO;
    if (connected) return;  // the bus was idle for long enough
    in_doubt = !may_borrow;
    if (may_borrow) borrow(now_us);
}

bool usb_line_is_in_doubt(void) {
    return in_doubt;
}
