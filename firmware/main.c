// SPDX-License-Identifier: MIT
// The firmware's one loop. Light and triggers do not wait for it: PIO plays them (pulse.pio), and handlers end them in the
// dark (interrupts.h).
#include "board.h"
#include "fault.h"
#include "interrupts.h"
#include "link.h"
#include "player.h"
#include "stage.h"
#include "transport.h"
#include "usb.h"
#include "witness.h"

int main(void) {
    board_init();
    player_init();
    witness_init();
    fault_init();
    stage_init();
    usb_init();
    interrupts_init();
    for (;;) {
        board_feed_watchdog();
        usb_poll();
        stage_poll(transport_is_attached());
        if (!link_poll()) board_sleep();
    }
}
