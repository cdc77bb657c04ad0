// SPDX-License-Identifier: MIT
// A board on a CAN bus by its link. On SocketCAN ISO-TP is the kernel's where it has it, otherwise our own above raw frames, the
// one that the board has.
#include <fmt/format.h>

#include "device/can_transfer.hpp"
#include "device/can_watch.hpp"
#include "device/kernel_isotp.hpp"
#include "wire.h"

namespace ols {

namespace {

// A link whose failures say what went on around it.
class WatchedTransfer : public Transfer {
  public:
    WatchedTransfer(std::unique_ptr<CanClaim> claim, std::unique_ptr<CanWatch> watch,
                    std::unique_ptr<Transfer> transfer)
        : claim_(std::move(claim)), watch_(std::move(watch)), transfer_(std::move(transfer)) {}

    std::string name() const override { return transfer_->name(); }

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us, const Deadline& deadline) override {
        watch_->forget();
        Status written = transfer_->write(bytes, timeout_us, deadline);
        if (!written.ok()) return explained(written.error());
        return written;
    }

    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us, const Deadline& deadline) override {
        auto bytes = transfer_->read(capacity, timeout_us, deadline);
        if (!bytes.ok()) return explained(bytes.error());
        return bytes;
    }

  private:
    Error explained(const Error& error) {
        watch_->look();
        return fail(error.message + watch_->trouble());
    }

    std::unique_ptr<CanClaim> claim_;
    std::unique_ptr<CanWatch> watch_;
    std::unique_ptr<Transfer> transfer_;
};

Result<std::unique_ptr<Transfer>> open_on_socketcan(const CanPlace& place) {
    auto watch = CanWatch::open(place);
    if (!watch.ok()) return watch.error();
    auto claim = CanClaim::take(place);
    if (!claim.ok()) return claim.error();
    std::unique_ptr<Transfer> transfer;
    if (kernel_has_isotp()) {
        auto opened = open_kernel_isotp(place, **watch);
        if (!opened.ok()) return opened.error();
        transfer = std::move(*opened);
    } else {
        auto bus = open_socketcan(place, {place.to_host()});
        if (!bus.ok()) return bus.error();
        transfer = can_transfer(std::move(*bus), place.board_number);
    }
    return std::unique_ptr<Transfer>(
        std::make_unique<WatchedTransfer>(std::move(*claim), std::move(*watch), std::move(transfer)));
}

}  // namespace

Result<std::unique_ptr<Transfer>> open_can(const std::string& link, const Deadline& deadline) {
    const size_t colon = link.find(':'), mark = link.rfind('#');
    CanPlace place;
    place.interface = link.substr(colon + 1, mark == std::string::npos ? mark : mark - colon - 1);
    if (mark != std::string::npos) {
        const std::string text = link.substr(mark + 1);
        if (text.empty() || text.size() > 2 || text.find_first_not_of("0123456789") != std::string::npos ||
            std::stoi(text) > 15)
            return fail("'" + link + "': boards on a CAN bus have the numbers 0 to 15, as in can:can0#2");
        place.board_number = unsigned(std::stoi(text));
    }
    if (link.starts_with("can:")) return open_on_socketcan(place);
    auto bus = open_can_socket(place.interface, deadline);
    if (!bus.ok()) return bus.error();
    return can_transfer(std::move(*bus), place.board_number);
}

}  // namespace ols
