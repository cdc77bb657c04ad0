// SPDX-License-Identifier: MIT
// What the kernel says of a CAN interface, as Linux 6.1 said it of slcan at 500 kbit/s (`ip -details link` beside it: kind can,
// bitrate 500000, ERROR-ACTIVE); and damaged answers.
// links: ols_doctor
#include "doctor/link_details.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

using namespace ols;

namespace {

const std::string recorded =
    "8403000010000000010000005c0000000000180103000000c1000100000000000900030063616e300000000008000d000a000000050010"
    "0006000000050011000000000008000400100000000800320000000000080033000000000008001b000000000008001e00000000000800"
    "3d000000000008001f000100000008002800ffff0000080029000000010008003a000000010008003b000000010008003c00ffff000008"
    "0020000100000005002100010000000f000600706669666f5f666173740000080023000100000008002f00010000000800300000000000"
    "050027000000000024000e000000000000000000000000000000000000000000000000000000000000000000cc00170000000000000000"
    "00010000000000000000000000000000000800000000000000000000000000000000000000000000000000000000000000000000000000"
    "00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "00000000000000000000000000000000000000000000000000000000640007000000000001000000000000000800000000000000000000"
    "00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "0000000000000000000000000000000000000c002b000500020000000000b00012000800010063616e001c000300000000000000000000"
    "000000000000000000000000000000880002002400010020a1070000000000000000000000000000000000000000000000000000000000"
    "080003000000000008000400000000000c0005000000000000000000080006000000000028000d0010270000204e000050c30000a08601"
    "0048e8010090d0030020a1070000350c0040420f0008000f00000000000c001180080001000200000090001a008c000200880001000000"
    "00000000000000000000010000000100000001000000010000000000000001000000000000000000000000000000000000000000000000"
    "000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000010270000e8030000"
    "0000000000000000000000000000000001000000";

std::vector<std::byte> recorded_bytes() {
    std::vector<std::byte> bytes;
    for (size_t at = 0; at < recorded.size(); at += 2)
        bytes.push_back(std::byte(std::stoi(recorded.substr(at, 2), nullptr, 16)));
    return bytes;
}

TEST(DetailsOfALink, are_the_kind_and_bit_rate_that_the_kernel_says) {
    const auto details = link_details_in(recorded_bytes());
    ASSERT_TRUE(details);
    EXPECT_EQ(details->kind, "can");
    EXPECT_EQ(details->can_bit_rate_hz, 500'000u);
    EXPECT_FALSE(details->is_bus_off);
}

// IFLA_CAN_STATE, of 8 bytes and type 4, follows the clock; CAN_STATE_BUS_OFF is 3.
TEST(DetailsOfALink, say_that_a_controller_is_off_the_bus) {
    const std::string& hex = recorded;
    const size_t state = hex.find("0800040000000000", hex.find("63616e001c0003"));
    ASSERT_NE(state, std::string::npos);
    auto bytes = recorded_bytes();
    bytes[state / 2 + 4] = std::byte(3);
    EXPECT_TRUE(link_details_in(bytes)->is_bus_off);
}

TEST(DetailsOfALink, of_an_answer_that_was_cut_or_changed_read_nothing_beyond_it) {
    const auto whole = recorded_bytes();
    for (size_t size = 0; size < whole.size(); ++size) {
        std::vector<std::byte> cut(whole.begin(), whole.begin() + ptrdiff_t(size));
        EXPECT_FALSE(link_details_in(cut));
        if (size < sizeof(uint32_t)) continue;
        const auto said = uint32_t(size);
        std::memcpy(cut.data(), &said, sizeof said);  // and says that it is no longer
        (void)link_details_in(cut);
    }
    for (size_t at = 0; at < whole.size(); ++at)
        for (const int value : {0, 1, 3, 0x7f, 0xff}) {
            auto changed = whole;
            changed[at] = std::byte(value);
            (void)link_details_in(changed);
        }
}

}  // namespace
