// SPDX-License-Identifier: MIT
// CAN: the transport of transport.h by ISO-TP (PROTOCOL.md, "CAN"); can_news.h has what the board tells everybody on the bus.
#ifndef OLS_CAN_H
#define OLS_CAN_H

#include <stdbool.h>

#include "transport.h"

#ifdef __cplusplus
extern "C" {
#endif

// Joins the bus, if there is a controller. Once, after board_init.
void can_init(void);

// Once each turn of the main loop: takes frames from the bus and puts frames on it.
void can_poll(void);

// True when nothing waits to be put on the bus, or nobody is there to take it.
bool can_is_idle(void);

// True when a controller was found.
bool can_is_there(void);

extern const struct transport can_transport;

#ifdef __cplusplus
}
#endif

#endif
