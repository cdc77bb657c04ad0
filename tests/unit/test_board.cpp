// SPDX-License-Identifier: MIT
// The board client against a scripted board that answers from protocol/frame.c, and against boards that misbehave.
// links: ols_device
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <set>
#include <string>

#include "scripted_board.hpp"

using namespace ols;

namespace {

// Of a board that fires every 1000 ticks.
ols_trigger_log_entry entry_at(uint32_t counter) {
    return {1000ull * counter, counter, 0, 0, 1, 0};
}

Result<Board> connect(ScriptedBoard::Script script, size_t piece = 64) {
    return Board::connect(std::make_unique<ScriptedBoard>(
        [script](uint16_t type, const Bytes& payload) {
            if (type == OLS_HELLO) return Answer{OLS_HELLO | OLS_REPLY, bytes_of(hello_reply())};
            return script(type, payload);
        },
        piece));
}

}  // namespace

TEST(Board, hello_is_understood_however_the_stream_is_cut) {
    for (const size_t piece : {1, 7, 64, 4096}) {
        const auto board = connect({}, piece);
        ASSERT_TRUE(board.ok()) << board.error().message;
        EXPECT_STREQ(board->info().firmware_version, "1.2.3");
        EXPECT_EQ(board->id(), "1011121314151617");
    }
}

TEST(Board, another_message_layout_is_refused_with_a_remedy_even_when_the_reply_is_shorter) {
    const auto board = Board::connect(std::make_unique<ScriptedBoard>(
        [](uint16_t, const Bytes&) {
            return Answer{OLS_HELLO | OLS_REPLY, bytes_of(uint64_t(0x123456789abcdef0))};
        },
        64));
    ASSERT_FALSE(board.ok());
    EXPECT_NE(board.error().message.find("123456789abcdef0"), std::string::npos);
    EXPECT_NE(board.error().message.find("make flash"), std::string::npos);
}

TEST(Board, a_refusal_is_told_when_it_has_a_text_of_any_length_and_is_no_refusal_without_one) {
    const ols_error_reply refusal{OLS_ERROR_NOT_SAFE, OLS_NO_SLOT, "the emergency stop is pressed"};
    for (size_t bytes = 0; bytes <= sizeof refusal; ++bytes) {
        Bytes sent = bytes_of(refusal);
        sent.resize(bytes);
        auto board = connect([&](uint16_t, const Bytes&) { return Answer{OLS_ERROR | OLS_REPLY, sent}; });
        const auto status = board->status();
        ASSERT_FALSE(status.ok());
        const std::string text(refusal.text, strnlen(refusal.text, bytes > 4 ? bytes - 4 : 0));
        const auto said = text.empty() ? fmt::format("answered message 0x7f with {} bytes", bytes) : "refused: " + text;
        EXPECT_NE(status.error().message.find(said), std::string::npos) << status.error().message << " / " << said;
    }
}

TEST(Board, a_program_arrives_whole_in_chunks_with_its_crc) {
    Bytes program(5000);
    for (size_t i = 0; i < program.size(); ++i) program[i] = uint8_t(i * 7 + i / 251);
    Bytes received;
    ols_load_begin begin{};
    bool ended = false;
    auto board = connect([&](uint16_t type, const Bytes& payload) {
        if (type == OLS_LOAD_BEGIN) std::memcpy(&begin, payload.data(), sizeof begin);
        if (type == OLS_LOAD_CHUNK) {
            ols_load_chunk chunk;
            std::memcpy(&chunk, payload.data(), sizeof chunk);
            EXPECT_EQ(chunk.offset_bytes, received.size());
            received.insert(received.end(), payload.begin() + sizeof chunk, payload.end());
        }
        ended = type == OLS_LOAD_END;
        return Answer{uint16_t(type | OLS_REPLY), {}};
    });
    ASSERT_TRUE(board->load(program, 125, 176, 3).ok());
    EXPECT_TRUE(ended);
    EXPECT_EQ(received, program);
    EXPECT_EQ(begin.slot_count, 125);
    EXPECT_EQ(begin.chain_bits, 176);
    EXPECT_EQ(begin.cycles, 3u);
    EXPECT_EQ(begin.program_bytes, 5000u);
    // CRC-32 bit by bit, as the polynomial defines it.
    uint32_t crc = ~0u;
    for (const uint8_t byte : program) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    }
    EXPECT_EQ(begin.program_crc32, ~crc);
}

