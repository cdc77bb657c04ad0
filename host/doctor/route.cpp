// SPDX-License-Identifier: MIT
// The kernel's table of routes, /proc/net/route: addresses as hexadecimal numbers of the byte order of the network, read as words
// of the machine's.
#include "doctor/route.hpp"

#include <arpa/inet.h>
#include <linux/route.h>

#include <charconv>

namespace ols {

namespace {

std::optional<uint32_t> hex(const std::string& text) {
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, 16);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return number;
}

}  // namespace

std::optional<Route> route_to(const Machine& machine, const std::string& address) {
    in_addr to{};
    if (inet_pton(AF_INET, address.c_str(), &to) != 1) return std::nullopt;
    // Addresses of the machine itself are in another table.
    if (ntohl(to.s_addr) >> 24 == 127) return Route{"lo", true};
    std::optional<Route> best;
    uint32_t best_mask = 0;
    for (const std::string& line : lines_in(machine.read("/proc/net/route").value_or(""))) {
        const auto words = words_in(line);  // Iface Destination Gateway Flags RefCnt Use Metric Mask ...
        if (words.size() < 8) continue;
        const auto network = hex(words[1]), gateway = hex(words[2]), flags = hex(words[3]), mask = hex(words[7]);
        if (!network || !gateway || !flags || !mask || !(*flags & RTF_UP) || (*flags & RTF_REJECT)) continue;
        if ((to.s_addr & *mask) != *network || (best && ntohl(*mask) <= ntohl(best_mask))) continue;
        best = Route{words[0], *gateway == 0};
        best_mask = *mask;
    }
    return best;
}

}  // namespace ols
