// SPDX-License-Identifier: MIT
// ISO-TP against the frames that ISO 15765-2 draws (9.6), its timers and its rules for what comes unexpectedly (9.8).
// links: ols_protocol
#include "isotp.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace ols {
namespace {

using Bytes = std::vector<uint8_t>;
constexpr uint64_t second_us = 1'000'000;

Bytes counting(size_t bytes) {
    Bytes message(bytes);
    std::iota(message.begin(), message.end(), uint8_t(1));
    return message;
}

struct End {
    explicit End(uint16_t capacity = 1038, uint8_t block_size = 0) : buffer(capacity) {
        isotp_init(&tp, buffer.data(), capacity, block_size);
    }

    bool send(const Bytes& message) {
        sending = message;
        return isotp_send(&tp, sending.data(), uint16_t(sending.size()), now_us);
    }

    // The next frame, empty when there is none now.
    Bytes next() {
        Bytes frame(8);
        frame.resize(isotp_next_frame(&tp, frame.data(), now_us));
        return frame;
    }

    void take(const Bytes& frame) { isotp_take_frame(&tp, frame.data(), uint8_t(frame.size()), now_us); }

    Bytes received() {
        Bytes message(buffer.begin(), buffer.begin() + isotp_message_bytes(&tp));
        isotp_release(&tp);
        return message;
    }

    void pass(uint64_t us) {
        now_us += us;
        isotp_poll(&tp, now_us);
    }

