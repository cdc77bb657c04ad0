// SPDX-License-Identifier: MIT
// The structs of wire.h against the golden bytes of every message (protocol/golden, also made by test_golden.py).
// links: ols_protocol
#include "wire.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "frame.h"

namespace {

using Bytes = std::vector<uint8_t>;

Bytes golden(const std::string& name) {
    std::ifstream file("protocol/golden/" + name + ".hex");
    EXPECT_TRUE(file.good()) << name;
    Bytes bytes;
    for (std::string byte; file >> byte;) bytes.push_back(uint8_t(std::stoul(byte, nullptr, 16)));
    return bytes;
}

template <typename... Parts>
Bytes join(const Parts&... parts) {
    Bytes all;
    const auto append = [&](const void* from, size_t count) {
        const auto* first = static_cast<const uint8_t*>(from);
        all.insert(all.end(), first, first + count);
    };
    (append(&parts, sizeof parts), ...);
    return all;
}

void expect_golden(const char* name, uint16_t type, const Bytes& payload) {
    uint8_t frame[OLS_FRAME_BYTES_MAX];
    const size_t bytes = ols_frame_encode(type, 0x1234, payload.data(), payload.size(), frame, sizeof frame);
    EXPECT_EQ(Bytes(frame, frame + bytes), golden(name)) << name;
    // And back.
    ols_frame_parser parser{};
    const Bytes wanted = golden(name);
    ASSERT_EQ(ols_frame_parser_write(&parser, wanted.data(), wanted.size()), wanted.size());
    ols_frame got{};
    ASSERT_TRUE(ols_frame_parser_read(&parser, &got)) << name;
    EXPECT_EQ(got.type, type);
    EXPECT_EQ(got.request_id, 0x1234);
    EXPECT_EQ(Bytes(got.payload, got.payload + got.payload_bytes), payload);
}

constexpr uint64_t hash = 0x0123456789abcdef;

struct TwoSlots {
    ols_slot slots[2] = {{OLS_TRACKING, 3, 8, 0, 51000, 57870, -500}, {OLS_DARK, 1, 0, 0, 51500, 57870, 0}};
    uint32_t patterns[8 + 1][6] = {{~0u, ~0u, ~0u, ~0u, 0xfffffffc, 0}, {}, {}, {}, {}, {}, {}, {1u << 31}, {}};
};

TEST(Wire, messages_without_payload) {
    expect_golden("load_begin_reply", OLS_LOAD_BEGIN | OLS_REPLY, {});
    expect_golden("load_end", OLS_LOAD_END, {});
    expect_golden("start", OLS_START, {});
    expect_golden("stop", OLS_STOP, {});
    expect_golden("status", OLS_STATUS, {});
    expect_golden("clear_fault", OLS_CLEAR_FAULT, {});
    expect_golden("reboot_to_bootloader", OLS_REBOOT_TO_BOOTLOADER, {});
    expect_golden("swap", OLS_SWAP, {});
}

TEST(Wire, hello_and_its_reply) {
    expect_golden("hello", OLS_HELLO, join(ols_hello{hash}));
    ols_hello_reply reply{};
    reply.layout_hash = hash;
    strcpy(reply.firmware_version, "1.2.3");
    for (uint8_t n = 0; n < 8; n++) reply.board_id[n] = uint8_t(0xe0 + n);
    reply.boot_nonce = 0xdeadbeef;
    reply.tick_hz = 125'000'000;
    reply.capabilities = OLS_CAN_OFFSET_TRIGGERS;
    reply.chain_bits = 176;
    reply.slots_max = 1024;
    reply.shift_ticks = 1259;
    reply.slot_gap_ticks = 27;
    reply.lamps_lit_max = 171;
    reply.lamp_duty_max_permille = 750;
    reply.edge_start_ticks = 7;
    reply.cycle_edge_ticks = 11;
    strcpy(reply.board, "pico");
    expect_golden("hello_reply", OLS_HELLO | OLS_REPLY, join(reply));
}

TEST(Wire, loading) {
    const TwoSlots program;
    const uint32_t crc = ols_crc32(0, &program, sizeof program);
    expect_golden(
        "load_begin", OLS_LOAD_BEGIN,
        join(ols_load_begin{
            2,
            176,
            1000,
            sizeof program,
            crc,
            2500,
            {{-2000, 0, 0, 0, 0}, {100, 6250, 1 << OLS_BASIS | 1 << OLS_MATTE | 1 << OLS_DARK, 1, 0}, {}, {}}}));
    expect_golden("load_chunk", OLS_LOAD_CHUNK, join(ols_load_chunk{0}, program));
}

TEST(Wire, digests) {
    expect_golden("read_digests", OLS_READ_DIGESTS, join(ols_read_digests{17, OLS_DIGESTS_MAX, 0}));
    expect_golden(
        "digests_reply", OLS_READ_DIGESTS | OLS_REPLY,
        join(ols_digests_reply{17, 19, 2, 1, 0},
             ols_cycle_digest{0x1'0000'0000, 0x1'009e'0fe8, 3060, 17, 0x363d6b0e, 180, 1, OLS_DIGEST_INCOMPLETE}));
}

TEST(Wire, arm) {
    expect_golden("arm", OLS_ARM, join(ols_arm{12500000, OLS_START_EACH_CYCLE_BY_EDGE, {}, 1250}));
}

TEST(Wire, swap_reply) {
    expect_golden("swap_reply", OLS_SWAP | OLS_REPLY, join(ols_swap_reply{1234, 2, {}}));
}

TEST(Wire, status_reply) {
    const TwoSlots program;
    const uint32_t crc = ols_crc32(0, &program, sizeof program);
    expect_golden("status_reply", OLS_STATUS | OLS_REPLY,
                  join(ols_status_reply{OLS_STATE_FAULT,
                                        OLS_FAULT_SHIFTER_STARVED,
                                        179,
                                        0xdeadbeef,
                                        0x1'0000'0001,
                                        0x2'0000'0002,
                                        1234567,
                                        6858,
                                        17,
                                        crc,
                                        OLS_NEXT_READY,
                                        {},
                                        400,
                                        3}));
}

TEST(Wire, trigger_log) {
    expect_golden("read_trigger_log", OLS_READ_TRIGGER_LOG, join(ols_read_trigger_log{358, 48, 0}));
    expect_golden("trigger_log_reply", OLS_READ_TRIGGER_LOG | OLS_REPLY,
                  join(ols_trigger_log_reply{358, 360, 3, 2, 0}, ols_trigger_log_entry{20717472, 358, 1, 178, 1, 0},
                       ols_trigger_log_entry{20775342, 359, 1, 179, 3, 2}));
}

TEST(Wire, error_reply) {
    ols_error_reply reply{};
    reply.code = OLS_ERROR_BAD_PROGRAM;
    reply.slot = 7;
    strcpy(reply.text, "slot 7: trigger mask 16: 15 at most");
    expect_golden("error_reply", OLS_ERROR | OLS_REPLY, join(reply));
}

}  // namespace