TEST(Board, a_refusal_carries_the_boards_own_words_and_slot) {
    ols_error_reply refusal{OLS_ERROR_BAD_PROGRAM, 17, "the gap is too short: shorten the exposure"};
    auto board = connect([&](uint16_t, const Bytes&) { return Answer{OLS_ERROR | OLS_REPLY, bytes_of(refusal)}; });
    const Status status = board->arm();
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.error().message.find("the gap is too short"), std::string::npos);
    EXPECT_NE(status.error().message.find("slot 17"), std::string::npos);
}

TEST(Board, every_fault_and_state_of_the_wire_has_a_name_of_its_own) {
    std::set<std::string> faults, states;
    ols_status_reply status{};
    status.fault_slot = OLS_NO_SLOT;
    for (status.fault = OLS_FAULT_NONE; status.fault <= OLS_FAULT_LIGHT_STUCK; status.fault++) {
        const std::string text = fault_text(status);
        EXPECT_EQ(text.find("unknown"), std::string::npos) << int(status.fault);
        faults.insert(text.substr(0, text.find(':')));
    }
    EXPECT_EQ(faults.size(), size_t(OLS_FAULT_LIGHT_STUCK) + 1);
    EXPECT_NE(fault_text(status).find("unknown_fault"), std::string::npos) << "of a later release";
    for (uint8_t state = OLS_STATE_IDLE; state <= OLS_STATE_WAITING; state++) states.insert(state_name(state));
    EXPECT_EQ(states.size(), size_t(OLS_STATE_WAITING) + 1);
    EXPECT_EQ(states.count("unknown"), 0u);
}

TEST(Board, the_trigger_log_is_read_entry_by_entry) {
    auto board = connect([](uint16_t, const Bytes& payload) {
        ols_read_trigger_log what;
        std::memcpy(&what, payload.data(), sizeof what);
        Bytes reply = bytes_of(ols_trigger_log_reply{what.first_counter, what.first_counter + 40, 5, 3, 0});
        for (uint32_t i = 0; i < 3; ++i) {
            const Bytes entry =
                bytes_of(ols_trigger_log_entry{1000ull * i, what.first_counter + i, 2, uint16_t(i), 1, 0});
            reply.insert(reply.end(), entry.begin(), entry.end());
        }
        return Answer{OLS_READ_TRIGGER_LOG | OLS_REPLY, reply};
    });
    const auto log = board->read_trigger_log(7);
    ASSERT_TRUE(log.ok()) << log.error().message;
    EXPECT_EQ(log->next_counter, 47u);
    EXPECT_EQ(log->entries_lost, 5u);
    ASSERT_EQ(log->entries.size(), 3u);
    EXPECT_EQ(uint32_t(log->entries[2].counter), 9u);
    EXPECT_EQ(uint64_t(log->entries[2].rise_ticks), 2000u);
}

TEST(Board, a_log_that_is_far_behind_is_asked_for_by_four_messages_in_one_write) {
    constexpr uint32_t fired = 1000;
    std::vector<uint32_t> asked;
    size_t writes = 0;
    auto board = connect([&](uint16_t, const Bytes& payload) {
        ols_read_trigger_log what;
        std::memcpy(&what, payload.data(), sizeof what);
        asked.push_back(what.first_counter);
        const uint32_t count = std::min<uint32_t>(what.entries_max, fired - what.first_counter);
        Bytes reply = bytes_of(ols_trigger_log_reply{what.first_counter, fired, 0, uint16_t(count), 0});
        for (uint32_t i = 0; i < count; ++i) {
            const Bytes entry = bytes_of(entry_at(what.first_counter + i));
            reply.insert(reply.end(), entry.begin(), entry.end());
        }
        return Answer{OLS_READ_TRIGGER_LOG | OLS_REPLY, reply};
    });
    uint32_t next = 0, known = 0;
    for (; next < fired; ++writes) {
        const auto log = board->read_trigger_log(next, known);
        ASSERT_TRUE(log.ok()) << log.error().message;
        for (const auto& entry : log->entries) ASSERT_EQ(uint32_t(entry.counter), next++);
        known = log->next_counter;
    }
    EXPECT_EQ(std::vector<uint32_t>(asked.begin(), asked.begin() + 5), (std::vector<uint32_t>{0, 48, 96, 144, 192}));
    EXPECT_EQ(writes, 7u);         // one message, four times four, three, and the rest
    EXPECT_EQ(asked.size(), 21u);  // 20 full messages and the rest
}

