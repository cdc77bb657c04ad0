// SPDX-License-Identifier: MIT
// Flashing a board on a USB bus: whole, interrupted at every transfer, and refused.
// links: ols_device
#include "device/board_flash.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "board_model.hpp"

using namespace ols;
using namespace ols::test;

namespace {

using Runs = BoardModel::Runs;

class Flashing : public testing::Test {
  protected:
    void SetUp() override { bus_.boards = {&board_}; }

    static FirmwareImage image_of(const Bytes& bytes) { return *parse_uf2(make_uf2(bytes), "new.uf2"); }
    Result<FlashReport> flash(bool force_board = false, const std::string& serial = "") {
        FlashRequest request{serial, force_board, find_drive_};
        return flash_board(bus_, image_of(new_), request, [](size_t, size_t) {});
    }
    void expect_refused(const Result<FlashReport>& result, const std::string& why) {
        ASSERT_FALSE(result.ok());
        EXPECT_NE(result.error().message.find(why), std::string::npos) << result.error().message;
    }
    bool holds(const Bytes& image) const { return std::equal(image.begin(), image.end(), board_.flash.cells.begin()); }

    BoardModel board_;
    ModelBus bus_;
    const Bytes old_ = make_image("pico", "0.9.0", 4, 1), new_ = make_image("pico", "1.0.0", 3, 2);
    std::function<std::string()> find_drive_ = [] { return std::string(); };
};

TEST_F(Flashing, a_running_board_leaves_is_written_and_says_that_it_runs_the_new_firmware) {
    board_.hold_image(old_);
    board_.power_up();
    size_t last = 0, total = 0;
    const auto report = flash_board(bus_, image_of(new_), {}, [&](size_t done, size_t all) {
        EXPECT_GE(done, last);
        last = done, total = all;
    });
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report->label.version, "1.0.0");
    EXPECT_EQ(report->serial, "00f1e2d3c4b5a697");
    EXPECT_EQ(last, total);
    EXPECT_EQ(total, new_.size());
    EXPECT_TRUE(holds(new_));
    EXPECT_EQ(board_.runs, Runs::firmware);
    // Nothing behind the image but what was there, and no note.
    EXPECT_TRUE(
        std::all_of(board_.flash.cells.end() - 4096, board_.flash.cells.end(), [](uint8_t c) { return c == 0xff; }));
}

TEST_F(Flashing, an_empty_board_needs_a_person_to_say_which_one_it_is) {
    board_.power_up();
    expect_refused(flash(), "--force-board");
    EXPECT_EQ(board_.flash.erases + board_.flash.writes, 0u);
    const auto report = flash(true);
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_TRUE(holds(new_));
}

TEST_F(Flashing, an_image_for_another_board_is_refused_by_the_running_firmware_even_when_forced) {
    board_.hold_image(make_image("feather_can", "0.9.0", 4, 1));
    board_.power_up();
    expect_refused(flash(true), "for the board 'pico' and this is a 'feather_can'");
    EXPECT_EQ(board_.runs, Runs::firmware) << "it has not even left";
    EXPECT_EQ(board_.flash.erases + board_.flash.writes, 0u);
}

TEST_F(Flashing, in_the_boot_loader_the_image_in_flash_says_which_board_it_is) {
    board_.hold_image(make_image("feather_can", "0.9.0", 4, 1));
    board_.power_up(true);
    expect_refused(flash(true), "for the board 'pico' and this is a 'feather_can'");
    EXPECT_EQ(board_.flash.erases + board_.flash.writes, 0u);
    board_.hold_image(old_);
    board_.power_up(true);
    EXPECT_TRUE(flash().ok()) << "no force is needed for the same board";
}

TEST_F(Flashing, a_board_of_another_message_layout_is_flashed_by_the_label_in_its_flash) {
    board_.hold_image(make_image("pico", "0.5.0", 4, 1, 0x1234));
    board_.power_up();
    ASSERT_TRUE(flash().ok());
    EXPECT_TRUE(holds(new_));
    board_.hold_image(make_image("feather_can", "0.5.0", 4, 1, 0x1234));
    board_.power_up();
    expect_refused(flash(), "this is a 'feather_can'");
    bus_.pause_ms(1000);
    EXPECT_EQ(board_.runs, Runs::firmware) << "sent back to its own firmware";
}

TEST_F(Flashing, a_board_that_plays_is_not_flashed) {
    board_.hold_image(old_);
    board_.playing = true;
    board_.power_up();
    expect_refused(flash(), "armed or playing");
    EXPECT_EQ(board_.runs, Runs::firmware);
    EXPECT_TRUE(holds(old_));
}

