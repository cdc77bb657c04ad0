// SPDX-License-Identifier: MIT
// USB as the board links and the flasher need it: devices on a bus, and transfers to one interface of a device. libusb is
// behind it for real devices (libusb_bus.cpp), a model of a board in the tests.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

enum class UsbOutcome { done, stalled, timed_out, gone, failed };

struct UsbResult {
    UsbOutcome outcome = UsbOutcome::failed;
    size_t bytes = 0;  // transferred, also when the transfer ended early
};

// What happened, and what to do about it; for messages.
const char* usb_outcome_text(UsbOutcome outcome);

// An open device whose vendor-specific interface with one bulk endpoint each way is claimed. Timeouts are in
// milliseconds, 0 is none.
class UsbDevice {
  public:
    virtual ~UsbDevice() = default;

    // A control transfer to the interface; its direction is bit 7 of `request_type`. wIndex is the interface's number.
    virtual UsbResult control(uint8_t request_type, uint8_t request, std::span<uint8_t> data, uint32_t timeout_ms) = 0;

    // Bulk transfers. An empty write is a packet of no bytes; a read ends with a short packet or a full buffer.
    virtual UsbResult write(std::span<const uint8_t> bytes, uint32_t timeout_ms) = 0;
    virtual UsbResult read(std::span<uint8_t> buffer, uint32_t timeout_ms) = 0;

    // Takes a stall from both bulk endpoints and begins their data toggles anew, the host's and the device's (USB 2.0 9.4.5).
    virtual UsbResult clear_stalls() = 0;
};

// A device that is plugged in.
struct UsbListing {
    std::string port;  // bus and ports, "1-4.2": stays the same when a device restarts as another
    uint16_t vendor = 0, product = 0;
    std::string product_name, serial;  // empty when the device could not be opened
    std::string problem;               // why it could not be opened, and what to do; else empty
};

class UsbBus {
  public:
    virtual ~UsbBus() = default;
    virtual Result<std::vector<UsbListing>> list(uint16_t vendor, uint16_t product) = 0;
    virtual Result<std::unique_ptr<UsbDevice>> open(const UsbListing& listing) = 0;

    // Waits for devices to come and go.
    virtual void pause_ms(uint32_t ms) = 0;

    // The same, and returns at once when a device has come or gone, where the system tells of that.
    virtual void wait_for_change(uint32_t ms_at_most) { pause_ms(ms_at_most); }
};

// What to do about a device `where` that may not be opened; `has_rule`: the udev rule is installed.
std::string usb_permission_text(const std::string& where, bool has_rule);
bool has_udev_rule();

// The machine's own USB, by libusb. It sees devices that come later only where udev runs; a bus that is opened anew sees all.
Result<std::unique_ptr<UsbBus>> open_usb_bus();

}  // namespace ols