TEST(Board, entries_that_several_replies_repeat_because_what_was_asked_for_is_gone_come_once) {
    uint32_t oldest = 500;  // moves on between the messages
    auto board = connect([&](uint16_t, const Bytes& payload) {
        ols_read_trigger_log what;
        std::memcpy(&what, payload.data(), sizeof what);
        const uint32_t first = std::max(uint32_t(what.first_counter), oldest);
        oldest += 5;
        Bytes reply = bytes_of(ols_trigger_log_reply{first, 1524, 400, what.entries_max, 0});
        for (uint32_t i = 0; i < what.entries_max; ++i) {
            const Bytes entry = bytes_of(entry_at(first + i));
            reply.insert(reply.end(), entry.begin(), entry.end());
        }
        return Answer{OLS_READ_TRIGGER_LOG | OLS_REPLY, reply};
    });
    const auto log = board->read_trigger_log(100, 400);
    ASSERT_TRUE(log.ok()) << log.error().message;
    ASSERT_EQ(log->entries.size(), 48u + 3 * 5);
    for (size_t n = 0; n < log->entries.size(); ++n) EXPECT_EQ(uint32_t(log->entries[n].counter), 500 + n);
}

TEST(Board, a_trigger_log_whose_length_lies_is_an_error) {
    auto board = connect([](uint16_t, const Bytes&) {
        return Answer{OLS_READ_TRIGGER_LOG | OLS_REPLY, bytes_of(ols_trigger_log_reply{0, 9, 0, 9, 0})};
    });
    EXPECT_FALSE(board->read_trigger_log(0).ok());
}

TEST(Board, a_reply_to_an_earlier_request_and_noise_are_passed_over) {
    auto scripted = std::make_unique<ScriptedBoard>(
        [](uint16_t type, const Bytes&) {
            return type == OLS_HELLO ? Answer{OLS_HELLO | OLS_REPLY, bytes_of(hello_reply())}
                                     : Answer{uint16_t(type | OLS_REPLY), {}};
        },
        64);
    ScriptedBoard* stream = scripted.get();
    auto board = Board::connect(std::move(scripted));
    ASSERT_TRUE(board.ok());
    uint8_t stale[64];
    const size_t n = ols_frame_encode(OLS_ERROR | OLS_REPLY, 999, nullptr, 0, stale, sizeof stale);
    stream->out_.assign(stale, stale + n);
    stream->out_.insert(stream->out_.end(), {0x4c, 0x53, 0xff, 0x00});
    EXPECT_TRUE(board->arm().ok());
}

TEST(Board, one_that_sends_without_end_and_never_what_was_asked_for_is_given_up) {
    class Chatterer : public Transfer {
        Status write(std::span<const uint8_t>, uint32_t, const Deadline&) override { return Done{}; }
        Result<Bytes> read(size_t, uint32_t, const Deadline&) override {
            uint8_t stale[OLS_FRAME_BYTES_MAX];
            const size_t n = ols_frame_encode(OLS_HELLO | OLS_REPLY, 999, nullptr, 0, stale, sizeof stale);
            return Bytes(stale, stale + n);
        }
    };
    const auto board = Board::connect(std::make_unique<Chatterer>());
    ASSERT_FALSE(board.ok());
    EXPECT_NE(board.error().message.find("not the answer"), std::string::npos) << board.error().message;
}

TEST(Board, a_silent_or_missing_board_is_an_error) {
    auto board = connect([](uint16_t, const Bytes&) { return Answer{0x1234, {}}; });
    EXPECT_FALSE(board->status().ok());
    Patience patience;
    const auto open = [&](const char* link) { return open_transfer(link, patience.begin_exchange()); };
    EXPECT_NE(open("socket:/nonexistent.sock").error().message.find("start the stage"), std::string::npos);
    EXPECT_NE(open("usb").error().message.find("socket:PATH"), std::string::npos);
}
