// SPDX-License-Identifier: MIT
// Frames: what is sent is what arrives, in pieces of any size; damage costs the damaged frame and no other.
// links: ols_protocol
#include "frame.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <vector>

namespace {

using Bytes = std::vector<uint8_t>;

struct Message {
    uint16_t type = 0, request_id = 0;
    Bytes payload;
    bool operator==(const Message&) const = default;
};

Bytes encode(const Message& message) {
    Bytes frame(OLS_FRAME_BYTES_MAX);
    frame.resize(ols_frame_encode(message.type, message.request_id, message.payload.data(), message.payload.size(),
                                  frame.data(), frame.size()));
    return frame;
}

Message random_message(std::mt19937& random) {
    Message message{uint16_t(random()), uint16_t(random()), Bytes(random() % 8 ? random() % 40 : random() % 1025)};
    // Payloads full of sync bytes are the hard ones.
    for (uint8_t& byte : message.payload) byte = random() % 3 ? uint8_t(random()) : uint8_t("LS"[random() % 2]);
    return message;
}

// Feeds `stream` in pieces of random size.
std::vector<Message> parse(const Bytes& stream, std::mt19937& random, uint32_t* dropped_bytes = nullptr) {
    const auto parser = std::make_unique<ols_frame_parser>();
    std::vector<Message> messages;
    for (size_t used = 0; used < stream.size();) {
        const size_t piece = std::min<size_t>(1 + random() % 100, stream.size() - used);
        const size_t taken = ols_frame_parser_write(parser.get(), stream.data() + used, piece);
        EXPECT_GT(taken, 0u);
        used += taken;
        for (ols_frame frame; ols_frame_parser_read(parser.get(), &frame);)
            messages.push_back(
                {frame.type, frame.request_id, Bytes(frame.payload, frame.payload + frame.payload_bytes)});
    }
    if (dropped_bytes) *dropped_bytes = parser->dropped_bytes;
    return messages;
}

TEST(Crc32, has_the_check_value_of_the_standard_and_goes_on_where_it_stopped) {
    EXPECT_EQ(ols_crc32(0, "123456789", 9), 0xcbf43926u);
    EXPECT_EQ(ols_crc32(ols_crc32(0, "1234", 4), "56789", 5), 0xcbf43926u);
    EXPECT_EQ(ols_crc32(0, nullptr, 0), 0u);
}

TEST(Frame, a_stream_arrives_whole_whatever_pieces_it_comes_in) {
    std::mt19937 random(1);
    std::vector<Message> sent;
    Bytes stream;
    for (int n = 0; n < 500; n++) {
        sent.push_back(random_message(random));
        const Bytes frame = encode(sent.back());
        stream.insert(stream.end(), frame.begin(), frame.end());
    }
    uint32_t dropped_bytes = 0;
    EXPECT_EQ(parse(stream, random, &dropped_bytes), sent);
    EXPECT_EQ(dropped_bytes, 0u);
}

TEST(Frame, garbage_between_frames_is_dropped_and_counted) {
    std::mt19937 random(2);
    std::vector<Message> sent;
    Bytes stream;
    uint32_t garbage_bytes = 0;
    for (int n = 0; n < 300; n++) {
        for (int g = int(random() % 50); g > 0; g--, garbage_bytes++)
            stream.push_back(random() % 4 ? uint8_t(random()) : 'L');
        sent.push_back(random_message(random));
        const Bytes frame = encode(sent.back());
        stream.insert(stream.end(), frame.begin(), frame.end());
    }
    uint32_t dropped_bytes = 0;
    EXPECT_EQ(parse(stream, random, &dropped_bytes), sent);
    EXPECT_EQ(dropped_bytes, garbage_bytes);
}

TEST(Frame, each_damaged_byte_costs_its_frame_and_no_other) {
    std::mt19937 random(3);
    const Message first = random_message(random), last = random_message(random);
    Message middle = random_message(random);
    middle.payload.resize(30);
    const Bytes before = encode(first), damaged_from = encode(middle), after = encode(last);
    for (size_t at = 0; at < damaged_from.size(); at++) {
        for (int bit = 0; bit < 8; bit++) {
            Bytes damaged = damaged_from;
            damaged[at] ^= uint8_t(1 << bit);
            Bytes stream = before;
            stream.insert(stream.end(), damaged.begin(), damaged.end());
            stream.insert(stream.end(), after.begin(), after.end());
            EXPECT_EQ(parse(stream, random), (std::vector{first, last})) << "byte " << at << " bit " << bit;
        }
    }
}

TEST(Frame, lost_and_doubled_bytes_cost_the_frames_they_touch) {
    std::mt19937 random(4);
    for (int repeat = 0; repeat < 300; repeat++) {
        const Message first = random_message(random), hurt = random_message(random), last = random_message(random);
        const Bytes before = encode(first), after = encode(last);
        Bytes frame = encode(hurt);
        const size_t at = random() % frame.size();
        // A byte before or after an equal one can be lost unnoticed only if the frame stays the same: not with length 1.
        if (repeat % 2)
            frame.erase(frame.begin() + long(at));
        else
            frame.insert(frame.begin() + long(at), uint8_t(~frame[at]));
        Bytes stream = before;
        stream.insert(stream.end(), frame.begin(), frame.end());
        stream.insert(stream.end(), after.begin(), after.end());
        const std::vector<Message> got = parse(stream, random);
        ASSERT_GE(got.size(), 2u);
        EXPECT_EQ(got.front(), first);
        EXPECT_EQ(got.back(), last);
        for (size_t n = 1; n + 1 < got.size(); n++) EXPECT_EQ(got[n], hurt) << "only if the blow fell outside it";
    }
}

TEST(Frame, a_header_with_a_wild_length_does_not_wait_for_bytes_that_never_come) {
    std::mt19937 random(5);
    const Message message{OLS_STATUS, 9, {}};
    Bytes stream = encode({OLS_STATUS, 8, {}});
    stream[2] = 0xff;  // payload_bytes
    stream[3] = 0x03;
    const Bytes good = encode(message);
    stream.insert(stream.end(), good.begin(), good.end());
    EXPECT_EQ(parse(stream, random), std::vector{message});
}

TEST(Frame, a_header_that_claims_more_than_the_maximum_is_dropped_though_its_check_is_right) {
    std::mt19937 random(6);
    ols_frame_header header{};
    header.sync = OLS_FRAME_SYNC;
    header.payload_bytes = OLS_PAYLOAD_BYTES_MAX + 1;
    header.header_check = uint16_t(ols_crc32(0, &header, 8));
    const auto* first = reinterpret_cast<const uint8_t*>(&header);
    Bytes stream(first, first + sizeof header);
    const Message message{OLS_STATUS, 9, {}};
    const Bytes good = encode(message);
    stream.insert(stream.end(), good.begin(), good.end());
    EXPECT_EQ(parse(stream, random), std::vector{message});
}

TEST(Frame, encoding_refuses_what_does_not_fit) {
    uint8_t frame[OLS_FRAME_BYTES_MAX];
    const Bytes payload(OLS_PAYLOAD_BYTES_MAX + 1);
    EXPECT_EQ(ols_frame_encode(1, 1, payload.data(), payload.size(), frame, sizeof frame), 0u);
    EXPECT_EQ(ols_frame_encode(1, 1, payload.data(), 100, frame, 113), 0u);
    EXPECT_EQ(ols_frame_encode(1, 1, payload.data(), 100, frame, 114), 114u);
    EXPECT_EQ(ols_frame_encode(1, 1, payload.data(), OLS_PAYLOAD_BYTES_MAX, frame, sizeof frame), sizeof frame);
}

TEST(Frame, the_longest_payload_arrives_and_one_byte_more_is_never_encoded) {
    std::mt19937 random(4);
    const Message longest{7, 9, Bytes(OLS_PAYLOAD_BYTES_MAX, 0x4c)};
    EXPECT_EQ(parse(encode(longest), random), std::vector<Message>{longest});
    uint8_t frame[OLS_FRAME_BYTES_MAX + 1];
    const Bytes payload(OLS_PAYLOAD_BYTES_MAX + 1);
    EXPECT_EQ(ols_frame_encode(7, 9, payload.data(), payload.size(), frame, sizeof frame), 0u);
}

// A parser that kept the byte before it would have no room for the last one of the frame.
TEST(Frame, the_longest_frame_finds_room_behind_any_number_of_stray_bytes) {
    const Message longest{7, 9, Bytes(OLS_PAYLOAD_BYTES_MAX, 1)};
    for (size_t stray = 0; stray < 5; stray++) {
        Bytes stream(stray, 'x');
        const Bytes frame = encode(longest);
        stream.insert(stream.end(), frame.begin(), frame.end());
        const auto parser = std::make_unique<ols_frame_parser>();
        ols_frame got;
        for (size_t n = 0; n + 1 < stream.size(); n++) {
            ASSERT_EQ(ols_frame_parser_write(parser.get(), &stream[n], 1), 1u);
            ASSERT_FALSE(ols_frame_parser_read(parser.get(), &got));
        }
        ASSERT_EQ(ols_frame_parser_write(parser.get(), &stream.back(), 1), 1u);
        ASSERT_TRUE(ols_frame_parser_read(parser.get(), &got)) << stray;
        EXPECT_EQ(got.payload_bytes, OLS_PAYLOAD_BYTES_MAX);
        EXPECT_EQ(parser->dropped_bytes, stray);
    }
}

TEST(Frame, a_damaged_header_is_dropped_as_soon_as_it_is_whole) {
    Bytes header = encode({7, 9, {}});
    header.resize(10);
    header[9] ^= 1;
    const auto parser = std::make_unique<ols_frame_parser>();
    ols_frame got;
    ols_frame_parser_write(parser.get(), header.data(), header.size());
    EXPECT_FALSE(ols_frame_parser_read(parser.get(), &got));
    EXPECT_EQ(parser->dropped_bytes, 10u);
}

}  // namespace
