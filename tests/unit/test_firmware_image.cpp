// SPDX-License-Identifier: MIT
// UF2 files: a good one is read, each defect is refused by name.
// links: ols_device
#include "device/firmware_image.hpp"

#include <gtest/gtest.h>

#include "board_model.hpp"

using namespace ols;
using namespace ols::test;

namespace {

const Bytes image = make_image("pico", "1.2.3", 2, 5);
constexpr size_t block = 512;

TEST(FirmwareImage, holds_the_pages_in_order_and_says_what_it_is) {
    const auto read = parse_uf2(make_uf2(image), "good.uf2");
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->bytes, image);
    EXPECT_EQ(read->label.board, "pico");
    EXPECT_EQ(read->label.version, "1.2.3");
    EXPECT_EQ(read->label.layout_hash, uint64_t(OLS_LAYOUT_HASH));
}

struct Defect {
    const char* name;
    std::function<void(Bytes&)> make;
    const char* message;
};

TEST(FirmwareImage, with_a_defect_is_refused_by_name) {
    const Defect defects[] = {
        {"empty", [](Bytes& f) { f.clear(); }, "no whole number"},
        {"cut off", [](Bytes& f) { f.pop_back(); }, "no whole number"},
        {"first magic", [](Bytes& f) { f[3 * block] ^= 1; }, "block 3 is no UF2 block"},
        {"second magic", [](Bytes& f) { f[3 * block + 5] ^= 1; }, "block 3 is no UF2 block"},
        {"last magic", [](Bytes& f) { f[3 * block + 511] ^= 1; }, "block 3 is no UF2 block"},
        {"another chip", [](Bytes& f) { put_word(f, 28, 0xe48bff59); }, "chip family e48bff59"},
        {"no chip", [](Bytes& f) { put_word(f, 8, 0); }, "chip family 00000000"},
        {"not for flash", [](Bytes& f) { put_word(f, 2 * block + 8, 0x2001); }, "not for the main flash"},
        {"a block lost", [](Bytes& f) { f.erase(f.begin() + block, f.begin() + 2 * block); }, "the file has"},
        {"a block twice", [](Bytes& f) { std::copy_n(f.begin(), block, f.begin() + block); }, "block 1 is numbered 0"},
        {"payload", [](Bytes& f) { put_word(f, 4 * block + 16, 128); }, "has 128 bytes"},
        {"in SRAM", [](Bytes& f) { put_word(f, 12, 0x20000000); }, "outside the image's part of flash"},
        {"below flash", [](Bytes& f) { put_word(f, 12, 0x0fffff00); }, "outside the image's part of flash"},
        {"in the flasher's note", [](Bytes& f) { put_word(f, 12, 0x101ff000); }, "outside the image's part of flash"},
        {"a gap", [](Bytes& f) { put_word(f, 5 * block + 12, 0x10000600); }, "10000500 is next"},
        {"misaligned", [](Bytes& f) { put_word(f, 5 * block + 12, 0x10000501); }, "10000500 is next"},
        {"boot2", [](Bytes& f) { f[32 + 100] ^= 1; }, "boot2 does not have the CRC"},
        {"no label", [](Bytes& f) { f[block + 32 + 8] ^= 1; }, "does not say which board"},
        {"no board", [](Bytes& f) { f[block + 32 + 8 + 16] = 0; }, "does not say which board"},
        {"only boot2", [](Bytes& f) { f.resize(block), put_word(f, 24, 1); }, "does not say which board"},
        {"longer than flash", [](Bytes& f) { f.resize((2 << 20) / 256 * block); }, "longer than the board's flash"},
    };
    for (const Defect& defect : defects) {
        Bytes file = make_uf2(image);
        defect.make(file);
        const auto read = parse_uf2(file, "bad.uf2");
        ASSERT_FALSE(read.ok()) << defect.name;
        EXPECT_NE(read.error().message.find(defect.message), std::string::npos) << read.error().message;
        EXPECT_EQ(read.error().message.find("bad.uf2: "), 0u) << "it names the file";
    }
}

TEST(FirmwareImage, of_a_path_that_is_not_there_is_refused_with_what_to_do) {
    const auto read = read_uf2("/nowhere/stage.uf2");
    ASSERT_FALSE(read.ok());
    EXPECT_NE(read.error().message.find("make firmware"), std::string::npos);
}

// What `make firmware` builds is what the flasher takes.
TEST(FirmwareImage, of_each_board_is_accepted_as_built) {
    for (const char* board : {"pico", "feather_can"}) {
        const auto read = read_uf2(std::string("build/firmware/") + board + "/stage.uf2");
        ASSERT_TRUE(read.ok()) << read.error().message;
        EXPECT_EQ(read->label.board, board);
        EXPECT_EQ(read->label.layout_hash, uint64_t(OLS_LAYOUT_HASH));
    }
}

}  // namespace
