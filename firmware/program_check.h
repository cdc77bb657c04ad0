// SPDX-License-Identifier: MIT
// Program check: reads a program's words in memory once more, a part each turn of the main loop, and compares their CRC with
// what it was when they were made. All at once takes half of the watchdog's time.
#ifndef OLS_PROGRAM_CHECK_H
#define OLS_PROGRAM_CHECK_H

#include <stdbool.h>
#include <stdint.h>

#include "sequence.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    PROGRAM_CHECK_BYTES_A_TURN = 4096,        // while a host waits for the answer
    PROGRAM_CHECK_BYTES_A_TURN_IN_PLAY = 256  // 94 KB take 376 turns
};

// The CRC of a sequence's first bytes, in the order of its words.
struct program_crc {
    uint32_t bytes, crc32;
};

// Goes on by so many bytes at most; true when it is of all words, loaded and made.
bool program_crc_extend(struct program_crc* crc, const struct sequence* sequence, uint32_t bytes_max);

enum program_verdict { PROGRAM_UNDECIDED, PROGRAM_GOOD, PROGRAM_DAMAGED };

// For a command: from the first word on, and then a turn's part of it until that decides.
void program_check_begin(void);
enum program_verdict program_check_turn(const struct sequence* sequence);

// For the program that plays, again and again: from the first word on, and then a turn's part of it. False when the words that
// have just been read to the end are damaged.
void program_check_begin_play(void);
bool program_check_turn_in_play(const struct sequence* sequence);

#ifdef __cplusplus
}
#endif

#endif
