// SPDX-License-Identifier: MIT
// Prints the words that the firmware makes of a program, one a line in hex: those of the timeline's cycle. Reads the payload of
// `load begin` and the program's bytes from standard input; prints the refusal, and ends with 1, where there is one.
#include <stdio.h>

#include "board.h"
#include "sequence.h"

int main(void) {
    static struct sequence sequence;
    static struct sequence_compiler compiler;
    struct ols_error_reply error = {0};
    if (fread(&sequence.header, sizeof sequence.header, 1, stdin) != 1 ||
        sequence.header.program_bytes > sizeof sequence.words ||
        fread(sequence.words, 1, sequence.header.program_bytes, stdin) != sequence.header.program_bytes) {
        fputs("a program was announced that did not come\n", stderr);
        return 1;
    }
    sequence_begin(&compiler, &board_sequence, &sequence);
    enum sequence_progress progress = SEQUENCE_UNFINISHED;
    while (progress == SEQUENCE_UNFINISHED) progress = sequence_step(&compiler, &error);
    if (progress == SEQUENCE_REFUSED) {
        fprintf(stderr, "%s\n", error.text);
        return 1;
    }
    for (uint32_t n = 0; n < sequence.cycle_words; n++) printf("%08x\n", (unsigned)sequence_enter(&sequence)[1 + n]);
    return 0;
}
