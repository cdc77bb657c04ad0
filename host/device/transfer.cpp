// SPDX-License-Identifier: MIT
// Board links by their scheme.
#include "device/transfer.hpp"

#include "device/can_transfer.hpp"
#include "device/usb_board.hpp"

namespace ols {

namespace {

Result<std::unique_ptr<Transfer>> open_usb_link(const std::string& serial) {
    auto bus = open_usb_bus();
    if (!bus.ok()) return bus.error();
    const auto board = find_running_board(**bus, serial);
    if (!board.ok()) return board.error();
    return open_usb_transfer(**bus, *board);
}

}  // namespace

Result<std::unique_ptr<Transfer>> open_transfer(const std::string& link, const Deadline& deadline) {
    constexpr std::string_view socket_scheme = "socket:", usb_scheme = "usb:";
    if (link.starts_with(socket_scheme)) return open_socket_transfer(link.substr(socket_scheme.size()), deadline);
    if (link.starts_with(usb_scheme)) return open_usb_link(link.substr(usb_scheme.size()));
    if (link.starts_with("can:") || link.starts_with("can-socket:")) return open_can(link, deadline);
    return fail("'" + link + "' is no board link: write usb:, usb:SERIAL, socket:PATH, can:IFACE or can-socket:PATH");
}

}  // namespace ols
