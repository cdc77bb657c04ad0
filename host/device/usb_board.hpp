// SPDX-License-Identifier: MIT
// Boards on USB: which devices are ours, by what the firmware and the chip's boot loader say of themselves.
#pragma once

#include <optional>
#include <string_view>

#include "device/transfer.hpp"
#include "device/usb_device.hpp"

namespace ols {

// The firmware's pair is pid.codes' for development, so the product's name decides; the boot ROM's is Raspberry Pi's
// (RP2040 datasheet 2.8.5.1).
constexpr uint16_t board_usb_vendor = 0x1209, board_usb_product = 0x0001;
constexpr std::string_view board_usb_name = "light stage sequencer";
constexpr uint16_t boot_usb_vendor = 0x2e8a, boot_usb_product = 0x0003;

// Running boards. One that may not be opened is among them, with its problem.
Result<std::vector<UsbListing>> list_running_boards(UsbBus& bus);

// The running board of that serial number (the flash chip's unique number, in hex); of any when it is empty. Errors:
// there is none, there are several and none was chosen, or it may not be opened.
Result<UsbListing> find_running_board(UsbBus& bus, const std::string& serial);

// The bulk pair of a running board.
Result<std::unique_ptr<Transfer>> open_usb_transfer(UsbBus& bus, const UsbListing& board);

}  // namespace ols
