// SPDX-License-Identifier: MIT
// Program check: one reading for the command that is being answered, one that goes round while a program plays.
#include "program_check.h"

#include "frame.h"

static struct program_crc for_command, in_play;

static uint32_t sequence_bytes(const struct sequence* sequence) {
    return sequence->header.program_bytes + 4 * (2 + sequence->cycle_words);
}

bool program_crc_extend(struct program_crc* crc, const struct sequence* sequence, uint32_t bytes_max) {
    const uint32_t left = sequence_bytes(sequence) - crc->bytes;
    const uint32_t now = left < bytes_max ? left : bytes_max;
    crc->crc32 = ols_crc32(crc->crc32, (const uint8_t*)sequence->words + crc->bytes, now);
    crc->bytes += now;
    return now == left;
}

static enum program_verdict read_on(struct program_crc* crc, const struct sequence* sequence, uint32_t bytes_max) {
    if (!program_crc_extend(crc, sequence, bytes_max)) return PROGRAM_UNDECIDED;
    return crc->crc32 == sequence->words_crc32 ? PROGRAM_GOOD : PROGRAM_DAMAGED;
}

void program_check_begin(void) {
    for_command = (struct program_crc){0};
}

enum program_verdict program_check_turn(const struct sequence* sequence) {
    return read_on(&for_command, sequence, PROGRAM_CHECK_BYTES_A_TURN);
}

void program_check_begin_play(void) {
    in_play = (struct program_crc){0};
}

bool program_check_turn_in_play(const struct sequence* sequence) {
    const enum program_verdict verdict = read_on(&in_play, sequence, PROGRAM_CHECK_BYTES_A_TURN_IN_PLAY);
    if (verdict != PROGRAM_UNDECIDED) program_check_begin_play();
    return verdict != PROGRAM_DAMAGED;
}
