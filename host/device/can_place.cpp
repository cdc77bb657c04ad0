// SPDX-License-Identifier: MIT
// Sockets on an interface of SocketCAN (Linux, Documentation/networking/can.rst).
#include "device/can_place.hpp"

#include <fmt/format.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace ols {

std::string CanPlace::name() const {
    return fmt::format("board {} on the CAN interface '{}'", board_number, interface);
}

Result<CanSocketAddress> open_can_address(const CanPlace& place, int type, int protocol) {
    ifreq request{};
    if (place.interface.empty() || place.interface.size() >= sizeof request.ifr_name)
        return fail("'" + place.interface + "' is no name of a network interface: see `ip link`");
    std::memcpy(request.ifr_name, place.interface.c_str(), place.interface.size());
    CanSocketAddress opened{::socket(PF_CAN, type | SOCK_CLOEXEC, protocol), {}};
    if (opened.fd < 0) return fail(fmt::format("this kernel has no CAN ({}): modprobe can_raw", std::strerror(errno)));
    if (::ioctl(opened.fd, SIOCGIFINDEX, &request) != 0) {
        const int error = errno;
        ::close(opened.fd);
        return fail(fmt::format("no CAN interface '{}' ({}): see `ip link`", place.interface, std::strerror(error)));
    }
    opened.address.can_family = AF_CAN;
    opened.address.can_ifindex = request.ifr_ifindex;
    return opened;
}

Error can_down(const CanPlace& place, int error) {
    return fail(fmt::format("the CAN interface '{}' is down ({}): sudo ip link set {} up type can bitrate 1000000",
                            place.interface, std::strerror(error), place.interface));
}

}  // namespace ols
