// SPDX-License-Identifier: MIT
// Fuzzes the compiler of programs, behind the CRC that would keep most of these out: what is accepted plays exactly what
// it says, by the sum of the events' documented times; everything else is refused with a text.
// links: ols_firmware
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <memory>

#include "pulse.h"
#include "sequence.h"

static void expect(bool truth) {
    if (!truth) abort();
}

static uint64_t event_ticks(uint32_t event) {
    const uint32_t operand = event >> 13;
    switch (event >> 8 & 31) {
        case TIMELINE_HOLD: return operand + 6;
        case TIMELINE_SHIFT: return operand + 7;
        case TIMELINE_SYNC: return operand + 8;
        case TIMELINE_CYCLE_END: return operand + 7;
        case TIMELINE_LONG_HOLD: return 32ull * operand + 38;
        default: abort();
    }
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    ols_load_begin header;
    if (size < sizeof header) return 0;
    memcpy(&header, data, sizeof header);
    data += sizeof header;
    size -= sizeof header;
    sequence_board board{176, 1, {160, 900}};
    if (header.program_crc32 % 4 ==
        0) {  // mostly the board's own chain and the right length, to come past the first checks
        board.chain_bits = uint16_t(1 + header.chain_bits % OLS_CHAIN_BITS_MAX);
        header.chain_bits = board.chain_bits;
    }
    if (header.cycles % 3) {  // nor do random triggers often pass
        header.lead_ticks = 0;
        std::fill(std::begin(header.triggers), std::end(header.triggers), ols_trigger{});
    }
    const size_t slot_bytes = sizeof(ols_slot) + 4u * slot_pattern_words(board.chain_bits);
    if (header.cycles % 4) header.slot_count = uint16_t(std::min<size_t>(size / slot_bytes, 0xffff));
    header.program_bytes = uint32_t(header.cycles % 8 ? header.slot_count * slot_bytes : header.program_bytes);
    if (header.program_bytes > size) return 0;  // programs.c never hands over less than it says

    static const auto words = std::make_unique<sequence>();
    if (header.program_bytes > sizeof words->words) return 0;  // nor takes more than there is room for
    words->header = header;
    memcpy(words->words, data, header.program_bytes);
    ols_error_reply error{};
    sequence_compiler compiler;
    sequence_begin(&compiler, &board, words.get());
    sequence_progress progress;
    do progress = sequence_step(&compiler, &error);
    while (progress == SEQUENCE_UNFINISHED);
    if (progress == SEQUENCE_REFUSED) {
        expect((error.code == OLS_ERROR_BAD_PROGRAM || error.code == OLS_ERROR_OVER_LIMIT) && error.text[0] &&
               !error.text[sizeof error.text - 1]);
        return 0;
    }
    uint64_t played_ticks = 0, asked_ticks = 0;
    for (uint32_t n = 0; n < words->cycle_words; n++) played_ticks += event_ticks(sequence_enter(words.get())[1 + n]);
    for (uint16_t n = 0; n < header.slot_count; n++) asked_ticks += sequence_slots(words.get())[n].period_ticks;
    expect(played_ticks == asked_ticks);
    return 0;
}
