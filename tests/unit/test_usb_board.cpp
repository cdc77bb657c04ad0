// SPDX-License-Identifier: MIT
// Which devices on the bus are boards, and the bulk pair as a link.
// links: ols_device
#include "device/usb_board.hpp"

#include <gtest/gtest.h>

#include "board_model.hpp"
#include "device/board.hpp"

using namespace ols;
using namespace ols::test;

namespace {

Deadline within_a_minute() {
    static Patience patience(60'000);
    return patience.begin_exchange();
}

class UsbBoards : public testing::Test {
  protected:
    void SetUp() override {
        board_.hold_image(make_image("pico", "1.2.3", 2, 5));
        board_.power_up();
    }
    std::string problem(const std::string& serial = "") {
        const auto found = find_running_board(bus_, serial);
        return found.ok() ? "" : found.error().message;
    }

    BoardModel board_;
    ModelBus bus_;
};

TEST_F(UsbBoards, the_only_one_needs_no_serial_number_and_answers) {
    bus_.boards = {&board_};
    const auto listing = find_running_board(bus_, "");
    ASSERT_TRUE(listing.ok()) << listing.error().message;
    auto transfer = open_usb_transfer(bus_, *listing);
    ASSERT_TRUE(transfer.ok());
    const auto board = Board::connect(std::move(*transfer));
    ASSERT_TRUE(board.ok()) << board.error().message;
    EXPECT_STREQ(board->info().firmware_version, "1.2.3");
    EXPECT_STREQ(board->info().board, "pico");
}

TEST_F(UsbBoards, other_devices_with_the_shared_development_id_are_none) {
    bus_.strangers = {{"1-3", 0x1209, 0x0001, "somebody's keyboard", "42", ""}};
    EXPECT_NE(problem().find("no board is plugged in"), std::string::npos) << problem();
    bus_.boards = {&board_};
    EXPECT_EQ(problem(), "");
}

TEST_F(UsbBoards, one_that_may_not_be_opened_is_reported_with_what_to_do) {
    bus_.strangers = {{"1-3", 0x1209, 0x0001, "", "", "no permission: install the udev rule"}};
    EXPECT_EQ(problem(), "no permission: install the udev rule");
}

TEST(UsbPermission, names_the_rule_with_the_command_that_installs_it_or_the_group_that_it_gives_to) {
    const std::string without = usb_permission_text("the USB device at bus 1 address 7", false);
    EXPECT_NE(without.find("bus 1 address 7"), std::string::npos);
    EXPECT_NE(
        without.find("sudo install -m 644 host/device/60-open-light-stage.rules /etc/udev/rules.d/ && sudo udevadm "
                     "control --reload"),
        std::string::npos);
    const std::string with = usb_permission_text("the USB device at bus 1 address 7", true);
    EXPECT_NE(with.find("60-open-light-stage.rules is installed"), std::string::npos);
    EXPECT_NE(with.find("sudo usermod -aG plugdev"), std::string::npos);
}

TEST_F(UsbBoards, a_serial_number_that_is_not_there_is_answered_with_those_that_are) {
    bus_.boards = {&board_};
    EXPECT_NE(problem("ffff").find("no board usb:ffff; plugged in: usb:00f1e2d3c4b5a697"), std::string::npos);
    EXPECT_EQ(problem("00f1e2d3c4b5a697"), "");
}

TEST_F(UsbBoards, a_board_pulled_out_between_two_requests_is_named_as_such) {
    bus_.boards = {&board_};
    auto transfer = open_usb_transfer(bus_, *find_running_board(bus_, ""));
    ASSERT_TRUE(transfer.ok());
    auto board = Board::connect(std::move(*transfer));
    ASSERT_TRUE(board.ok());
    board_.pull_cable();
    const auto status = board->status();
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.error().message.find("unplugged"), std::string::npos) << status.error().message;
}

// A device whose reads are given one by one.
class ScriptedDevice : public UsbDevice {
  public:
    explicit ScriptedDevice(std::vector<UsbResult> reads) : reads_(std::move(reads)) {}
    UsbResult control(uint8_t, uint8_t, std::span<uint8_t>, uint32_t) override { return {UsbOutcome::stalled, 0}; }
    UsbResult write(std::span<const uint8_t> bytes, uint32_t) override { return {UsbOutcome::done, bytes.size()}; }
    UsbResult read(std::span<uint8_t> buffer, uint32_t timeout_ms) override {
        EXPECT_EQ(timeout_ms, 2u) << "1500 us, and never less than asked for";
        const UsbResult result = reads_.front();
        reads_.erase(reads_.begin());
        std::fill_n(buffer.begin(), result.bytes, uint8_t(0x55));
        return result;
    }
    UsbResult clear_stalls() override { return {UsbOutcome::stalled, 0}; }

