// SPDX-License-Identifier: MIT
// Picoboot: the commands of the RP2040's USB boot loader (RP2040 datasheet 2.8.5), one function each.
#pragma once

#include "device/usb_device.hpp"

namespace ols {

// Every function fails when the device is gone, does not answer in time, or refuses; a refusal is named as the boot ROM
// names it (datasheet 2.8.5.5.2). After a failure start again with reset(): the boot ROM has halted its endpoints.
class Picoboot {
  public:
    explicit Picoboot(std::unique_ptr<UsbDevice> device) : device_(std::move(device)) {}

    Status reset();             // forgets what an earlier host has left, exclusive access too
    Status exclusive_access();  // nothing is written through the BOOTSEL drive from now on
    Status exit_xip();          // the flash chip listens to commands

    // Addresses are the processor's, 0x10000000 is the start of flash. Erasing wants whole sectors of 4096 bytes, reading
    // and writing begin at a page of 256.
    Status erase(uint32_t address, uint32_t byte_count);
    Status write(uint32_t address, std::span<const uint8_t> bytes);
    Result<std::vector<uint8_t>> read(uint32_t address, uint32_t byte_count);

    // Restarts the chip `delay_ms` later, as after power-up.
    Status reboot(uint32_t delay_ms);

  private:
    struct Arguments {
        uint32_t words[4] = {};
        uint8_t bytes = 0;
    };
    Status send_command(uint8_t id, const Arguments& arguments, uint32_t transfer_bytes);
    Status acknowledge(uint8_t id);
    Error refusal(uint8_t id, UsbOutcome outcome);

    std::unique_ptr<UsbDevice> device_;
    uint32_t token_ = 0;
};

}  // namespace ols
