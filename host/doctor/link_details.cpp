// SPDX-License-Identifier: MIT
// What the kernel says of a network interface by netlink only (rtnetlink(7), linux/if_link.h, linux/can/netlink.h): its kind, and a
// CAN controller's bit rate and state.
#include "doctor/link_details.hpp"

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace ols {

namespace {

// What one attribute holds, within the bytes that there are.
std::optional<std::span<const std::byte>> attribute(std::span<const std::byte> bytes, unsigned short type) {
    while (bytes.size() >= sizeof(rtattr)) {
        rtattr head;
        std::memcpy(&head, bytes.data(), sizeof head);
        if (head.rta_len < sizeof head || head.rta_len > bytes.size()) return std::nullopt;
        if ((head.rta_type & NLA_TYPE_MASK) == type) return bytes.subspan(RTA_LENGTH(0), head.rta_len - RTA_LENGTH(0));
        bytes = bytes.subspan(std::min<size_t>(RTA_ALIGN(head.rta_len), bytes.size()));
    }
    return std::nullopt;
}

template <typename Struct>
std::optional<Struct> struct_in(std::span<const std::byte> bytes, unsigned short type) {
    const auto content = attribute(bytes, type);
    if (!content || content->size() < sizeof(Struct)) return std::nullopt;
    Struct value;
    std::memcpy(&value, content->data(), sizeof value);
    return value;
}

std::string text_in(std::span<const std::byte> bytes) {
    const auto* const text = reinterpret_cast<const char*>(bytes.data());
    return {text, strnlen(text, bytes.size())};
}

// What the kernel answers about an interface, in `buffer`.
std::span<const std::byte> ask(unsigned index, std::span<std::byte> buffer) {
    struct {
        nlmsghdr head;
        ifinfomsg link;
    } request{};
    request.head.nlmsg_len = NLMSG_LENGTH(sizeof request.link);
    request.head.nlmsg_type = RTM_GETLINK;
    request.head.nlmsg_flags = NLM_F_REQUEST;
    request.link.ifi_index = int(index);
    const int fd = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (fd < 0) return {};
    ssize_t got = ::send(fd, &request, request.head.nlmsg_len, 0);
    if (got > 0) got = ::recv(fd, buffer.data(), buffer.size(), 0);
    ::close(fd);
    return buffer.first(size_t(std::max<ssize_t>(got, 0)));
}

}  // namespace

std::optional<LinkDetails> link_details_in(std::span<const std::byte> message) {
    constexpr size_t before = NLMSG_LENGTH(NLMSG_ALIGN(sizeof(ifinfomsg)));
    nlmsghdr head{};
    if (message.size() < before) return std::nullopt;
    std::memcpy(&head, message.data(), sizeof head);
    if (head.nlmsg_type != RTM_NEWLINK || head.nlmsg_len < before || head.nlmsg_len > message.size())
        return std::nullopt;
    LinkDetails details;
    const auto info = attribute(message.subspan(before, head.nlmsg_len - before), IFLA_LINKINFO);
    if (!info) return details;
    if (const auto kind = attribute(*info, IFLA_INFO_KIND)) details.kind = text_in(*kind);
    const auto data = attribute(*info, IFLA_INFO_DATA);
    if (details.kind != "can" || !data) return details;
    if (const auto timing = struct_in<can_bittiming>(*data, IFLA_CAN_BITTIMING))
        details.can_bit_rate_hz = timing->bitrate;
    if (const auto state = struct_in<uint32_t>(*data, IFLA_CAN_STATE))
        details.is_bus_off = *state == uint32_t(CAN_STATE_BUS_OFF);
    return details;
}

std::optional<LinkDetails> Machine::link_details(const std::string& interface) const {
    const unsigned index = ::if_nametoindex(interface.c_str());
    alignas(nlmsghdr) std::array<std::byte, 32768> buffer;
    return index > 0 ? link_details_in(ask(index, buffer)) : std::nullopt;
}

}  // namespace ols
