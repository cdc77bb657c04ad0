// SPDX-License-Identifier: MIT
// A host at the board without hardware: asks, and reads the replies. Common ground of the tests of link and stops.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "board_host.h"
#include "frame.h"
#include "wire.h"

namespace ols::test {

using Bytes = std::vector<uint8_t>;

struct Reply {
    uint16_t type = 0, id = 0;
    Bytes payload;

    template <typename T>
    T as() const {
        T value{};
        memcpy(&value, payload.data(), std::min(sizeof value, payload.size()));
        return value;
    }
    bool ok(uint16_t request) const { return type == (request | OLS_REPLY); }
    uint16_t error() const { return type == (OLS_ERROR | OLS_REPLY) ? as<ols_error_reply>().code : 0; }
    std::string text() const { return as<ols_error_reply>().text; }
};

template <typename T>
Bytes bytes_of(const T& value) {
    const auto* first = reinterpret_cast<const uint8_t*>(&value);
    return Bytes(first, first + sizeof value);
}

class Link : public testing::Test {
  protected:
    void SetUp() override {
        board_host_power_up();
        board_host_attach();
    }

    Reply ask(uint16_t type, const Bytes& payload = {}) {
        uint8_t frame[OLS_FRAME_BYTES_MAX], answer[2 * OLS_FRAME_BYTES_MAX];
        const size_t bytes = ols_frame_encode(type, ++id_, payload.data(), payload.size(), frame, sizeof frame);
        const size_t answered = board_host_exchange(frame, bytes, answer, sizeof answer);
        ols_frame_parser parser{};
        EXPECT_EQ(ols_frame_parser_write(&parser, answer, answered), answered);
        ols_frame got{};
        EXPECT_TRUE(ols_frame_parser_read(&parser, &got));
        EXPECT_EQ(got.request_id, id_);
        return {got.type, got.request_id, Bytes(got.payload, got.payload + got.payload_bytes)};
    }

    Reply arm(uint32_t heartbeat_ticks = 0) {
        return ask(OLS_ARM, bytes_of(ols_arm{heartbeat_ticks, OLS_START_BY_COMMAND, {}, 0}));
    }

    ols_status_reply status() { return ask(OLS_STATUS).as<ols_status_reply>(); }

    static Bytes program(int slots, uint32_t period_ticks = 57'870) {
        Bytes all;
        for (int n = 0; n < slots; n++) {
            ols_slot slot{};
            slot.trigger_mask = 1;
            slot.exposure_ticks = 50'000;
            slot.period_ticks = period_ticks;
            const Bytes header = bytes_of(slot);
            all.insert(all.end(), header.begin(), header.end());
        }
        for (int n = 0; n < slots; n++)
            for (int word = 0; word < 6; word++)
                for (int byte = 0; byte < 4; byte++) all.push_back(word < 5 ? uint8_t(37 * n + word) : 0);
        return all;
    }

    static ols_load_begin begin_for(const Bytes& program, uint32_t cycles) {
        ols_load_begin begin{};
        begin.slot_count = uint16_t(program.size() / 40);
        begin.chain_bits = 176;
        begin.cycles = cycles;
        begin.program_bytes = uint32_t(program.size());
        begin.program_crc32 = ols_crc32(0, program.data(), program.size());
        return begin;
    }

    Reply load(const Bytes& program, uint32_t cycles = 1) {
        EXPECT_TRUE(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(program, cycles))).ok(OLS_LOAD_BEGIN));
        for (size_t offset = 0; offset < program.size(); offset += 1000) {
            Bytes chunk = bytes_of(ols_load_chunk{uint32_t(offset)});
            const size_t end = std::min(program.size(), offset + 1000);
            chunk.insert(chunk.end(), program.begin() + long(offset), program.begin() + long(end));
            EXPECT_TRUE(ask(OLS_LOAD_CHUNK, chunk).ok(OLS_LOAD_CHUNK));
        }
        return ask(OLS_LOAD_END);
    }

    void play(uint32_t cycles = 0) {
        ASSERT_TRUE(load(program(18), cycles).ok(OLS_LOAD_END));
        ASSERT_TRUE(arm().ok(OLS_ARM));
        ASSERT_TRUE(ask(OLS_START).ok(OLS_START));
    }

    void expect_fault(ols_fault cause) {
        const ols_status_reply now = status();
        EXPECT_EQ(now.state, OLS_STATE_FAULT);
        EXPECT_EQ(now.fault, cause);
        EXPECT_FALSE(board_host_pins_are_connected());
        EXPECT_EQ(arm().error(), OLS_ERROR_FAULT_LATCHED);
        for (const uint16_t type : {OLS_START, OLS_STOP, OLS_LOAD_END})
            EXPECT_EQ(ask(type).error(), OLS_ERROR_FAULT_LATCHED) << "until it is cleared";
        EXPECT_EQ(ask(OLS_LOAD_BEGIN, bytes_of(begin_for(program(2), 1))).error(), OLS_ERROR_FAULT_LATCHED);
        EXPECT_TRUE(ask(OLS_CLEAR_FAULT).ok(OLS_CLEAR_FAULT));
        EXPECT_EQ(status().state, OLS_STATE_IDLE);
    }

    uint16_t id_ = 0;
};

}  // namespace ols::test
