// SPDX-License-Identifier: MIT
// Two hosts at one board, on USB and CAN: whose answer, whose loss, whose silence.
// links: ols_firmware
#include "isotp.h"
#include "link_fixture.hpp"

namespace ols::test {
namespace {

class CanLink : public Link {
  protected:
    void SetUp() override {
        board_host_fit_can(true);
        Link::SetUp();
        isotp_init(&host_, message_, sizeof message_, 8);
    }
    void TearDown() override { board_host_fit_can(false); }

    // Moves frames both ways until none is left; telemetry goes to `told_`.
    void exchange_frames() {
        for (bool moved = true; moved;) {
            moved = false;
            uint8_t data[8], length;
            uint16_t id;
            for (int n = 0; n < 16 && (length = isotp_next_frame(&host_, data, now_us_)) > 0; n++)
                moved = board_host_can_put(OLS_CANBUS_TO_BOARD, data, length);
            board_host_run_us(1);
            now_us_++;
            while (board_host_can_take(&id, data, &length)) {
                if (id == OLS_CANBUS_TO_HOST)
                    isotp_take_frame(&host_, data, length, now_us_), moved = true;
                else
                    told_.push_back({id, Bytes(data, data + length)});
            }
        }
    }

    Reply ask_can(uint16_t type, const Bytes& payload = {}) {
        uint8_t frame[OLS_FRAME_BYTES_MAX];
        const size_t bytes = ols_frame_encode(type, ++id_, payload.data(), payload.size(), frame, sizeof frame);
        EXPECT_TRUE(isotp_send(&host_, frame, uint16_t(bytes), now_us_));
        for (int turn = 0; turn < 1000 && isotp_message_bytes(&host_) == 0; turn++) exchange_frames();
        ols_frame_parser parser{};
        ols_frame_parser_write(&parser, message_, isotp_message_bytes(&host_));
        isotp_release(&host_);
        ols_frame got{};
        EXPECT_TRUE(ols_frame_parser_read(&parser, &got));
        EXPECT_EQ(got.request_id, id_);
        return {got.type, got.request_id, Bytes(got.payload, got.payload + got.payload_bytes)};
    }

    Reply load_over_can() {
        const Bytes bytes = program(18);
        EXPECT_TRUE(ask_can(OLS_LOAD_BEGIN, bytes_of(begin_for(bytes, 1))).ok(OLS_LOAD_BEGIN));
        Bytes chunk = bytes_of(ols_load_chunk{0});
        chunk.insert(chunk.end(), bytes.begin(), bytes.end());
        EXPECT_TRUE(ask_can(OLS_LOAD_CHUNK, chunk).ok(OLS_LOAD_CHUNK));
        return ask_can(OLS_LOAD_END);
    }

    void play_from_can(uint32_t heartbeat_ticks = 0) {
        ASSERT_TRUE(load(program(18), 0).ok(OLS_LOAD_END));
        ASSERT_TRUE(ask_can(OLS_ARM, bytes_of(ols_arm{heartbeat_ticks, OLS_START_BY_COMMAND, {}, 0})).ok(OLS_ARM));
        ASSERT_TRUE(ask_can(OLS_START).ok(OLS_START));
    }

    isotp host_;
    uint8_t message_[OLS_FRAME_BYTES_MAX];
    uint64_t now_us_ = 0;
    std::vector<std::pair<uint16_t, Bytes>> told_;
};

TEST_F(CanLink, TheSameMessagesAreAnsweredOverCan) {
    const Reply hello = ask_can(OLS_HELLO, Bytes(8));
    EXPECT_TRUE(hello.ok(OLS_HELLO));
    EXPECT_TRUE(hello.as<ols_hello_reply>().capabilities & OLS_CAN_SPEAK_CAN);
    EXPECT_EQ(ask_can(0x55).error(), OLS_ERROR_UNKNOWN_MESSAGE);
}

TEST_F(CanLink, ABoardWithoutAControllerSaysSo) {
    board_host_fit_can(false);
    board_host_power_up();
    board_host_attach();
    EXPECT_FALSE(ask(OLS_HELLO, Bytes(8)).as<ols_hello_reply>().capabilities & OLS_CAN_SPEAK_CAN);
}

TEST_F(CanLink, WhileOneHostPlaysAnotherMayLookAndStopButNotChange) {
    play_from_can();
    EXPECT_EQ(status().state, OLS_STATE_PLAYING);
    EXPECT_EQ(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(program(2), 1))).error(), OLS_ERROR_BAD_STATE);
    EXPECT_NE(ask(OLS_SWAP).text().find("another host"), std::string::npos);
    EXPECT_TRUE(load_over_can().ok(OLS_LOAD_END)) << "the one that armed may";
    EXPECT_TRUE(ask(OLS_STOP).ok(OLS_STOP));
    EXPECT_EQ(status().state, OLS_STATE_LOADED);
    EXPECT_TRUE(arm().ok(OLS_ARM)) << "and now the other one has it";
}

TEST_F(CanLink, OnlyTheHostThatArmedCanBeLost) {
    play_from_can();
    board_host_detach();  // the other one's USB
    board_host_run_us(5000);
    exchange_frames();
    EXPECT_EQ(ask_can(OLS_STATUS).as<ols_status_reply>().state, OLS_STATE_PLAYING);
    board_host_can_answer(false);
    board_host_run_us(2000);
    board_host_attach();
    expect_fault(OLS_FAULT_HOST_LOST);
}

