// SPDX-License-Identifier: MIT
// The reading of a program's words while it is armed, swapped or played: damage at any of their bits is found when that word is
// read, and nothing else is. Their CRC is reckoned here, bit by bit.
// links: ols_firmware
#include "program_check.h"

#include <gtest/gtest.h>

#include <memory>

namespace {

constexpr uint32_t loaded_words = 300, cycle_words = 700;
constexpr uint32_t words = loaded_words + 1 + cycle_words + 1;  // with the word that enters and the one that waits

// IEEE 802.3, 3.2.9: the lowest bit of each byte first.
uint32_t crc32_of(const uint32_t* from, size_t count) {
    uint32_t remainder = ~0u;
    for (size_t bit = 0; bit < 32 * count; bit++)
        remainder = remainder >> 1 ^ ((remainder ^ from[bit / 32] >> bit % 32) & 1 ? 0xedb88320u : 0);
    return ~remainder;
}

class ProgramCheck : public testing::Test {
  protected:
    void SetUp() override {
        program_->header.program_bytes = 4 * loaded_words;
        program_->cycle_words = cycle_words;
        for (uint32_t n = 0; n < SEQUENCE_WORDS_MAX; n++) program_->words[n] = n * 2'654'435'761u;
        program_->words_crc32 = crc32_of(program_->words, words);
        program_check_begin();
        program_check_begin_play();
    }

    // Turns until it is decided.
    std::pair<program_verdict, int> read() {
        for (int turns = 1;; turns++)
            if (const program_verdict verdict = program_check_turn(program_.get()); verdict != PROGRAM_UNDECIDED)
                return {verdict, turns};
    }

    void flip(uint32_t bit) { program_->words[bit / 32] ^= 1u << bit % 32; }

    std::unique_ptr<sequence> program_ = std::make_unique<sequence>();
};

constexpr int turns_of_reading = (4 * words + PROGRAM_CHECK_BYTES_A_TURN - 1) / PROGRAM_CHECK_BYTES_A_TURN;
constexpr int turns_of_reading_in_play =
    (4 * words + PROGRAM_CHECK_BYTES_A_TURN_IN_PLAY - 1) / PROGRAM_CHECK_BYTES_A_TURN_IN_PLAY;

TEST_F(ProgramCheck, words_as_they_were_made_are_good_and_take_a_turn_for_each_part) {
    EXPECT_EQ(read(), std::make_pair(PROGRAM_GOOD, turns_of_reading));
    program_check_begin();
    EXPECT_EQ(read(), std::make_pair(PROGRAM_GOOD, turns_of_reading)) << "again, from the first word on";
    for (int turn = 0; turn < 5 * turns_of_reading_in_play; turn++)
        EXPECT_TRUE(program_check_turn_in_play(program_.get())) << turn;
}

TEST_F(ProgramCheck, a_flip_of_any_word_is_damage) {
    for (uint32_t word = 0; word < words; word++) {
        const uint32_t bit = 32 * word + word % 32;
        flip(bit);
        program_check_begin();
        EXPECT_EQ(read().first, PROGRAM_DAMAGED) << "word " << word;
        flip(bit);
    }
}

TEST_F(ProgramCheck, words_behind_the_programs_are_nobodys) {
    flip(32 * words);
    EXPECT_EQ(read().first, PROGRAM_GOOD);
}

TEST_F(ProgramCheck, a_flip_in_play_is_found_when_it_is_read_and_not_before) {
    for (uint32_t word = 0; word < words; word += 13) {
        const int found_in_turn = int(4 * word / PROGRAM_CHECK_BYTES_A_TURN_IN_PLAY);
        for (const int flipped_before_turn : {0, found_in_turn, found_in_turn + 1}) {
            SetUp();
            const bool is_read = flipped_before_turn <= found_in_turn;  // in this reading, or only in the next one
            const int judged_in_turn = (is_read ? 1 : 2) * turns_of_reading_in_play - 1;
            for (int turn = 0; turn <= judged_in_turn; turn++) {
                if (turn == flipped_before_turn) flip(32 * word + 7);
                ASSERT_EQ(program_check_turn_in_play(program_.get()), turn < judged_in_turn)
                    << "word " << word << ", flipped before turn " << flipped_before_turn << ", turn " << turn;
            }
        }
    }
}

TEST_F(ProgramCheck, a_new_program_in_play_is_read_from_its_first_word_on) {
    for (int turn = 0; turn < 3; turn++) ASSERT_TRUE(program_check_turn_in_play(program_.get()));
    program_->header.program_bytes = 4 * 40;
    program_->words_crc32 = crc32_of(program_->words, 40 + 2 + cycle_words);
    program_check_begin_play();
    for (int turn = 0; turn < 2 * turns_of_reading_in_play; turn++)
        ASSERT_TRUE(program_check_turn_in_play(program_.get())) << turn;
}

TEST_F(ProgramCheck, the_reading_for_a_command_and_that_in_play_do_not_disturb_each_other) {
    for (int turn = 0; turn < turns_of_reading_in_play; turn++) {
        ASSERT_TRUE(program_check_turn_in_play(program_.get()));
        program_check_begin();
        ASSERT_EQ(program_check_turn(program_.get()), turns_of_reading == 1 ? PROGRAM_GOOD : PROGRAM_UNDECIDED);
    }
}

}  // namespace