  private:
    std::vector<UsbResult> reads_;
};

class ScriptedBus : public ModelBus {
  public:
    std::vector<UsbResult> reads;
    Result<std::unique_ptr<UsbDevice>> open(const UsbListing&) override {
        return std::unique_ptr<UsbDevice>(std::make_unique<ScriptedDevice>(reads));
    }
};

// One that sends a byte a read, for ever.
class TricklingBus : public ModelBus {
  public:
    size_t bytes = 0;
    Result<std::unique_ptr<UsbDevice>> open(const UsbListing&) override {
        class Device : public UsbDevice {
          public:
            explicit Device(size_t& bytes) : bytes_(bytes) {}
            UsbResult control(uint8_t, uint8_t, std::span<uint8_t>, uint32_t) override {
                return {UsbOutcome::stalled, 0};
            }
            UsbResult write(std::span<const uint8_t> sent, uint32_t) override {
                return {UsbOutcome::done, sent.size()};
            }
            UsbResult read(std::span<uint8_t> buffer, uint32_t) override {
                buffer[0] = uint8_t(++bytes_);
                return {UsbOutcome::done, 1};
            }
            UsbResult clear_stalls() override { return {UsbOutcome::stalled, 0}; }

          private:
            size_t& bytes_;
        };
        return std::unique_ptr<UsbDevice>(std::make_unique<Device>(bytes));
    }
};

TEST(UsbTransfer, passes_over_the_empty_packet_that_ends_a_message) {
    ScriptedBus bus;
    bus.reads = {{UsbOutcome::done, 0}, {UsbOutcome::done, 3}};
    const auto transfer = open_usb_transfer(bus, {});
    EXPECT_EQ(*(*transfer)->read(64, 1500, within_a_minute()), Bytes(3, 0x55));
}

TEST(UsbTransfer, gives_up_a_board_that_sends_nothing_but_empty_packets) {
    ScriptedBus bus;
    bus.reads.assign(1000, {UsbOutcome::done, 0});
    const auto transfer = open_usb_transfer(bus, {});
    const auto read = (*transfer)->read(64, 1500, within_a_minute());
    ASSERT_FALSE(read.ok());
    EXPECT_NE(read.error().message.find("empty packets"), std::string::npos) << read.error().message;
}

TEST(UsbTransfer, an_exchange_that_is_over_ends_before_the_next_transfer_and_names_the_board) {
    ScriptedBus bus;  // none of its transfers may be asked for
    UsbListing listing;
    listing.serial = "00f1";
    const auto transfer = open_usb_transfer(bus, listing);
    Patience none(0);
    for (const std::string& problem : {(*transfer)->read(64, 1500, none.begin_exchange()).error().message,
                                       (*transfer)->write(Bytes(3), 1500, none.begin_exchange()).error().message})
        EXPECT_NE(problem.find("the board usb:00f1 has not finished an exchange"), std::string::npos) << problem;
}

TEST(UsbTransfer, a_board_that_trickles_is_given_up_within_the_bytes_of_a_few_frames) {
    TricklingBus bus;
    const auto board = Board::connect(std::move(*open_usb_transfer(bus, {})));
    ASSERT_FALSE(board.ok());
    EXPECT_NE(board.error().message.find("not the answer"), std::string::npos) << board.error().message;
    EXPECT_LE(bus.bytes, 16u * OLS_FRAME_BYTES_MAX);
}

TEST(UsbTransfer, names_each_way_in_which_a_transfer_ends_early) {
    ScriptedBus bus;
    bus.reads = {{UsbOutcome::stalled, 0}, {UsbOutcome::timed_out, 0}, {UsbOutcome::gone, 0}, {UsbOutcome::failed, 0}};
    const auto transfer = open_usb_transfer(bus, {});
    for (const char* expected : {"stalled", "in time", "unplugged", "cable"}) {
        const auto read = (*transfer)->read(64, 1500, within_a_minute());
        ASSERT_FALSE(read.ok());
        EXPECT_NE(read.error().message.find(expected), std::string::npos) << read.error().message;
    }
}

}  // namespace
