// SPDX-License-Identifier: MIT
// The boot loader's commands against a model of the boot ROM: what it does, what it refuses and by which name.
// links: ols_device
#include "device/picoboot.hpp"

#include <gtest/gtest.h>

#include "board_model.hpp"

using namespace ols;
using namespace ols::test;

namespace {

constexpr uint32_t flash_begin = 0x10000000;

class Loader : public testing::Test {
  protected:
    void SetUp() override {
        board_.power_up(true);
        client_ = std::make_unique<Picoboot>(std::make_unique<ModelDevice>(board_));
        ASSERT_TRUE(client_->reset().ok());
    }
    static Bytes pattern(size_t bytes) {
        Bytes data(bytes);
        for (size_t n = 0; n < bytes; n++) data[n] = uint8_t(n * 7 + n / 256);
        return data;
    }
    void expect_refused(const Status& status, const std::string& name) {
        ASSERT_FALSE(status.ok());
        EXPECT_NE(status.error().message.find(name), std::string::npos) << status.error().message;
    }

    BoardModel board_;
    std::unique_ptr<Picoboot> client_;
};

TEST_F(Loader, what_is_erased_and_written_reads_back) {
    ASSERT_TRUE(client_->exit_xip().ok());
    ASSERT_TRUE(client_->erase(flash_begin + 8192, 4096).ok());
    const Bytes data = pattern(4096);
    ASSERT_TRUE(client_->write(flash_begin + 8192, data).ok());
    const auto read = client_->read(flash_begin + 8192, 4096);
    ASSERT_TRUE(read.ok());
    EXPECT_EQ(*read, data);
    EXPECT_TRUE(std::equal(data.begin(), data.end(), board_.flash.cells.begin() + 8192));
    EXPECT_EQ(board_.loader->violations, 0);
}

TEST_F(Loader, writing_without_erasing_only_clears_bits_and_shows_when_read) {
    ASSERT_TRUE(client_->exit_xip().ok());
    ASSERT_TRUE(client_->write(flash_begin, Bytes(256, 0xf0)).ok());
    ASSERT_TRUE(client_->write(flash_begin, Bytes(256, 0x3c)).ok());
    EXPECT_EQ(*client_->read(flash_begin, 256), Bytes(256, 0x30));
}

TEST_F(Loader, a_misaligned_erase_is_refused_by_name_and_the_next_command_after_a_reset_works) {
    ASSERT_TRUE(client_->exit_xip().ok());
    expect_refused(client_->erase(flash_begin + 256, 4096), "BAD_ALIGNMENT");
    expect_refused(client_->erase(flash_begin, 4096), "BAD_ALIGNMENT");  // halted: still the first one's status
    ASSERT_TRUE(client_->reset().ok());
    EXPECT_TRUE(client_->erase(flash_begin, 4096).ok());
}

TEST_F(Loader, addresses_outside_flash_and_misaligned_pages_are_refused_by_name) {
    ASSERT_TRUE(client_->exit_xip().ok());
    expect_refused(client_->write(0x40000000, pattern(256)), "INVALID_ADDRESS");
    ASSERT_TRUE(client_->reset().ok());
    expect_refused(client_->write(flash_begin + 16, pattern(256)), "BAD_ALIGNMENT");
    ASSERT_TRUE(client_->reset().ok());
    const auto read = client_->read(flash_begin + 1, 256);
    ASSERT_FALSE(read.ok());
    EXPECT_NE(read.error().message.find("BAD_ALIGNMENT"), std::string::npos) << read.error().message;
}

TEST_F(Loader, something_that_writes_to_the_drive_disturbs_until_access_is_exclusive) {
    board_.loader->drive_is_busy = true;
    ASSERT_TRUE(client_->exit_xip().ok());
    ASSERT_TRUE(client_->erase(flash_begin, 4096).ok());
    expect_refused(client_->write(flash_begin, pattern(4096)), "INTERLEAVED_WRITE");
    ASSERT_TRUE(client_->reset().ok());
    ASSERT_TRUE(client_->exclusive_access().ok());
    ASSERT_TRUE(client_->erase(flash_begin, 4096).ok());
    EXPECT_TRUE(client_->write(flash_begin, pattern(4096)).ok());
}

TEST_F(Loader, a_command_after_reboot_is_refused_until_the_chip_has_restarted) {
    ASSERT_TRUE(client_->exit_xip().ok());
    ASSERT_TRUE(client_->reboot(100).ok());
    expect_refused(client_->erase(flash_begin, 4096), "REBOOTING");
    board_.advance(100);
    expect_refused(client_->exit_xip(), "unplugged");
}

TEST_F(Loader, a_board_that_is_pulled_out_is_named_as_such) {
    board_.unplug_at = board_.transfers + 1;
    expect_refused(client_->exit_xip(), "unplugged");
}

}  // namespace