TEST_F(CanLink, OnlyTheHostThatArmedKeepsTheHeartbeat) {
    play_from_can(2 * OLS_HEARTBEAT_TICKS_MIN);  // 10 ms
    for (int n = 0; n < 4; n++) {
        board_host_run_us(4000);
        ASSERT_EQ(ask_can(OLS_STATUS).as<ols_status_reply>().state, OLS_STATE_PLAYING);
    }
    for (int n = 0; n < 4; n++) {
        board_host_run_us(4000);
        status();  // from the other one
    }
    expect_fault(OLS_FAULT_HEARTBEAT);
}

TEST_F(CanLink, ARequestThatTakesManyTurnsIsNotDisturbedByTheOtherHost) {
    const Bytes long_program = program(1000);
    uint8_t frame[OLS_FRAME_BYTES_MAX];
    ASSERT_TRUE(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(long_program, 1))).ok(OLS_LOAD_BEGIN));
    for (size_t offset = 0; offset < long_program.size(); offset += 1000) {
        Bytes chunk = bytes_of(ols_load_chunk{uint32_t(offset)});
        const size_t end = std::min(long_program.size(), offset + 1000);
        chunk.insert(chunk.end(), long_program.begin() + long(offset), long_program.begin() + long(end));
        ASSERT_TRUE(ask(OLS_LOAD_CHUNK, chunk).ok(OLS_LOAD_CHUNK));
    }
    const size_t bytes = ols_frame_encode(OLS_LOAD_END, ++id_, nullptr, 0, frame, sizeof frame);
    ASSERT_TRUE(isotp_send(&host_, frame, uint16_t(bytes), now_us_));
    exchange_frames();  // the board is at it now
    EXPECT_EQ(status().state, OLS_STATE_LOADED) << "answered after that request";
    for (int turn = 0; turn < 1000 && isotp_message_bytes(&host_) == 0; turn++) exchange_frames();
    EXPECT_GT(isotp_message_bytes(&host_), 0);
}

TEST_F(CanLink, ABusOffForgetsWhatWasUnderWay) {
    play_from_can();
    board_host_can_bus_off();
    board_host_run_us(1000);
    expect_fault(OLS_FAULT_HOST_LOST);
}

TEST_F(CanLink, StateIsToldEveryFiftyMillisecondsAndAtOnceWhenItChanges) {
    exchange_frames();
    told_.clear();
    board_host_run_us(200'000);
    exchange_frames();
    const auto states =
        std::count_if(told_.begin(), told_.end(), [](auto& one) { return one.first == OLS_CANBUS_STATE; });
    EXPECT_TRUE(states == 3 || states == 4) << states;
    told_.clear();
    ASSERT_TRUE(load(program(18)).ok(OLS_LOAD_END));
    exchange_frames();
    ASSERT_FALSE(told_.empty());
    EXPECT_EQ(told_[0].first, OLS_CANBUS_STATE);
    EXPECT_EQ(told_[0].second[0], OLS_STATE_LOADED);
}

TEST_F(CanLink, EachCycleIsToldInFourFramesAsItsDigestHasIt) {
    ASSERT_TRUE(load(program(18), 3).ok(OLS_LOAD_END));
    ASSERT_TRUE(arm().ok(OLS_ARM));
    ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    board_host_run_us(40'000);
    exchange_frames();
    const Reply reply = ask(OLS_READ_DIGESTS, bytes_of(ols_read_digests{0, 99, 0}));
    ASSERT_TRUE(reply.ok(OLS_READ_DIGESTS));
    ASSERT_EQ(reply.as<ols_digests_reply>().digest_count, 3);
    std::vector<std::pair<uint16_t, Bytes>> expected;
    for (int n = 0; n < 3; n++) {
        ols_cycle_digest digest;
        memcpy(&digest, reply.payload.data() + sizeof(ols_digests_reply) + size_t(n) * sizeof digest, sizeof digest);
        EXPECT_EQ(uint16_t(digest.trigger_count), 18);
        const auto low = [](uint64_t ticks) { return uint32_t(ticks); };
        const auto high = [](uint64_t ticks) { return uint16_t(ticks >> 32); };
        expected.push_back({OLS_CANBUS_CYCLE, bytes_of(ols_canbus_cycle{digest.cycle, digest.trigger_count, 0, 0})});
        for (const auto& [id, rise] : {std::pair{OLS_CANBUS_FIRST_RISE, uint64_t(digest.first_rise_ticks)},
                                       std::pair{OLS_CANBUS_LAST_RISE, uint64_t(digest.last_rise_ticks)}})
            expected.push_back({id, bytes_of(ols_canbus_rise{low(rise), high(rise), uint16_t(n)})});
        expected.push_back({OLS_CANBUS_CYCLE_CRC, bytes_of(ols_canbus_cycle_crc{digest.cycle, digest.entries_crc32})});
    }
    std::erase_if(told_,
                  [](const auto& one) { return one.first == OLS_CANBUS_STATE || one.first == OLS_CANBUS_HEALTH; });
    EXPECT_EQ(told_, expected);
}

}  // namespace
}  // namespace ols::test
