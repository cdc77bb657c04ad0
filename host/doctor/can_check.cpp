// SPDX-License-Identifier: MIT
// CAN interfaces of the board and of the lamp nodes (Linux, Documentation/networking/can.rst).
#include <fmt/format.h>
#include <net/if.h>
#include <net/if_arp.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include "doctor/check_up.hpp"

namespace ols {

namespace {

constexpr uint32_t bit_rate_hz = 1'000'000;      // protocol/PROTOCOL.md, "CAN"
constexpr uint32_t other_bit_rate_hz = 500'000;  // of a firmware built for it
// The longest message is OLS_PAYLOAD_BYTES_MAX and its frame's head, and ISO-TP sends 7 bytes a CAN frame.
constexpr int64_t frames_a_message = (OLS_PAYLOAD_BYTES_MAX + 64) / 7;

std::set<std::string> interfaces_of(const CheckUp& up) {
    std::set<std::string> names;
    for (const std::string& link : {up.board_link, up.stage.telemetry.bus})
        if (link.starts_with("can:"))
            names.insert(link.substr(4, link.find('#') - std::min<size_t>(4, link.find('#'))));
    return names;
}

std::string up_command(const std::string& name) {
    return fmt::format("sudo ip link set {} down; sudo ip link set {} up type can bitrate {}", name, name, bit_rate_hz);
}

// As systemd-networkd brings it up at each start (systemd.network(5), "[CAN]").
std::string lasting_command(const std::string& name) {
    return write_file_command(fmt::format("/etc/systemd/network/80-{}.network", name),
                              {"[Match]", "Name=" + name, "[CAN]", "BitRate=1M"}) +
           " && sudo systemctl enable --now systemd-networkd";
}

bool is_can(const Machine& machine, const std::string& name) {
    return machine.read_number("/sys/class/net/" + name + "/type") == ARPHRD_CAN;
}

Finding check_interface(const Machine& machine, const std::string& name, const std::optional<LinkDetails>& details) {
    const std::string folder = "/sys/class/net/" + name;
    Finding finding{Check::can_interface, name, CheckVerdict::fail, "", "a CAN interface that is up", {}};
    if (!machine.exists(folder)) {
        finding.found = "there is no such interface";
        finding.commands = {"ip link show type can    # which there are; none: is the adapter in, its module loaded?"};
        return finding;
    }
    if (!is_can(machine, name)) {
        finding.found = "it is no CAN interface";
        finding.commands = {"ip link show type can    # which are"};
        return finding;
    }
    const auto flags = std::strtoul(machine.read(folder + "/flags").value_or("0").c_str(), nullptr, 16);
    if (!(flags & IFF_UP)) {
        finding.found = "it is down";
        finding.commands = {up_command(name), lasting_command(name)};
        return finding;
    }
    if (details && details->is_bus_off) {
        finding.found = "bus off: too many errors";
        finding.commands = {
            fmt::format("ip -details -statistics link show {}    # 120 ohm at both ends, one bit rate?", name),
            up_command(name)};
        return finding;
    }
    finding.verdict = CheckVerdict::ok;
    finding.found = "up";
    return finding;
}

Finding check_bit_rate(const std::string& name, const std::optional<LinkDetails>& details) {
    if (!details) return skipped(Check::can_bit_rate, "the kernel does not say", name);
    if (details->kind != "can")
        return skipped(Check::can_bit_rate, fmt::format("an interface of kind '{}' has none", details->kind), name);
    Finding finding{Check::can_bit_rate,
                    name,
                    CheckVerdict::ok,
                    fmt::format("{} bit/s", details->can_bit_rate_hz),
                    fmt::format("{} bit/s, as the boards have it, or {} with a firmware built for that", bit_rate_hz,
                                other_bit_rate_hz),
                    {}};
    if (details->can_bit_rate_hz == bit_rate_hz) return finding;
    finding.verdict = details->can_bit_rate_hz == other_bit_rate_hz ? CheckVerdict::warn : CheckVerdict::fail;
    finding.commands = {up_command(name), lasting_command(name)};
    return finding;
}

Finding check_queue(const Machine& machine, const std::string& name) {
    const auto length = machine.read_number("/sys/class/net/" + name + "/tx_queue_len");
    if (!length) return skipped(Check::can_queue, "the kernel does not say", name);
    Finding finding{Check::can_queue,
                    name,
                    CheckVerdict::ok,
                    fmt::format("{} frames", *length),
                    fmt::format("{}: the frames of one message; with fewer, sending waits and tries again in between",
                                frames_a_message),
                    {}};
    if (*length >= frames_a_message) return finding;
    finding.verdict = CheckVerdict::warn;
    finding.commands = {
        fmt::format("sudo ip link set {} txqueuelen 1000", name),
        fmt::format(
            "echo 'SUBSYSTEM==\"net\", ACTION==\"add\", KERNEL==\"{0}\", ATTR{{tx_queue_len}}=\"1000\"' | sudo tee "
            "/etc/udev/rules.d/80-{0}-queue.rules    # for the next start",
            name)};
    return finding;
}

// The module is there already, built in, or loaded by the first socket that asks for it.
Finding check_isotp(const Machine& machine) {
    Finding finding{Check::can_isotp,
                    "",
                    CheckVerdict::ok,
                    "",
                    "the kernel's ISO-TP answers a board also while stagectl does not run; "
                    "without it stagectl uses its own, which a busy machine delays",
                    {}};
    const std::string release = machine.read("/proc/sys/kernel/osrelease").value_or("");
    const auto names = [&](const char* file) {
        return machine.read("/lib/modules/" + release + "/" + file).value_or("").find("/can-isotp.ko") !=
               std::string::npos;
    };
    if (machine.exists("/sys/module/can_isotp"))
        finding.found = "loaded";
    else if (names("modules.builtin"))
        finding.found = "built into the kernel";
    else if (names("modules.dep"))
        finding.found = "a module that is loaded when it is asked for";
    if (!finding.found.empty()) return finding;
    finding.verdict = CheckVerdict::warn;
    finding.found = fmt::format("no module can_isotp for the kernel {}", release);
    finding.commands = {"sudo apt install linux-image-amd64 && sudo reboot    # Debian's kernel has it, from 5.10 on"};
    return finding;
}

}  // namespace

Findings check_can(const CheckUp& up) {
    const auto names = interfaces_of(up);
    const std::string none = "the stage names no CAN interface";
    Findings findings;
    for (const std::string& name : names) {
        const auto details = up.machine.link_details(name);
        findings.push_back(check_interface(up.machine, name, details));
        if (is_can(up.machine, name)) {
            findings.push_back(check_bit_rate(name, details));
            findings.push_back(check_queue(up.machine, name));
        } else {
            findings.push_back(skipped(Check::can_bit_rate, "there is no such CAN interface", name));
            findings.push_back(skipped(Check::can_queue, "there is no such CAN interface", name));
        }
    }
    if (names.empty())
        for (const Check check : {Check::can_interface, Check::can_bit_rate, Check::can_queue})
            findings.push_back(skipped(check, none));
    findings.push_back(up.board_link.starts_with("can:") ? check_isotp(up.machine)
                                                         : skipped(Check::can_isotp, "the board is not on CAN"));
    return findings;
}

}  // namespace ols
