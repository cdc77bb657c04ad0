// SPDX-License-Identifier: MIT
// Loading and holding programs: whatever happens to the next one, the current one stays as it is, to the bit; and what becomes
// current is what was loaded.
// links: ols_firmware
#include "programs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "frame.h"
#include "program_check.h"

namespace {

using Bytes = std::vector<uint8_t>;

// Slots of one lamp each, on a chain of 176 bits.
Bytes program_of(int slots, uint8_t first_lamp = 0) {
    Bytes all(size_t(slots) * 40);
    for (int n = 0; n < slots; n++) {
        ols_slot slot{};
        slot.trigger_mask = 1;
        slot.exposure_ticks = 20'000;
        slot.period_ticks = 57'870;
        std::memcpy(all.data() + n * sizeof slot, &slot, sizeof slot);
        const uint32_t word = 1u << (unsigned(n) + first_lamp) % 32;
        std::memcpy(all.data() + slots * sizeof slot + size_t(n) * 24, &word, sizeof word);
    }
    return all;
}

ols_load_begin announce(const Bytes& program) {
    ols_load_begin begin{};
    begin.slot_count = uint16_t(program.size() / 40);
    begin.chain_bits = 176;
    begin.program_bytes = uint32_t(program.size());
    begin.program_crc32 = ols_crc32(0, program.data(), program.size());
    return begin;
}

class Programs : public testing::Test {
  protected:
    void SetUp() override {
        programs_take_next();  // of the test before
        programs_forget();
    }

    bool send(const Bytes& program, size_t from = 0, size_t chunk_bytes = 1000) {
        bool good = true;
        for (size_t offset = from; good && offset < program.size(); offset += chunk_bytes)
            good = programs_load_chunk(uint32_t(offset), program.data() + offset,
                                       std::min(chunk_bytes, program.size() - offset), &error_);
        return good;
    }

    sequence_progress make() {
        for (turns_ = 1;; turns_++)
            if (const sequence_progress progress = programs_load_end(&error_); progress != SEQUENCE_UNFINISHED)
                return progress;
    }

    void load(const Bytes& program) {
        const ols_load_begin begin = announce(program);
        ASSERT_TRUE(programs_load_begin(&begin, &error_)) << error_.text;
        ASSERT_TRUE(send(program)) << error_.text;
        ASSERT_EQ(make(), SEQUENCE_MADE) << error_.text;
    }

    // All that is known of the current program, words included.
    static Bytes current() {
        const auto* first = reinterpret_cast<const uint8_t*>(programs_current());
        return Bytes(first, first + sizeof(sequence));
    }

    static bool is(const sequence* held, const Bytes& program) {
        return held->header.program_bytes == program.size() &&
               std::memcmp(held->words, program.data(), program.size()) == 0;
    }

    static bool is_as_it_was_made(const sequence* held) {
        program_check_begin();
        program_verdict verdict;
        do verdict = program_check_turn(held);
        while (verdict == PROGRAM_UNDECIDED);
        return verdict == PROGRAM_GOOD;
    }

    void expect_refused(uint16_t code, const char* words) {
        EXPECT_EQ(error_.code, code) << error_.text;
        EXPECT_EQ(error_.slot, OLS_NO_SLOT);
        EXPECT_NE(std::string(error_.text).find(words), std::string::npos) << error_.text;
    }

