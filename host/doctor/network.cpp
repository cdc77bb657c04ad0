// SPDX-License-Identifier: MIT
// The network of GigE cameras: socket buffers, packets, what the kernel drops (Linux, Documentation/networking/ip-sysctl.rst).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "doctor/check_up.hpp"
#include "doctor/route.hpp"

namespace ols {

namespace {

// A frame's lost packets are asked for again for so long (docs/cameras.md), and a machine without a real-time kernel may let a
// thread wait for some tens of milliseconds: what comes meanwhile lies in the socket.
constexpr double held_s = 0.1;
constexpr int jumbo_mtu = 9000;
constexpr int headers_bytes = 20 + 8 + 8;  // IPv4, UDP, GVSP
constexpr const char* no_gige = "the stage has no camera that may be a GigE one";

std::vector<CameraPlace> gige_cameras(const CheckUp& up) {
    std::vector<CameraPlace> found;
    std::ranges::copy_if(up.cameras, std::back_inserter(found), &CameraPlace::may_be_gige);
    return found;
}

// Of the camera that sends most.
struct SocketNeed {
    size_t camera = 0;
    double link_bytes_per_s = 0;
    double bytes() const { return std::min(held_s * link_bytes_per_s, double(aravis_socket_bytes)); }
};

SocketNeed socket_need(const CheckUp& up) {
    SocketNeed need;
    for (const CameraPlace& camera : gige_cameras(up)) {
        const double rate = up.needs.cameras[camera.number].link_bytes_per_s();
        if (rate > need.link_bytes_per_s) need = {camera.number, rate};
    }
    return need;
}

Finding check_socket(const CheckUp& up, Check check, const char* name, const char* why) {
    if (gige_cameras(up).empty()) return skipped(check, no_gige);
    const auto value = up.machine.read_number(std::string("/proc/sys/net/core/") + name);
    if (!value) return skipped(check, fmt::format("the kernel does not show net.core.{}", name));
    const SocketNeed need = socket_need(up);
    Finding finding{
        check,
        "",
        CheckVerdict::ok,
        fmt::format("{} bytes", *value),
        fmt::format(
            "{:.0f} bytes: what camera {} sends in {:.0f} ms at {}/s, while Aravis asks for lost packets again or "
            "its thread waits (its socket is of {} MiB at most); {}",
            std::ceil(need.bytes()), need.camera, held_s * 1e3, bytes_text(need.link_bytes_per_s),
            aravis_socket_bytes >> 20, why),
        {}};
    if (double(*value) >= need.bytes()) return finding;
    finding.verdict = CheckVerdict::fail;
    finding.commands = {write_file_command("/etc/sysctl.d/60-stage-sockets.conf",
                                           {fmt::format("net.core.rmem_max = {}", aravis_socket_bytes),
                                            fmt::format("net.core.rmem_default = {}", aravis_socket_bytes)}) +
                        " && sudo sysctl --system"};
    return finding;
}

// A packet socket bypasses it, and no packet of a loopback is lost on a wire.
bool is_loopback(const std::optional<Route>& route) {
    return route && route->interface == "lo";
}

// Why nothing can be said of the interface to a camera; else empty.
std::string no_route(const CameraPlace& camera, const std::optional<Route>& route) {
    if (camera.kind == CameraPlace::aravis)
        return fmt::format("'{}' is not found on the network, so its interface is not known", camera.source);
    return route ? "" : fmt::format("no route leads to {}", camera.address);
}

Finding check_mtu(const CheckUp& up, const CameraPlace& camera) {
    const auto route = route_to(up.machine, camera.address);
    if (const std::string why = no_route(camera, route); !why.empty()) return skipped(Check::mtu, why, camera.title());
    const std::string& interface = route->interface;
    const auto mtu = up.machine.read_number("/sys/class/net/" + interface + "/mtu");
    if (!mtu || *mtu <= headers_bytes)
        return skipped(Check::mtu, "the kernel does not say the MTU of " + interface, camera.title());
    const double rate = up.needs.cameras[camera.number].link_bytes_per_s();
    const auto packets = [rate](double packet) { return std::round(rate / (packet - headers_bytes)); };
    Finding finding{
        Check::mtu,
        camera.title(),
        CheckVerdict::ok,
        fmt::format("{} bytes on {}", *mtu, interface),
        fmt::format(
            "{} bytes: jumbo frames, {:.0f} packets a second instead of {:.0f} at an MTU of 1500 (each costs the "
            "processor some microseconds)",
            jumbo_mtu, packets(jumbo_mtu), packets(1500)),
        {}};
    if (*mtu >= jumbo_mtu) return finding;
    finding.verdict = CheckVerdict::warn;
    // The link file of an interface is the only one that counts for it: the lines of Debian's 99-default.link are in it.
    const std::string address = up.machine.read("/sys/class/net/" + interface + "/address").value_or("");
    finding.commands = {
        write_file_command(fmt::format("/etc/systemd/network/10-stage-{}.link", interface),
                           {"[Match]", "MACAddress=" + address, "[Link]", fmt::format("MTUBytes={}", jumbo_mtu),
                            "NamePolicy=keep kernel database onboard slot path",
                            "AlternativeNamesPolicy=database onboard slot path", "MACAddressPolicy=persistent"}),
        fmt::format("sudo ip link set {} mtu {}    # at once, until the next start", interface, jumbo_mtu)};
    return finding;
}

// The higher of the interface's own and of all.
int64_t filter_of(const Machine& machine, const std::string& interface) {
    const auto value = [&machine](const std::string& name) {
        return machine.read_number("/proc/sys/net/ipv4/conf/" + name + "/rp_filter").value_or(0);
    };
    return std::max(value("all"), value(interface));
}

constexpr int64_t strict =
    1;  // an answer is dropped where the way back is another interface; 2 is loose: any way back will do

std::vector<std::string> loose_commands(const std::string& interface) {
    return {write_file_command(fmt::format("/etc/sysctl.d/60-stage-{}.conf", interface),
                               {fmt::format("net.ipv4.conf.{}.rp_filter = 2", interface)}) +
            " && sudo sysctl --system"};
}

// Ports that a camera may be at that is not found.
std::string strict_ports(const Machine& machine) {
    std::string strict_ones;
    for (const std::string& name : machine.list("/sys/class/net"))
        if (name != "lo" && machine.read("/sys/class/net/" + name + "/operstate") == "up" &&
            filter_of(machine, name) == strict)
            strict_ones += (strict_ones.empty() ? "" : ", ") + name;
    return strict_ones;
}

Finding check_filter(const CheckUp& up, const CameraPlace& camera) {
    const auto route = route_to(up.machine, camera.address);
    Finding finding{
        Check::rp_filter,
        camera.title(),
        CheckVerdict::ok,
        "",
        "not strict (1) where the way to the camera's address is not the interface that it is at: its answers "
        "would be dropped, and it would never be found",
        {}};
    if (!no_route(camera, route).empty()) {
        const std::string ports = strict_ports(up.machine);
        if (ports.empty())
            return skipped(Check::rp_filter, no_route(camera, route) + "; no port that is up has a strict filter",
                           camera.title());
        finding.verdict = CheckVerdict::warn;
        finding.found = fmt::format("{}; strict on {}", no_route(camera, route), ports);
        finding.commands = loose_commands(ports.substr(0, ports.find(',')));
        return finding;
    }
    const int64_t filter = filter_of(up.machine, route->interface);
    finding.found = fmt::format("{} on {}, and {} is {}", filter, route->interface, camera.address,
                                route->is_direct ? "in its network" : "behind a router");
    if (filter == strict && !route->is_direct) {
        finding.verdict = CheckVerdict::warn;
        finding.commands = loose_commands(route->interface);
    }
    return finding;
}

Finding check_packet_socket(const CheckUp& up) {
    const auto cameras = gige_cameras(up);
    if (cameras.empty()) return skipped(Check::packet_socket, no_gige);
    const bool are_local = std::ranges::all_of(
        cameras, [&up](const CameraPlace& c) { return is_loopback(route_to(up.machine, c.address)); });
    if (are_local) return skipped(Check::packet_socket, "Aravis has none on the loopback");
    Finding finding{
        Check::packet_socket,
        "",
        CheckVerdict::ok,
        "this process has CAP_NET_RAW",
        "CAP_NET_RAW: Aravis then takes frames from the kernel's ring without a call and a copy for each packet; "
        "without it frames come by UDP, which costs more and loses packets sooner",
        {}};
    if (up.machine.has_capability(13 /* CAP_NET_RAW */)) return finding;
    finding.verdict = CheckVerdict::warn;
    finding.found = "this process has no CAP_NET_RAW";
    finding.commands = {
        "sudo setcap cap_net_raw+ep $(readlink -f $(command -v stagectl))    # again after each installation",
        "sudo systemctl edit stagectl    # the daemon: AmbientCapabilities=CAP_NET_RAW, and the other lines "
        "that the unit shows"};
    return finding;
}

}  // namespace

Findings check_network(const CheckUp& up) {
    Findings findings = {
        check_socket(up, Check::rmem_max, "rmem_max", "no program may ask for more"),
        check_socket(up, Check::rmem_default, "rmem_default", "until the first frame's first packet has come")};
    const auto cameras = gige_cameras(up);
    if (cameras.empty()) findings.push_back(skipped(Check::mtu, no_gige));
    for (const CameraPlace& camera : cameras) findings.push_back(check_mtu(up, camera));
    if (cameras.empty()) findings.push_back(skipped(Check::rp_filter, no_gige));
    for (const CameraPlace& camera : cameras) findings.push_back(check_filter(up, camera));
    findings.push_back(check_packet_socket(up));
    return findings;
}

}  // namespace ols
