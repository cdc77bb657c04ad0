// SPDX-License-Identifier: MIT
// Finding running boards on USB, and Transfer over the bulk pair of one.
#include "device/usb_board.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

namespace {

class UsbTransfer : public Transfer {
  public:
    explicit UsbTransfer(std::unique_ptr<UsbDevice> device) : device_(std::move(device)) {}

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us) override {
        const UsbResult sent = device_->write(bytes, timeout_ms(timeout_us));
        if (sent.outcome != UsbOutcome::done) return fail(usb_outcome_text(sent.outcome));
        return Done{};
    }

    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us) override {
        // An empty packet ends a message whose last packet was full; it is not what the caller waits for. No board sends many.
        for (int empty_packets = 0; empty_packets < empty_packets_max; ++empty_packets) {
            std::vector<uint8_t> bytes(capacity);
            const UsbResult got = device_->read(bytes, timeout_ms(timeout_us));
            if (got.outcome != UsbOutcome::done) return fail(usb_outcome_text(got.outcome));
            bytes.resize(got.bytes);
            if (!bytes.empty()) return bytes;
        }
        return fail("the board sends nothing but empty packets: plug it in again");
    }

  private:
    static constexpr int empty_packets_max = 16;
    static uint32_t timeout_ms(uint32_t timeout_us) { return (timeout_us + 999) / 1000; }

    std::unique_ptr<UsbDevice> device_;
};

std::string serials_of(const std::vector<UsbListing>& boards) {
    std::string text;
    for (const UsbListing& board : boards) text += (text.empty() ? "usb:" : ", usb:") + board.serial;
    return text;
}

}  // namespace

const char* usb_outcome_text(UsbOutcome outcome) {
    switch (outcome) {
        case UsbOutcome::done: return "done";
        case UsbOutcome::stalled: return "the board refused the transfer (endpoint stalled): plug it in again";
        case UsbOutcome::timed_out: return "the board did not answer in time: plug it in again and start over";
        case UsbOutcome::gone: return "the board was unplugged: connect it again and start over";
        case UsbOutcome::failed: return "the USB transfer failed: check cable and hub, then start over";
    }
    return "unknown";
}

Result<std::vector<UsbListing>> list_running_boards(UsbBus& bus) {
    auto found = bus.list(board_usb_vendor, board_usb_product);
    if (!found.ok()) return found.error();
    std::erase_if(*found, [](const UsbListing& device) {
        return device.problem.empty() && device.product_name != board_usb_name;
    });
    return found;
}

Result<UsbListing> find_running_board(UsbBus& bus, const std::string& serial) {
    const auto boards = list_running_boards(bus);
    if (!boards.ok()) return boards.error();
    std::vector<UsbListing> chosen;
    std::string problem;
    for (const UsbListing& board : *boards) {
        if (!board.problem.empty())
            problem = board.problem;
        else if (serial.empty() || board.serial == serial)
            chosen.push_back(board);
    }
    if (chosen.size() == 1) return chosen[0];
    if (chosen.size() > 1) return fail("several boards are plugged in: choose one of " + serials_of(chosen));
    if (!problem.empty()) return fail(problem);
    if (serial.empty())
        return fail("no board is plugged in: connect one by USB; `stagectl flash` gives a new one its firmware");
    if (boards->empty()) return fail("no board usb:" + serial + ": none is plugged in");
    return fail(fmt::format("no board usb:{}; plugged in: {}", serial, serials_of(*boards)));
}

Result<std::unique_ptr<Transfer>> open_usb_transfer(UsbBus& bus, const UsbListing& board) {
    auto device = bus.open(board);
    if (!device.ok()) return device.error();
    return std::unique_ptr<Transfer>(std::make_unique<UsbTransfer>(std::move(*device)));
}

}  // namespace ols