    ols_error_reply error_{};
    int turns_ = 0;
};

TEST_F(Programs, what_was_loaded_becomes_the_current_one_when_it_is_taken) {
    const Bytes program = program_of(120);
    EXPECT_EQ(programs_current()->header.slot_count, 0);
    load(program);
    EXPECT_EQ(programs_next_state(), OLS_NEXT_READY);
    EXPECT_TRUE(is(programs_next(), program));
    EXPECT_EQ(programs_current()->header.slot_count, 0) << "not before it is taken";
    programs_take_next();
    EXPECT_EQ(programs_next_state(), OLS_NEXT_NONE);
    EXPECT_TRUE(is(programs_current(), program));
    EXPECT_TRUE(is_as_it_was_made(programs_current()));
    EXPECT_GT(programs_current()->cycle_words, 0u);
    EXPECT_EQ(programs_current()->longest_light_ticks, 20'000u);
}

TEST_F(Programs, chunks_may_be_of_any_size) {
    const Bytes program = program_of(12);
    const ols_load_begin begin = announce(program);
    for (const size_t chunk_bytes : {size_t(1), size_t(7), program.size()}) {
        ASSERT_TRUE(programs_load_begin(&begin, &error_));
        ASSERT_TRUE(send(program, 0, chunk_bytes)) << error_.text;
        ASSERT_EQ(make(), SEQUENCE_MADE) << error_.text;
        EXPECT_TRUE(is(programs_next(), program));
        EXPECT_TRUE(is_as_it_was_made(programs_next()));
    }
}

TEST_F(Programs, a_long_one_is_made_in_as_many_turns_as_keep_each_short) {
    const Bytes program = program_of(1000);
    load(program);
    // 16 slots a turn, twice, for they are checked before they are played; then 4096 bytes a turn of what was made.
    const sequence* const made = programs_next();
    const int bytes_made = int(4 * (2 + made->cycle_words));
    EXPECT_GE(turns_, 2 * 1000 / 16 + bytes_made / 4096);
}

TEST_F(Programs, no_fate_of_the_next_one_touches_the_current_one) {
    load(program_of(100));
    programs_take_next();
    const Bytes before = current();
    const Bytes next = program_of(90, 5);
    const ols_load_begin begin = announce(next);
    const auto unchanged = [&](const char* when) { EXPECT_TRUE(current() == before) << when; };

    ASSERT_TRUE(programs_load_begin(&begin, &error_));
    unchanged("announced");
    ASSERT_TRUE(send(next));
    unchanged("received");
    EXPECT_EQ(programs_load_end(&error_), SEQUENCE_UNFINISHED);
    unchanged("being made");
    ASSERT_EQ(make(), SEQUENCE_MADE);
    unchanged("made");
    programs_swap();
    unchanged("on its way");

    programs_take_next();
    EXPECT_TRUE(is(programs_current(), next));
    Bytes damaged = next;
    damaged[100] ^= 4;
    const Bytes swapped = current();
    ASSERT_TRUE(programs_load_begin(&begin, &error_));
    ASSERT_TRUE(send(damaged));
    EXPECT_EQ(make(), SEQUENCE_REFUSED);
    expect_refused(OLS_ERROR_BAD_CRC, "damaged");
    EXPECT_TRUE(current() == swapped) << "damaged";
    programs_forget_next();
    EXPECT_TRUE(current() == swapped) << "forgotten";
}

TEST_F(Programs, one_that_is_refused_is_gone) {
    const Bytes program = program_of(18);
    ols_load_begin begin = announce(program);
    ASSERT_TRUE(programs_load_begin(&begin, &error_));
    EXPECT_FALSE(send(program, 1));
    expect_refused(OLS_ERROR_BAD_OFFSET, "chunks must follow each other");
    EXPECT_EQ(programs_next_state(), OLS_NEXT_NONE);

    ASSERT_TRUE(programs_load_begin(&begin, &error_));
    ASSERT_TRUE(programs_load_chunk(0, program.data(), 700, &error_));
    EXPECT_EQ(make(), SEQUENCE_REFUSED);
    expect_refused(OLS_ERROR_BAD_OFFSET, "not complete");
    EXPECT_EQ(programs_next_state(), OLS_NEXT_NONE);

    Bytes too_long = program;
    too_long.push_back(0);
    for (const size_t first_bytes : {size_t(0), size_t(700)}) {
        ASSERT_TRUE(programs_load_begin(&begin, &error_));
        ASSERT_TRUE(programs_load_chunk(0, too_long.data(), first_bytes, &error_));
        EXPECT_FALSE(send(too_long, first_bytes, too_long.size()));
        expect_refused(OLS_ERROR_BAD_OFFSET, "end with the program");
        EXPECT_EQ(programs_next_state(), OLS_NEXT_NONE);
    }

    begin.program_bytes = 4 * SEQUENCE_WORDS_MAX;
    EXPECT_TRUE(programs_load_begin(&begin, &error_)) << "as many bytes as there are";
    begin.program_bytes++;
    EXPECT_FALSE(programs_load_begin(&begin, &error_));
    expect_refused(OLS_ERROR_BAD_PROGRAM, "too long");
    EXPECT_EQ(programs_next_state(), OLS_NEXT_NONE);
    programs_take_next();
    EXPECT_EQ(programs_current()->header.slot_count, 0) << "there is none to take";
}

TEST_F(Programs, messages_at_the_wrong_time_are_refused_and_change_nothing) {
    const Bytes program = program_of(100);
    EXPECT_FALSE(send(program));
    expect_refused(OLS_ERROR_BAD_STATE, "begin with load begin");
    error_ = {};
    EXPECT_EQ(make(), SEQUENCE_REFUSED);
    expect_refused(OLS_ERROR_BAD_STATE, "begin with load begin");

    const ols_load_begin begin = announce(program);
    ASSERT_TRUE(programs_load_begin(&begin, &error_));
    ASSERT_TRUE(send(program));
    EXPECT_EQ(programs_load_end(&error_), SEQUENCE_UNFINISHED);
    EXPECT_FALSE(send(program)) << "it is being made";
    expect_refused(OLS_ERROR_BAD_STATE, "begin with load begin");
    ASSERT_EQ(make(), SEQUENCE_MADE);
    programs_swap();
    EXPECT_FALSE(programs_load_begin(&begin, &error_));
    expect_refused(OLS_ERROR_BAD_STATE, "a swap is under way");
    EXPECT_EQ(programs_next_state(), OLS_NEXT_SWAPPING);
    EXPECT_TRUE(is(programs_next(), program));
    programs_take_next();
    EXPECT_TRUE(programs_load_begin(&begin, &error_)) << "the memory of the one before is free";
}

TEST_F(Programs, a_new_load_begin_ends_the_one_before_it_wherever_that_was) {
    const Bytes first = program_of(100), second = program_of(60, 3);
    const ols_load_begin begin = announce(first);
    for (int parts = 0; parts < 4; parts++) {
        ASSERT_TRUE(programs_load_begin(&begin, &error_));
        EXPECT_TRUE(parts < 1 || programs_load_chunk(0, first.data(), 1000, &error_));
        EXPECT_TRUE(parts < 2 || send(first, 1000));
        EXPECT_TRUE(parts < 3 || programs_load_end(&error_) == SEQUENCE_UNFINISHED);
        load(second);
        EXPECT_TRUE(is(programs_next(), second)) << parts;
        EXPECT_TRUE(is_as_it_was_made(programs_next())) << parts;
    }
}

TEST_F(Programs, forgotten_both_are_gone) {
    load(program_of(18));
    programs_take_next();
    load(program_of(12));
    programs_forget();
    EXPECT_EQ(programs_current()->header.slot_count, 0);
    EXPECT_EQ(programs_next_state(), OLS_NEXT_NONE);
    programs_take_next();
    EXPECT_EQ(programs_current()->header.slot_count, 0);
}

TEST_F(Programs, only_those_fit_whose_cycles_begin_alike) {
    const Bytes program = program_of(18);
    load(program);
    programs_take_next();
    load(program);
    EXPECT_TRUE(programs_fit(&error_));
    ols_load_begin other = announce(program);
    other.lead_ticks = 500;
    ASSERT_TRUE(programs_load_begin(&other, &error_) && send(program));
    ASSERT_EQ(make(), SEQUENCE_MADE) << error_.text;
    EXPECT_FALSE(programs_fit(&error_));
    expect_refused(OLS_ERROR_BAD_PROGRAM, "lead_ticks and polarities");
    for (int n = 0; n < OLS_TRIGGERS; n++) {
        other = announce(program);
        other.triggers[n].active_low = 1;
        ASSERT_TRUE(programs_load_begin(&other, &error_) && send(program));
        ASSERT_EQ(make(), SEQUENCE_MADE) << error_.text;
        EXPECT_FALSE(programs_fit(&error_)) << "trigger " << n;
    }
}

}  // namespace
