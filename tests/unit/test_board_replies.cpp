// SPDX-License-Identifier: MIT
// What a log and a list of digests must be to be believed, and that a log goes on from message to message.
// links: ols_device
#include "device/board_replies.hpp"

#include <gtest/gtest.h>

#include <cstring>

using namespace ols;

namespace {

using Bytes = std::vector<uint8_t>;

template <typename Head, typename Item>
Bytes payload_of(const Head& head, const std::vector<Item>& items) {
    Bytes bytes(sizeof head + items.size() * sizeof(Item));
    std::memcpy(bytes.data(), &head, sizeof head);
    if (!items.empty()) std::memcpy(bytes.data() + sizeof head, items.data(), items.size() * sizeof(Item));
    return bytes;
}

ols_trigger_log_entry entry(uint32_t counter, uint64_t tick) {
    return {tick, counter, 0, 0, 1, 0};
}

ols_cycle_digest digest(uint32_t first_counter, uint64_t first_tick, uint64_t last_tick) {
    ols_cycle_digest made{};
    made.first_counter = first_counter;
    made.first_rise_ticks = first_tick;
    made.last_rise_ticks = last_tick;
    return made;
}

std::string log_problem(const ols_trigger_log_reply& head, const std::vector<ols_trigger_log_entry>& entries) {
    const auto log = parse_trigger_log(payload_of(head, entries), {10, 48, 0});
    return log.ok() ? "" : log.error().message;
}

std::string digests_problem(const ols_digests_reply& head, const std::vector<ols_cycle_digest>& digests) {
    const auto read = parse_digests(payload_of(head, digests), {10, 31, 0});
    return read.ok() ? "" : read.error().message;
}

}  // namespace

TEST(BoardReplies, a_log_from_what_was_asked_for_on_is_read) {
    EXPECT_EQ(log_problem({10, 12, 0, 2, 0}, {entry(10, 5), entry(11, 6)}), "");
    EXPECT_EQ(log_problem({10, 10, 0, 0, 0}, {}), "") << "nothing new";
    EXPECT_EQ(log_problem({99, 101, 89, 2, 0}, {entry(99, 5), entry(100, 6)}), "") << "what was asked for is gone";
}

TEST(BoardReplies, a_log_that_cannot_be_is_refused_with_what_is_wrong) {
    const auto expect = [](const std::string& problem, const char* said) {
        EXPECT_NE(problem.find(said), std::string::npos) << problem << " / " << said;
    };
    expect(log_problem({10, 12, 0, 2, 0}, {entry(10, 5)}), "which are not its 2 entries");
    expect(log_problem({10, 12, 0, 0, 0}, {entry(10, 5)}), "which are not its 0 entries");
    expect(log_problem({10, 99, 0, 65535, 0}, {}), "48 were asked for at most");
    expect(log_problem({9, 12, 0, 1, 0}, {entry(9, 5)}), "from 9 on where those from 10 on");
    expect(log_problem({9, 9, 0, 0, 0}, {}), "was it started anew?");
    expect(log_problem({10, 11, 0, 2, 0}, {entry(10, 5), entry(11, 6)}), "up to 12 of 11");
    expect(log_problem({10, 20, 0, 0, 0}, {}), "sends none from 10 on");
    expect(log_problem({UINT32_MAX, UINT32_MAX, 0, 2, 0}, {entry(UINT32_MAX, 1), entry(0, 2)}), "up to 4294967297");
    expect(log_problem({10, 12, 0, 2, 0}, {entry(10, 5), entry(12, 6)}), "trigger 12 in the place of trigger 11");
    expect(log_problem({10, 12, 0, 2, 0}, {entry(10, 5), entry(11, 5)}), "which is not later");
    expect(log_problem({10, 11, 0, 1, 0}, {entry(10, UINT64_MAX)}), "which no board reaches");
}

TEST(BoardReplies, a_reply_shorter_than_its_head_is_refused) {
    for (size_t bytes = 0; bytes < sizeof(ols_trigger_log_reply); ++bytes)
        EXPECT_FALSE(parse_trigger_log(Bytes(bytes), {0, 48, 0}).ok()) << bytes;
    for (size_t bytes = 0; bytes < sizeof(ols_digests_reply); ++bytes)
        EXPECT_FALSE(parse_digests(Bytes(bytes), {0, 31, 0}).ok()) << bytes;
}

TEST(BoardReplies, digests_rise_and_end_after_they_begin) {
    EXPECT_EQ(digests_problem({10, 12, 0, 2, 0}, {digest(5, 1, 2), digest(6, 3, 4)}), "");
    EXPECT_NE(digests_problem({10, 11, 0, 1, 0}, {digest(5, 3, 2)}), "");
    EXPECT_NE(digests_problem({10, 12, 0, 2, 0}, {digest(5, 1, 2), digest(5, 3, 4)}), "");
    EXPECT_NE(digests_problem({10, 11, 0, 2, 0}, {digest(5, 1, 2), digest(6, 3, 4)}), "");
    EXPECT_NE(digests_problem({10, 12, 0, 32, 0}, {}), "");
}

TEST(BoardReplies, a_log_goes_on_where_it_was) {
    TriggerLog log;
    ASSERT_TRUE(append_log(log, {{entry(3, 30), entry(4, 40)}, 3, 9, 2}).ok());
    ASSERT_TRUE(append_log(log, {{entry(4, 40), entry(5, 50)}, 4, 10, 2}).ok()) << "what is known comes once";
    EXPECT_EQ(log.entries.size(), 3u);
    EXPECT_EQ(log.first_counter, 3u);
    EXPECT_EQ(log.next_counter, 10u);
    EXPECT_FALSE(append_log(log, {{}, 6, 9, 2}).ok()) << "fewer triggers";
    EXPECT_FALSE(append_log(log, {{}, 6, 10, 1}).ok()) << "fewer lost";
    EXPECT_FALSE(append_log(log, {{entry(6, 50)}, 6, 10, 2}).ok()) << "not later";
}

TEST(BoardReplies, text_of_the_boards_is_printable_ascii) {
    EXPECT_EQ(printable(std::string("a b~\0c", 6)), "a b~");
    EXPECT_EQ(printable(std::string("\x1b[2J\xff\xc3\x28\x7f")),
              "?[2J?"
              "?(?");
    EXPECT_EQ(printable(std::span<const char>()), "");
}
