// SPDX-License-Identifier: MIT
// The firmware's one loop. Light and triggers do not wait for it: PIO plays them (pulse.pio), and handlers end them in the
// dark (interrupts.h).
#include "board.h"
#include "can.h"
#include "fault.h"
#include "healthy.h"
#include "interrupts.h"
#include "link.h"
#include "player.h"
#include "receptor.h"
#include "stage.h"
#include "usb.h"
#include "witness.h"

int main(void) {
    board_init();
    player_init();
    witness_init();
    receptor_init();
    fault_init();
    stage_init();
    usb_init();
    can_init();
    interrupts_init();
    for (;;) {
        board_feed_watchdog();
        usb_poll(!stage_is_armed());
        can_poll();
        stage_poll(link_host_is_there());
        usb_poll(!stage_is_armed());  // again: a packet a turn would be too few for every trigger of 20 000 slots/s
        const bool is_busy = link_poll();
        healthy_turn();
        if (!is_busy) board_sleep();
        if (link_is_leaving()) board_enter_bootloader();
    }
}