    Bytes buffer, sending;
    isotp tp;
    uint64_t now_us = 5;
};

// Carries frames both ways until neither end has one; returns how many.
int carry(End& a, End& b) {
    for (int frames = 0;; frames++) {
        if (const Bytes frame = a.next(); !frame.empty())
            b.take(frame);
        else if (const Bytes answer = b.next(); !answer.empty())
            a.take(answer);
        else
            return frames;
    }
}

TEST(Isotp, SevenBytesAreOneSingleFrameAsShortAsItCanBe) {
    End end;
    ASSERT_TRUE(end.send({0xaa, 0xbb}));
    EXPECT_EQ(end.next(), (Bytes{0x02, 0xaa, 0xbb}));
    EXPECT_FALSE(isotp_is_sending(&end.tp));
    ASSERT_TRUE(end.send(counting(7)));
    EXPECT_EQ(end.next(), (Bytes{0x07, 1, 2, 3, 4, 5, 6, 7}));
}

TEST(Isotp, TwentyBytesAreAFirstFrameAndTwoConsecutiveOnesAfterFlowControl) {
    End end;
    ASSERT_TRUE(end.send(counting(20)));
    EXPECT_EQ(end.next(), (Bytes{0x10, 20, 1, 2, 3, 4, 5, 6}));
    EXPECT_TRUE(end.next().empty()) << "waits for flow control";
    end.take({0x30, 0, 0});
    EXPECT_EQ(end.next(), (Bytes{0x21, 7, 8, 9, 10, 11, 12, 13}));
    EXPECT_EQ(end.next(), (Bytes{0x22, 14, 15, 16, 17, 18, 19, 20}));
    EXPECT_FALSE(isotp_is_sending(&end.tp));
}

TEST(Isotp, SequenceNumbersGoFromFifteenToZero) {
    End end;
    ASSERT_TRUE(end.send(counting(6 + 17 * 7)));
    end.next();
    end.take({0x30, 0, 0});
    for (int n = 1; n <= 17; n++) EXPECT_EQ(end.next()[0], 0x20 | (n & 15));
}

TEST(Isotp, EveryLengthArrivesWholeForEveryBlockSize) {
    for (const int block_size : {0, 1, 2, 7, 255})
        for (size_t bytes = 1; bytes <= 1038; bytes += bytes < 40 ? 1 : 97) {
            End sender, receiver(1038, uint8_t(block_size));
            ASSERT_TRUE(sender.send(counting(bytes)));
            const int frames = carry(sender, receiver);
            ASSERT_EQ(receiver.received(), counting(bytes));
            const int consecutive = bytes <= 7 ? 0 : int(bytes - 6 + 6) / 7;
            const int flow_controls = bytes <= 7 ? 0 : 1 + (block_size ? (consecutive - 1) / block_size : 0);
            ASSERT_EQ(frames, 1 + consecutive + flow_controls) << bytes << " bytes, blocks of " << block_size;
        }
}

TEST(Isotp, SeparationTimeIsKeptInMillisecondsAndInHundredsOfMicroseconds) {
    const std::pair<uint8_t, uint64_t> codes[] = {{0x00, 0},   {0x01, 1000},   {0x7f, 127000}, {0xf1, 100},
                                                  {0xf9, 900}, {0x80, 127000}, {0xf0, 127000}, {0xfa, 127000}};
    for (const auto& [code, us] : codes) {
        End end;
        ASSERT_TRUE(end.send(counting(30)));
        end.next();
        end.take({0x30, 0, code});
        EXPECT_EQ(end.next()[0], 0x21);
        if (us > 0) {
            EXPECT_EQ(isotp_due_us(&end.tp), end.now_us + us);
            end.pass(us - 1);
            EXPECT_TRUE(end.next().empty()) << int(code);
            end.pass(1);
        }
        EXPECT_EQ(end.next()[0], 0x22) << int(code);
    }
}

TEST(Isotp, AMissingFlowControlOrConsecutiveFrameEndsTheMessageAfterASecond) {
    End sender, receiver;
    ASSERT_TRUE(sender.send(counting(20)));
    receiver.take(sender.next());
    EXPECT_EQ(receiver.next()[0], 0x30);
    sender.pass(second_us - 1);
    receiver.pass(second_us - 1);
    EXPECT_TRUE(isotp_is_sending(&sender.tp));
    sender.pass(1);
    receiver.pass(1);
    EXPECT_FALSE(isotp_is_sending(&sender.tp));
    EXPECT_EQ(sender.tp.errors[ISOTP_TIMEOUT_BS], 1);
    EXPECT_EQ(receiver.tp.errors[ISOTP_TIMEOUT_CR], 1);
    EXPECT_TRUE(receiver.received().empty());
}

TEST(Isotp, ABusThatTakesNoFrameEndsTheMessageAfterASecond) {
    End end;
    ASSERT_TRUE(end.send({1}));
    end.pass(second_us);
    EXPECT_EQ(end.tp.last_error, ISOTP_TIMEOUT_A);
    EXPECT_TRUE(end.next().empty());
}

TEST(Isotp, ALostARepeatedAndASwappedFrameEndTheMessageAndTheNextOneArrives) {
    for (const auto& order : std::vector<std::vector<int>>{{0, 2}, {0, 0, 1}, {1, 0}, {0, 1, 3}}) {
        End sender, receiver;
        ASSERT_TRUE(sender.send(counting(30)));
        receiver.take(sender.next());
        sender.take(receiver.next());
        std::vector<Bytes> frames;
        for (Bytes frame = sender.next(); !frame.empty(); frame = sender.next()) frames.push_back(frame);
        for (const int n : order) receiver.take(frames[size_t(n)]);
        EXPECT_EQ(receiver.tp.errors[ISOTP_WRONG_SN], 1);
        EXPECT_TRUE(receiver.received().empty());
        ASSERT_TRUE(sender.send(counting(40)));
        carry(sender, receiver);
        EXPECT_EQ(receiver.received(), counting(40));
    }
}

TEST(Isotp, ANewMessageEndsAnUnfinishedOneAndIsTaken) {
    End receiver;
    receiver.take({0x10, 20, 1, 2, 3, 4, 5, 6});
    EXPECT_EQ(receiver.next()[0], 0x30);
    receiver.take({0x02, 8, 9});
    EXPECT_EQ(receiver.tp.errors[ISOTP_UNEXPECTED], 1);
    EXPECT_EQ(receiver.received(), (Bytes{8, 9}));
}

TEST(Isotp, AMessageThatIsTooLongOrTooEarlyIsRefusedByFlowControl) {
    End small(100);
    small.take({0x10, 101, 1, 2, 3, 4, 5, 6});
    EXPECT_EQ(small.next(), (Bytes{0x32, 0, 0}));
    small.take({0x10, 0, 0, 0, 0x20, 0, 1, 2});  // 8192 bytes, in the long form
    EXPECT_EQ(small.next(), (Bytes{0x32, 0, 0}));
    small.take({0x01, 77});
    small.take({0x10, 20, 1, 2, 3, 4, 5, 6});  // before the single frame has been taken
    EXPECT_EQ(small.next(), (Bytes{0x32, 0, 0}));
    EXPECT_EQ(small.received(), Bytes{77}) << "what came first stays";
    EXPECT_EQ(small.tp.errors[ISOTP_BUFFER_OVERFLOW], 3);

    End sender;
    ASSERT_TRUE(sender.send(counting(101)));
    sender.next();
    sender.take({0x32, 0, 0});
    EXPECT_EQ(sender.tp.last_error, ISOTP_BUFFER_OVERFLOW);
    EXPECT_FALSE(isotp_is_sending(&sender.tp));
}

TEST(Isotp, WaitIsBorneSixteenTimesAndAnUnknownFlowStatusNotOnce) {
    End patient, strict;
    for (End* end : {&patient, &strict}) {
        ASSERT_TRUE(end->send(counting(20)));
        end->next();
    }
    for (int n = 0; n < 16; n++) {
        patient.pass(second_us - 1);
        patient.take({0x31, 0, 0});
        EXPECT_TRUE(isotp_is_sending(&patient.tp));
    }
    patient.take({0x31, 0, 0});
    EXPECT_EQ(patient.tp.last_error, ISOTP_WAIT_OVERRUN);
    strict.take({0x33, 0, 0});
    EXPECT_EQ(strict.tp.last_error, ISOTP_INVALID_FS);
}

TEST(Isotp, FramesThatAreNoneAreIgnoredAndCountNothing) {
    End end;
    for (const Bytes& frame : std::vector<Bytes>{{},
                                                 {0x01},
                                                 {0x00, 1},
                                                 {0x05, 1, 2},
                                                 {0x08, 1, 2, 3, 4, 5, 6, 7},
                                                 {0x10, 7, 1, 2, 3, 4, 5, 6},
                                                 {0x10, 20, 1, 2, 3, 4, 5},
                                                 {0x21, 1, 2, 3, 4, 5, 6, 7},
                                                 {0x30, 0, 0},
                                                 {0x40, 1, 2}})
        end.take(frame);
    EXPECT_TRUE(end.next().empty());
    EXPECT_TRUE(end.received().empty());
    EXPECT_EQ(end.tp.last_error, ISOTP_OK);
    EXPECT_EQ(isotp_due_us(&end.tp), UINT64_MAX);
}

TEST(Isotp, BothDirectionsRunAtOnce) {
    End a(1038, 3), b(1038, 4);
    ASSERT_TRUE(a.send(counting(500)));
    ASSERT_TRUE(b.send(counting(300)));
    carry(a, b);
    EXPECT_EQ(b.received(), counting(500));
    EXPECT_EQ(a.received(), counting(300));
}

TEST(Isotp, EmptyAndOverlongMessagesAndASecondOneAreNotBegun) {
    End end;
    const Bytes long_message(4096);
    EXPECT_FALSE(isotp_send(&end.tp, long_message.data(), 0, 0));
    EXPECT_FALSE(isotp_send(&end.tp, long_message.data(), 4096, 0));
    EXPECT_TRUE(isotp_send(&end.tp, long_message.data(), 4095, 0));
    EXPECT_FALSE(isotp_send(&end.tp, long_message.data(), 1, 0));
}

}  // namespace
}  // namespace ols
