// SPDX-License-Identifier: MIT
// Link: answers the host's messages.
#ifndef OLS_LINK_H
#define OLS_LINK_H

// Once each turn of the main loop: takes what has arrived and answers it, one request at a time, in order.
void link_poll(void);

#endif
