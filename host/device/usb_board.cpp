// SPDX-License-Identifier: MIT
// Finding running boards on USB, and Transfer over the bulk pair of one.
#include "device/usb_board.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

namespace {

class UsbTransfer : public Transfer {
  public:
    UsbTransfer(std::unique_ptr<UsbDevice> device, const std::string& serial)
        : device_(std::move(device)), name_("the board usb:" + serial) {}

    std::string name() const override { return name_; }

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us, const Deadline& deadline) override {
        if (deadline.left_ms() == 0) return too_slow(deadline);
        const UsbResult sent = device_->write(bytes, timeout_ms(timeout_us, deadline));
        if (sent.outcome != UsbOutcome::done) return failure(sent.outcome);
        if (sent.bytes != bytes.size())
            return fail(fmt::format("{} took {} of {} bytes: plug it in again", name_, sent.bytes, bytes.size()));
        return Done{};
    }

    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us, const Deadline& deadline) override {
        // An empty packet ends a message whose last packet was full; it is not what the caller waits for. No board sends many.
        for (int empty_packets = 0; empty_packets < empty_packets_max; ++empty_packets) {
            if (deadline.left_ms() == 0) return too_slow(deadline);
            std::vector<uint8_t> bytes(capacity);
            const UsbResult got = device_->read(bytes, timeout_ms(timeout_us, deadline));
            if (got.outcome != UsbOutcome::done) return failure(got.outcome);
            bytes.resize(std::min(got.bytes, capacity));
            if (!bytes.empty()) return bytes;
        }
        return fail(name_ + " sends nothing but empty packets: plug it in again");
    }

  private:
    static constexpr int empty_packets_max = 16;

    // Never 0, which libusb takes for no timeout.
    static uint32_t timeout_ms(uint32_t timeout_us, const Deadline& deadline) {
        return std::clamp((timeout_us + 999) / 1000, 1u, std::max(1u, uint32_t(deadline.left_ms())));
    }
    Error failure(UsbOutcome outcome) const { return fail(name_ + ": " + usb_outcome_text(outcome)); }
    Error too_slow(const Deadline& deadline) const {
        return fail(name_ + " has not finished an exchange " + deadline.text() + ": plug it in again and start over");
    }

    std::unique_ptr<UsbDevice> device_;
    std::string name_;
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

std::string usb_permission_text(const std::string& where, bool has_rule) {
    if (has_rule)
        return fmt::format(
            "no permission for {}: the udev rule 60-open-light-stage.rules is installed, and gives it to who is logged "
            "in at this "
            "machine and to the group plugdev: sudo usermod -aG plugdev $USER, log in again and plug it in again",
            where);
    return fmt::format(
        "no permission for {}: install the udev rule 60-open-light-stage.rules, from the source folder: "
        "sudo install -m 644 host/device/60-open-light-stage.rules /etc/udev/rules.d/ && sudo udevadm control --reload "
        "(`sudo make install` brings it, too), then plug it in again",
        where);
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
    return std::unique_ptr<Transfer>(std::make_unique<UsbTransfer>(std::move(*device), board.serial));
}

}  // namespace ols
