// SPDX-License-Identifier: MIT
// CAN news: what the board tells everybody on the bus, unasked: its state, the bus's health, each cycle's digest (PROTOCOL.md,
// "CAN"). Frames that find no room are told in a later turn.
#ifndef OLS_CAN_NEWS_H
#define OLS_CAN_NEWS_H

#include <stdint.h>

#include "isotp.h"

// State and health are due at once.
void can_news_init(void);

// Once each turn of the main loop: the state comes first, what may take long after all messages.
void can_news_tell_state(uint64_t now_us);
void can_news_tell_rest(const struct isotp* isotp, uint64_t now_us);

#endif
