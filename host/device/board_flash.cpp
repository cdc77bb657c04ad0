// SPDX-License-Identifier: MIT
// From a running board, or one in its boot loader, to a board that runs the image.
#include "device/board_flash.hpp"

#include <fmt/format.h>

#include "device/board.hpp"
#include "device/boot_drive.hpp"

namespace ols {

namespace {

constexpr uint32_t poll_ms = 100, restart_timeout_ms = 15'000, drive_timeout_ms = 5'000;
constexpr uint32_t reboot_delay_ms = 100;

// A board to be flashed, and how sure it is which one it is.
struct Target {
    UsbListing loader;         // as its boot loader
    bool was_running = false;  // firmware, not brought here by hand
    bool said_so = false;      // that firmware named the board that the image is for
};

Error other_board(const FirmwareImage& image, const std::string& board, const char* then) {
    return fail(
        fmt::format("the image is for the board '{}' and this is a '{}', whose pins are others: build its own "
                    "image, make -C firmware BOARD={}{}",
                    image.label.board, board, board, then));
}

// Waits until a device of that vendor and product is at `port`.
Result<UsbListing> wait_for(UsbBus& bus, uint16_t vendor, uint16_t product, const std::string& port, const char* what) {
    for (uint32_t waited = 0;; waited += poll_ms) {
        const auto found = bus.list(vendor, product);
        if (!found.ok()) return found.error();
        for (const UsbListing& device : *found)
            if (device.port == port) return device;
        if (waited >= restart_timeout_ms)
            return fail(
                fmt::format("{} did not come up at USB port {} within {} s", what, port, restart_timeout_ms / 1000));
        bus.pause_ms(poll_ms);
    }
}

Result<Target> leave_firmware(UsbBus& bus, const UsbListing& running, const FirmwareImage& image) {
    auto transfer = open_usb_transfer(bus, running);
    if (!transfer.ok()) return transfer.error();
    auto board = Board::connect_any_layout(std::move(*transfer));
    if (!board.ok()) return board.error();
    if (board->same_layout() && board->info().board != image.label.board)
        return other_board(image, board->info().board, "");
    const bool named = board->same_layout();
    if (const Status left = board->reboot_to_bootloader(); !left.ok())
        return fail(left.error().message + " (or hold BOOTSEL while plugging the board in)");
    const auto loader = wait_for(bus, boot_usb_vendor, boot_usb_product, running.port, "the boot loader");
    if (!loader.ok()) return loader.error();
    return Target{*loader, true, named};
}

Result<Target> find_target(UsbBus& bus, const FirmwareImage& image, const FlashRequest& request) {
    const auto running = list_running_boards(bus);
    if (!running.ok()) return running.error();
    const auto loaders = bus.list(boot_usb_vendor, boot_usb_product);
    if (!loaders.ok()) return loaders.error();
    if (!request.serial.empty() || (!running->empty() && loaders->empty())) {
        const auto board = find_running_board(bus, request.serial);
        if (!board.ok()) return board.error();
        return leave_firmware(bus, *board, image);
    }
    if (loaders->empty())
        return fail("no board is plugged in: connect it by USB; a new one while holding its BOOTSEL button");
    if (loaders->size() + running->size() > 1)
        return fail(
            "several boards are plugged in, and in BOOTSEL mode they cannot be told apart: unplug all but one, or "
            "choose a running one with --board usb:SERIAL");
    return Target{loaders->front()};
}

// Whether the image is for the board that the flash says it is; nothing is written yet.
Status check_board(Picoboot& loader, const Target& target, const FirmwareImage& image, bool force_board) {
    const auto label = read_label(loader);
    if (!label.ok()) return label.error();
    if (*label && (*label)->board == image.label.board) return Done{};
    if (*label)
        return other_board(image, (*label)->board,
                           "; nothing was written (was the last image the wrong one? copy the right one to its drive)");
    if (target.said_so || force_board) return Done{};
    return fail(
        fmt::format("the board is empty or runs something else, so it cannot say whether it is a '{}': if you are "
                    "sure, add --force-board",
                    image.label.board));
}

Status flash_by_usb(UsbBus& bus, const Target& target, const FirmwareImage& image, bool force_board,
                    const FlashProgress& progress) {
    auto device = bus.open(target.loader);
    if (!device.ok()) return device.error();
    Picoboot loader(std::move(*device));
    if (Status taken = take_over(loader); !taken.ok()) return taken;
    if (Status fits = check_board(loader, target, image, force_board); !fits.ok()) {
        if (target.was_running && !loader.reboot(reboot_delay_ms).ok())
            return fail(fits.error().message + "; plug it in again to start its firmware");
        return fits;
    }
    if (Status written = write_image(loader, image, progress); !written.ok()) return written;
    return loader.reboot(reboot_delay_ms);
}

Status flash_by_drive(UsbBus& bus, const Target& target, const FirmwareImage& image, const FlashRequest& request) {
    std::string drive = request.find_drive();
    for (uint32_t waited = 0; drive.empty() && waited < drive_timeout_ms; waited += poll_ms) {
        bus.pause_ms(poll_ms);
        drive = request.find_drive();
    }
    if (drive.empty()) return fail(target.loader.problem + "; or mount its drive RPI-RP2 and run this again");
    if (!target.said_so && !request.force_board)
        return fail(fmt::format("a drive cannot say whether its board is a '{}': if you are sure, add --force-board",
                                image.label.board));
    return write_boot_drive(drive, image.uf2);
}

// Asks the firmware that has come up who it is.
Result<FlashReport> check_firmware(UsbBus& bus, const std::string& port, const FirmwareImage& image) {
    const auto listing = wait_for(bus, board_usb_vendor, board_usb_product, port, "the new firmware");
    if (!listing.ok()) return fail(listing.error().message + ": everything was written; plug the board in again");
    auto transfer = open_usb_transfer(bus, *listing);
    if (!transfer.ok()) return fail(transfer.error().message + " (the board is flashed)");
    const auto board = Board::connect_any_layout(std::move(*transfer));
    if (!board.ok()) return board.error();
    FlashReport report{{}, listing->serial};
    report.label.layout_hash = board->layout_hash();
    if (report.label.layout_hash != image.label.layout_hash)
        return fail(fmt::format("the board runs message layout {:016x} and the image has {:016x}: flash it again",
                                report.label.layout_hash, image.label.layout_hash));
    // Another layout than this program's may have them elsewhere; the hash has told already that it is the image.
    report.label.board = board->same_layout() ? board->info().board : image.label.board.c_str();
    report.label.version = board->same_layout() ? board->info().firmware_version : image.label.version.c_str();
    if (report.label.board != image.label.board || report.label.version != image.label.version)
        return fail(fmt::format("the board runs {} {} and the image is {} {}: flash it again", report.label.board,
                                report.label.version, image.label.board, image.label.version));
    return report;
}

}  // namespace

Result<FlashReport> flash_board(UsbBus& bus, const FirmwareImage& image, const FlashRequest& request,
                                const FlashProgress& progress) {
    const auto target = find_target(bus, image, request);
    if (!target.ok()) return target.error();
    const bool by_usb = target->loader.problem.empty();
    const Status flashed = by_usb ? flash_by_usb(bus, *target, image, request.force_board, progress)
                                  : flash_by_drive(bus, *target, image, request);
    if (!flashed.ok()) return flashed.error();
    return check_firmware(bus, target->loader.port, image);
}

}  // namespace ols