TEST_F(Flashing, whichever_transfer_the_cable_is_pulled_at_the_board_is_whole_or_waits_and_the_next_run_completes) {
    int interrupted = 0;
    for (int n = 0;; n++) {
        board_ = BoardModel();
        board_.hold_image(old_);
        board_.unplug_at = n;
        board_.power_up();
        const auto first = flash();
        if (board_.transfers <= n) {
            EXPECT_TRUE(first.ok());
            break;
        }
        ASSERT_FALSE(first.ok()) << "transfer " << n;
        interrupted++;
        board_.unplug_at = -1;
        board_.power_up();
        if (board_.runs == Runs::firmware)
            EXPECT_TRUE(holds(old_) || holds(new_)) << "transfer " << n << ": never a mixture";
        else
            EXPECT_NE(first.error().message.find("stays dark in its boot loader"), std::string::npos)
                << "transfer " << n << ": " << first.error().message;
        const auto second = flash();
        ASSERT_TRUE(second.ok()) << "transfer " << n << ": " << second.error().message;
        EXPECT_TRUE(holds(new_)) << "transfer " << n;
        EXPECT_EQ(board_.runs, Runs::firmware);
    }
    EXPECT_GT(interrupted, 60);
}

TEST_F(Flashing, whichever_transfer_the_host_dies_at_the_next_run_takes_over_and_completes) {
    int interrupted = 0;
    for (int n = 0;; n++) {
        board_ = BoardModel();
        board_.hold_image(old_);
        board_.host_dies_at = n;
        board_.power_up();
        flash().ok();
        if (board_.transfers <= n) break;
        interrupted++;
        board_.host_dies_at = -1;
        bus_.pause_ms(1000);
        const auto second = flash();
        ASSERT_TRUE(second.ok()) << "transfer " << n << ": " << second.error().message;
        EXPECT_TRUE(holds(new_)) << "transfer " << n;
    }
    EXPECT_GT(interrupted, 60);
}

TEST_F(Flashing, flash_that_does_not_keep_what_is_written_is_named_and_its_firmware_never_started) {
    board_.hold_image(old_);
    board_.flash.stuck_zero = 2 * 4096 + 77;
    Bytes odd = new_;
    odd[board_.flash.stuck_zero] |= 1;
    board_.power_up();
    const auto result = flash_board(bus_, image_of(odd), {}, [](size_t, size_t) {});
    expect_refused(result, "flash at 1000204d does not keep");
    board_.power_up();
    EXPECT_EQ(board_.runs, Runs::loader);
}

TEST_F(Flashing, a_program_that_writes_to_the_boot_loaders_drive_does_not_get_in_between) {
    board_.hold_image(old_);
    board_.drive_is_busy = true;
    board_.power_up();
    const auto report = flash();
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_TRUE(holds(new_));
}

TEST_F(Flashing, a_board_that_does_not_come_back_as_boot_loader_is_waited_for_and_named) {
    board_.hold_image(old_);
    board_.power_up();
    board_.loader_is_dead = true;
    expect_refused(flash(), "the boot loader did not come up at USB port 1-1");
}

TEST_F(Flashing, several_boards_are_told_apart_by_serial_number_and_in_the_boot_loader_not_at_all) {
    BoardModel other("1-2", "1111111111111111");
    bus_.boards.push_back(&other);
    for (BoardModel* board : bus_.boards) {
        board->hold_image(old_);
        board->power_up();
    }
    expect_refused(flash(), "usb:00f1e2d3c4b5a697, usb:1111111111111111");
    ASSERT_TRUE(flash(false, "1111111111111111").ok());
    EXPECT_TRUE(holds(old_)) << "the first one is as it was";
    EXPECT_TRUE(std::equal(new_.begin(), new_.end(), other.flash.cells.begin()));
    for (BoardModel* board : bus_.boards) board->power_up(true);
    expect_refused(flash(), "unplug all but one");
}

TEST_F(Flashing, no_board_at_all_is_said_so) {
    expect_refused(flash(), "no board is plugged in");
}

// The drive is a directory here; the model takes the file from it as the boot ROM does.
TEST_F(Flashing, where_the_boot_loader_may_not_be_opened_its_drive_serves) {
    const auto drive = std::filesystem::temp_directory_path() / ("ols_drive_" + std::to_string(getpid()));
    std::filesystem::create_directory(drive);
    std::ofstream(drive / "INFO_UF2.TXT") << "UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: RPI-RP2\n";
    board_.hold_image(old_);
    board_.loader_may_not_be_opened = true;
    board_.power_up();
    expect_refused(flash(), "no permission; or mount its drive");
    find_drive_ = [&] { return drive.string(); };
    bus_.on_pause = [&] {
        if (!std::filesystem::exists(drive / "stage.uf2")) return;
        std::ifstream file(drive / "stage.uf2", std::ios::binary);
        const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
        EXPECT_EQ(Bytes(bytes.begin(), bytes.end()), make_uf2(new_));
        board_.hold_image(new_);
        board_.power_up();
        std::filesystem::remove(drive / "stage.uf2");
    };
    expect_refused(flash(), "a drive cannot say");
    board_.power_up();  // plugged in anew, running: it can say
    const auto report = flash();
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report->label.version, "1.0.0");
    std::filesystem::remove_all(drive);
}

}  // namespace
