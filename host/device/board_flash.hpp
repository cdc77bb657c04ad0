// SPDX-License-Identifier: MIT
// Flashing a board on USB: from the running firmware to the boot loader, the image written, and the new firmware asked
// who it is. An image is refused for a board other than the one it is made for.
#pragma once

#include "device/image_writer.hpp"
#include "device/usb_board.hpp"

namespace ols {

struct FlashRequest {
    std::string serial;        // of a running board; empty: the only board there is, running or in its boot loader
    bool force_board = false;  // write to a board in its boot loader that cannot say which one it is

    // Where the boot loader's drive is mounted, for machines that do not let us open it as a USB device; empty: nowhere.
    std::function<std::string()> find_drive = [] { return std::string(); };
};

struct FlashReport {
    ImageLabel label;  // as the new firmware says it
    std::string serial;
};

// Errors say what the board does now, and what to do.
Result<FlashReport> flash_board(UsbBus& bus, const FirmwareImage& image, const FlashRequest& request,
                                const FlashProgress& progress);

}  // namespace ols
