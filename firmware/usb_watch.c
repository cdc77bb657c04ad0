// SPDX-License-Identifier: MIT
// USB watch. A controller that locks up cannot say so, and silence alone proves nothing: a host need not ask. Silence is taken
// for a lock-up where the host must have asked:
// - After a bus error while a packet waits to be fetched. The host tries a transaction that failed again, three times, within
//   frames (USB 2.0 5.8.5), and a retry that the controller hears ends the wait. A host that gives up, and asks for nothing
//   else, has a link that is broken anyway.
// - After a bus reset of a controller that has answered before: each host asks for the device's descriptor then. One that is as
//   new is not locked up, however long its host takes; so the board does not leave a slow host's bus again and again.
// Errors of other devices' packets behind a hub may be flagged, too, so that the first time is long for a retry.
#include "usb_watch.h"

enum { SILENT_AFTER_ERROR_US = 250000, SILENT_AFTER_RESET_US = 500000 };

static enum { NOTHING_DUE, RETRY_DUE, SETUP_DUE } due;
static bool has_answered;
static uint32_t since_us;

void usb_watch_begin(void) {
    has_answered = false;
    due = NOTHING_DUE;
}

void usb_watch_answered(void) {
    has_answered = true;
    due = NOTHING_DUE;
}

void usb_watch_reset(uint32_t now_us) {
    if (due == SETUP_DUE || !has_answered) return;  // from the first of several on
    due = SETUP_DUE;
    since_us = now_us;
}

void usb_watch_error(uint32_t now_us) {
    if (due != NOTHING_DUE) return;
    due = RETRY_DUE;
    since_us = now_us;
}

bool usb_watch_is_locked_up(uint32_t now_us) {
    if (due == NOTHING_DUE) return false;
    return now_us - since_us >= (due == RETRY_DUE ? SILENT_AFTER_ERROR_US : SILENT_AFTER_RESET_US);
}
