// SPDX-License-Identifier: MIT
// The firmware's answers to the host's messages, on the board without hardware: loading, playing and swapping.
// links: ols_firmware
#include "layout_hash.h"
#include "link_fixture.hpp"

using namespace ols::test;

namespace {

TEST_F(Link, hello_tells_layout_and_board) {
    const Reply reply = ask(OLS_HELLO, bytes_of(ols_hello{OLS_LAYOUT_HASH}));
    ASSERT_EQ(reply.payload.size(), sizeof(ols_hello_reply));
    const auto hello = reply.as<ols_hello_reply>();
    EXPECT_EQ(hello.layout_hash, OLS_LAYOUT_HASH);
    EXPECT_EQ(hello.tick_hz, 125'000'000u);
    EXPECT_EQ(hello.chain_bits, 176);
    EXPECT_EQ(hello.slots_max, 1024);
    EXPECT_STREQ(hello.board, "pico");
}

TEST_F(Link, hello_answers_a_host_of_another_layout_so_that_the_host_can_say_so) {
    Bytes later = bytes_of(ols_hello{OLS_LAYOUT_HASH + 1});
    later.resize(40);
    EXPECT_TRUE(ask(OLS_HELLO, later).ok(OLS_HELLO));
}

TEST_F(Link, a_program_is_loaded_played_and_logged) {
    EXPECT_EQ(status().state, OLS_STATE_IDLE);
    ASSERT_TRUE(load(program(180), 2).ok(OLS_LOAD_END));
    EXPECT_EQ(status().state, OLS_STATE_LOADED);
    EXPECT_FALSE(board_host_pins_are_connected());
    ASSERT_TRUE(arm().ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
    board_host_run_us(100'000);
    EXPECT_EQ(status().cycles_played, 1u);
    board_host_run_us(100'000);
    const ols_status_reply done = status();
    EXPECT_EQ(done.state, OLS_STATE_DONE);
    EXPECT_EQ(done.cycles_played, 2u);
    EXPECT_EQ(done.triggers_fired, 360u);
    EXPECT_EQ(done.log_entries_lost, 0u);
    EXPECT_FALSE(board_host_pins_are_connected());
    uint32_t next = 0;
    while (next < 360) {
        const Reply reply = ask(OLS_READ_TRIGGER_LOG, bytes_of(ols_read_trigger_log{next, 100, 0}));
        const auto header = reply.as<ols_trigger_log_reply>();
        ASSERT_GT(header.entry_count, 0);
        ASSERT_EQ(reply.payload.size(), sizeof header + header.entry_count * sizeof(ols_trigger_log_entry));
        for (int n = 0; n < header.entry_count; n++, next++) {
            ols_trigger_log_entry entry;
            memcpy(&entry, reply.payload.data() + sizeof header + size_t(n) * sizeof entry, sizeof entry);
            EXPECT_EQ(entry.counter, next);
            EXPECT_EQ(entry.slot, next % 180);
            EXPECT_EQ(entry.rise_ticks, 12 + uint64_t(next) * 57'870);
        }
    }
}

TEST_F(Link, a_finished_program_can_be_played_again) {
    play(1);
    board_host_run_us(20'000);
    EXPECT_EQ(status().state, OLS_STATE_DONE);
    ASSERT_TRUE(arm().ok(OLS_ARM));
    EXPECT_EQ(status().triggers_fired, 0u);
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    board_host_run_us(20'000);
    EXPECT_EQ(status().triggers_fired, 18u);
}

TEST_F(Link, stop_is_dark_at_once) {
    play();
    board_host_run_us(5'000);
    ASSERT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    EXPECT_FALSE(board_host_pins_are_connected());
    EXPECT_EQ(status().state, OLS_STATE_LOADED);
}

TEST_F(Link, commands_out_of_order_are_refused_and_change_nothing) {
    EXPECT_EQ(arm().error(), OLS_ERROR_BAD_STATE);
    EXPECT_EQ(ask(OLS_START).error(), OLS_ERROR_BAD_STATE);
    EXPECT_EQ(ask(OLS_STOP).error(), OLS_ERROR_BAD_STATE);
    EXPECT_EQ(ask(OLS_LOAD_END).error(), OLS_ERROR_BAD_STATE);
    EXPECT_EQ(ask(OLS_CLEAR_FAULT).error(), OLS_ERROR_BAD_STATE);
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    EXPECT_EQ(ask(OLS_START).error(), OLS_ERROR_BAD_STATE);
    ASSERT_TRUE(arm().ok(OLS_ARM));
    EXPECT_EQ(arm().error(), OLS_ERROR_BAD_STATE);
    const Reply refused = ask(OLS_LOAD_BEGIN, bytes_of(begin_for(program(2), 1)));
    EXPECT_EQ(refused.error(), OLS_ERROR_BAD_STATE);
    EXPECT_NE(refused.text().find("before loading"), std::string::npos);
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    EXPECT_EQ(ask(OLS_SWAP).error(), OLS_ERROR_BAD_STATE);
    board_host_run_us(30'000);
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
}

TEST_F(Link, the_next_program_is_loaded_while_one_plays_and_follows_at_the_end_of_a_cycle) {
    play(0);
    board_host_run_us(5'000);
    ASSERT_TRUE(load(program(7, 60'000), 2).ok(OLS_LOAD_END));
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
    EXPECT_EQ(status().next, OLS_NEXT_READY);
    const Reply reply = ask(OLS_SWAP);
    ASSERT_TRUE(reply.ok(OLS_SWAP)) << reply.text();
    const auto swap = reply.as<ols_swap_reply>();
    EXPECT_EQ(swap.after_cycles, 2u);
    EXPECT_EQ(swap.program, 1);
    EXPECT_EQ(status().next, OLS_NEXT_SWAPPING);
    EXPECT_EQ(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(program(2), 1))).error(), OLS_ERROR_BAD_STATE);
    board_host_run_us(50'000);
    const ols_status_reply done = status();
    EXPECT_EQ(done.state, OLS_STATE_DONE);
    EXPECT_EQ(done.fault, OLS_FAULT_NONE);
    EXPECT_EQ(done.next, OLS_NEXT_NONE);
    EXPECT_EQ(done.triggers_fired, 2u * 18 + 2 * 7);
    EXPECT_EQ(done.cycles_played, 2u);
    EXPECT_EQ(done.program_crc32, begin_for(program(7, 60'000), 2).program_crc32);
    const Reply log = ask(OLS_READ_TRIGGER_LOG, bytes_of(ols_read_trigger_log{35, 2, 0}));
    ols_trigger_log_entry entries[2];
    memcpy(entries, log.payload.data() + sizeof(ols_trigger_log_reply), sizeof entries);
    EXPECT_EQ(entries[1].rise_ticks - entries[0].rise_ticks, 57'870u) << "no slot is late";
    EXPECT_EQ(entries[0].program, 0);
    EXPECT_EQ(entries[1].program, 1);
    EXPECT_EQ(entries[1].slot, 0);
}

TEST_F(Link, a_bad_next_program_leaves_the_playing_one_alone) {
    play(0);
    Bytes impossible = program(18);
    impossible[8] = impossible[9] = impossible[10] = 0;
    EXPECT_EQ(load(impossible).error(), OLS_ERROR_BAD_PROGRAM);
    EXPECT_EQ(status().next, OLS_NEXT_NONE);
    EXPECT_EQ(ask(OLS_SWAP).error(), OLS_ERROR_BAD_STATE);
    board_host_run_us(30'000);
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
}

TEST_F(Link, a_next_program_that_was_not_swapped_in_is_the_one_that_arm_plays) {
    play(1);
    ASSERT_TRUE(load(program(5), 1).ok(OLS_LOAD_END));
    EXPECT_EQ(ask(OLS_SWAP).error(), OLS_ERROR_BAD_STATE) << "one cycle is over before any swap";
    board_host_run_us(20'000);
    EXPECT_EQ(status().triggers_fired, 18u);
    ASSERT_TRUE(arm().ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    board_host_run_us(20'000);
    EXPECT_EQ(status().triggers_fired, 5u);
}

TEST_F(Link, programs_whose_cycles_begin_otherwise_cannot_be_swapped) {
    play(0);
    ols_load_begin begin = begin_for(program(18), 0);
    begin.lead_ticks = 500;
    ASSERT_TRUE(ask(OLS_LOAD_BEGIN, bytes_of(begin)).ok(OLS_LOAD_BEGIN));
    Bytes chunk = bytes_of(ols_load_chunk{0});
    const Bytes data = program(18);
    chunk.insert(chunk.end(), data.begin(), data.end());
    ASSERT_TRUE(ask(OLS_LOAD_CHUNK, chunk).ok(OLS_LOAD_CHUNK));
    ASSERT_TRUE(ask(OLS_LOAD_END).ok(OLS_LOAD_END));
    const Reply reply = ask(OLS_SWAP);
    EXPECT_EQ(reply.error(), OLS_ERROR_BAD_PROGRAM);
    EXPECT_NE(reply.text().find("lead_ticks"), std::string::npos);
}

TEST_F(Link, a_damaged_program_is_refused_and_gone) {
    Bytes damaged = program(18);
    const ols_load_begin begin = begin_for(damaged, 1);
    damaged[100] ^= 4;
    ASSERT_TRUE(ask(OLS_LOAD_BEGIN, bytes_of(begin)).ok(OLS_LOAD_BEGIN));
    Bytes chunk = bytes_of(ols_load_chunk{0});
    chunk.insert(chunk.end(), damaged.begin(), damaged.end());
    ASSERT_TRUE(ask(OLS_LOAD_CHUNK, chunk).ok(OLS_LOAD_CHUNK));
    EXPECT_EQ(ask(OLS_LOAD_END).error(), OLS_ERROR_BAD_CRC);
    EXPECT_EQ(status().state, OLS_STATE_IDLE);
    EXPECT_EQ(arm().error(), OLS_ERROR_BAD_STATE);
}

TEST_F(Link, an_impossible_program_is_refused_with_its_slot) {
    Bytes impossible = program(18);
    impossible[7 * 16 + 8] = impossible[7 * 16 + 9] = impossible[7 * 16 + 10] = 0;  // slot 7: period 0
    const Reply reply = load(impossible);
    EXPECT_EQ(reply.error(), OLS_ERROR_BAD_PROGRAM);
    EXPECT_EQ(reply.as<ols_error_reply>().slot, 7);
    EXPECT_NE(reply.text().find("slot 7: period must exceed the exposure"), std::string::npos) << reply.text();
}

TEST_F(Link, chunks_out_of_place_end_the_loading) {
    const Bytes good = program(18);
    for (const uint32_t offset : {1u, 720u, 0xffffffffu}) {
        ASSERT_TRUE(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(good, 1))).ok(OLS_LOAD_BEGIN));
        Bytes chunk = bytes_of(ols_load_chunk{offset});
        chunk.resize(300);
        EXPECT_EQ(ask(OLS_LOAD_CHUNK, chunk).error(), OLS_ERROR_BAD_OFFSET);
        EXPECT_EQ(ask(OLS_LOAD_CHUNK, chunk).error(), OLS_ERROR_BAD_STATE);
    }
    ASSERT_TRUE(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(good, 1))).ok(OLS_LOAD_BEGIN));
    Bytes too_long = bytes_of(ols_load_chunk{0});
    too_long.resize(4 + good.size() + 1);
    EXPECT_EQ(ask(OLS_LOAD_CHUNK, too_long).error(), OLS_ERROR_BAD_OFFSET);
    ols_load_begin huge = begin_for(good, 1);
    huge.program_bytes = 0xffffffff;
    EXPECT_EQ(ask(OLS_LOAD_BEGIN, bytes_of(huge)).error(), OLS_ERROR_BAD_PROGRAM);
}

TEST_F(Link, wrong_lengths_and_unknown_messages_are_refused) {
    EXPECT_EQ(ask(OLS_HELLO, Bytes(7)).error(), OLS_ERROR_BAD_LENGTH);
    EXPECT_EQ(ask(OLS_ARM, Bytes(3)).error(), OLS_ERROR_BAD_LENGTH);
    EXPECT_EQ(ask(OLS_LOAD_CHUNK, Bytes(3)).error(), OLS_ERROR_BAD_LENGTH);
    EXPECT_EQ(ask(OLS_READ_TRIGGER_LOG, Bytes(9)).error(), OLS_ERROR_BAD_LENGTH);
    EXPECT_EQ(ask(0x55).error(), OLS_ERROR_UNKNOWN_MESSAGE);
    EXPECT_EQ(ask(0x4101).error(), OLS_ERROR_UNKNOWN_MESSAGE);
}

TEST_F(Link, a_start_by_edge_waits_for_it_and_counts_from_it) {
    ASSERT_TRUE(load(program(18), 1).ok(OLS_LOAD_END));
    EXPECT_EQ(ask(OLS_ARM, bytes_of(ols_arm{0, 3, {}, 0})).error(), OLS_ERROR_BAD_PROGRAM);
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(ols_arm{0, OLS_START_BY_EDGE, {}, 0})).ok(OLS_ARM));
    board_host_genlock();
    EXPECT_EQ(status().state, OLS_STATE_ARMED) << "an edge before the start means nothing";
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    board_host_run_us(50'000);
    EXPECT_EQ(status().state, OLS_STATE_WAITING);
    EXPECT_EQ(status().triggers_fired, 0u);
    EXPECT_EQ(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(program(2), 1))).error(), OLS_ERROR_BAD_STATE);
    board_host_genlock();
    board_host_run_us(2'000);
    const ols_status_reply now = status();
    EXPECT_EQ(now.state, OLS_STATE_PLAYING);
    EXPECT_LE(now.now_ticks, 2'000u * 125);
    board_host_run_us(20'000);
    EXPECT_EQ(status().state, OLS_STATE_DONE);
    EXPECT_EQ(status().triggers_fired, 18u);
}

TEST_F(Link, each_cycle_waits_for_an_edge_and_edges_during_play_are_counted_as_missed) {
    const uint64_t cycle_us = 18 * 57'870 / 125;
    const ols_arm by_edges{0, OLS_START_EACH_CYCLE_BY_EDGE, {}, 1250};
    ASSERT_TRUE(load(program(18), 3).ok(OLS_LOAD_END));
    for (const uint32_t wrong : {0, 2, 1251}) {
        const ols_arm refused{0, OLS_START_EACH_CYCLE_BY_EDGE, {}, wrong};
        EXPECT_EQ(ask(OLS_ARM, bytes_of(refused)).error(), OLS_ERROR_BAD_PROGRAM) << wrong;
    }
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(by_edges)).ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    for (uint32_t cycle = 0; cycle < 3; ++cycle) {
        board_host_run_us(70'000 + 12'345 * cycle);
        EXPECT_EQ(status().state, cycle == 0 ? OLS_STATE_WAITING : OLS_STATE_PLAYING);
        EXPECT_EQ(status().triggers_fired, 18 * cycle) << "no cycle plays without its edge";
        board_host_genlock();
        board_host_run_us(cycle_us / 2);
        if (cycle == 1) board_host_genlock();
        board_host_run_us(cycle_us / 2 + 1000);
    }
    const ols_status_reply done = status();
    EXPECT_EQ(done.state, OLS_STATE_DONE);
    EXPECT_EQ(done.fault, OLS_FAULT_NONE) << "cycles may begin whenever they like";
    EXPECT_EQ(done.triggers_fired, 54u);
    EXPECT_EQ(done.edges_seen, 4u);
    EXPECT_EQ(done.edges_missed, 1u);
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(by_edges)).ok(OLS_ARM));
    EXPECT_EQ(status().edges_seen, 0u);
}

TEST_F(Link, a_cycle_may_wait_for_its_edge_longer_than_stamps_and_half_of_them_count) {
    ASSERT_TRUE(load(program(18), 3).ok(OLS_LOAD_END));
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(ols_arm{0, OLS_START_EACH_CYCLE_BY_EDGE, {}, 1250})).ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    for (const uint64_t wait_us : {100'000'000, 40'000'000, 80'000'000}) {  // stamps count for 68.7 s
        board_host_run_us(wait_us);
        board_host_genlock();
        board_host_run_us(10'000);
        EXPECT_EQ(status().fault, OLS_FAULT_NONE) << wait_us;
    }
    EXPECT_EQ(status().state, OLS_STATE_DONE);
    const auto reply = ask(OLS_READ_TRIGGER_LOG, bytes_of(ols_read_trigger_log{35, 2, 0}));
    ols_trigger_log_entry entries[2];
    std::memcpy(entries, reply.payload.data() + sizeof(ols_trigger_log_reply), sizeof entries);
    const uint64_t apart_us = (entries[1].rise_ticks - entries[0].rise_ticks) / 125;
    EXPECT_NEAR(double(apart_us), 80e6 + 10'000 - 17 * 57'870 / 125, 2'000.);
    EXPECT_EQ(entries[1].cycle, 2u);
}

TEST_F(Link, cycles_that_wait_for_edges_are_not_swapped) {
    ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
    ASSERT_TRUE(ask(OLS_ARM, bytes_of(ols_arm{0, OLS_START_EACH_CYCLE_BY_EDGE, {}, 4})).ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    board_host_genlock();
    board_host_run_us(2'000);
    ASSERT_TRUE(load(program(12), 1).ok(OLS_LOAD_END));
    EXPECT_EQ(ask(OLS_SWAP).error(), OLS_ERROR_BAD_STATE);
    ASSERT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    EXPECT_EQ(status().program_crc32, begin_for(program(12), 1).program_crc32) << "the next program is the one to arm";
}

TEST_F(Link, half_a_message_of_a_host_that_went_away_does_not_confuse_the_next) {
    uint8_t frame[64], answer[64];
    const ols_hello hello{OLS_LAYOUT_HASH};
    const size_t bytes = ols_frame_encode(OLS_HELLO, 1, &hello, sizeof hello, frame, sizeof frame);
    EXPECT_EQ(board_host_exchange(frame, bytes / 2, answer, sizeof answer), 0u);
    board_host_detach();
    board_host_attach();
    EXPECT_TRUE(ask(OLS_STATUS).ok(OLS_STATUS));
}

}  // namespace
