// SPDX-License-Identifier: MIT
// What a stalled PIO instruction waits for.
export const Stall = Object.freeze({ NONE: 0, TX: 1, RX: 2, IRQ: 3, PIN: 4 });
