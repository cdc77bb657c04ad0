// SPDX-License-Identifier: MIT
// Permissions: the udev rules as this release has them, the groups that own devices, and the nodes themselves.
#include <fmt/format.h>

#include <algorithm>

#include "device/usb_board.hpp"
#include "doctor/check_up.hpp"
#include "doctor/shipped.hpp"

namespace ols {

namespace {

constexpr const char* rules_name = "60-open-light-stage.rules";
// In the order in which udev takes them: a file hides those of its name in later folders (udev(7)).
constexpr const char* rules_folders[] = {"/etc/udev/rules.d", "/run/udev/rules.d", "/usr/local/lib/udev/rules.d",
                                         "/usr/lib/udev/rules.d", "/lib/udev/rules.d"};
constexpr const char* load_rules = "sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=usb";

bool has_usb(const CheckUp& up) {
    return up.board_link.starts_with("usb:") || std::ranges::any_of(up.cameras, &CameraPlace::may_be_usb3);
}

// What a rule does, without comments and empty lines: those may be someone's own.
std::vector<std::string> rules_in(const std::string& text) {
    std::vector<std::string> rules;
    for (const std::string& line : lines_in(text))
        if (!line.empty() && line[0] != '#') rules.push_back(line);
    return rules;
}

Finding check_rules(const CheckUp& up) {
    if (!has_usb(up)) return skipped(Check::udev_rules, "the stage names no device on USB");
    Finding finding{
        Check::udev_rules,
        "",
        CheckVerdict::ok,
        "",
        "the rules that this release brings: without them only root may open boards and USB3 cameras",
        {fmt::format("sudo install -m 644 host/device/{} /etc/udev/rules.d/    # in the source folder", rules_name),
         load_rules}};
    for (const char* folder : rules_folders) {
        const std::string path = fmt::format("{}/{}", folder, rules_name);
        const auto text = up.machine.read(path);
        if (!text) continue;
        finding.found = path;
        if (rules_in(*text) == rules_in(shipped_rules)) return finding;
        finding.verdict = CheckVerdict::warn;
        finding.found += " has other rules than this release";
        return finding;
    }
    finding.verdict = CheckVerdict::fail;
    finding.found = fmt::format("no {} in any folder of udev's", rules_name);
    return finding;
}

// Groups by what the rules and Debian's own give devices to, and the device that asks for each.
std::vector<std::pair<std::string, std::string>> groups_needed(const CheckUp& up) {
    std::vector<std::pair<std::string, std::string>> needed;
    if (has_usb(up)) needed.emplace_back("plugdev", "boards and cameras on USB");
    if (std::ranges::any_of(up.cameras, [](const CameraPlace& c) { return c.kind == CameraPlace::v4l2; }))
        needed.emplace_back("video", "/dev/video*");
    return needed;
}

Finding check_group(const Machine& machine, const std::string& group, const std::string& what) {
    Finding finding{Check::groups, group, CheckVerdict::ok, "", fmt::format("owns {}", what), {}};
    if (machine.groups().contains(group)) {
        finding.found = fmt::format("{} is in it", machine.user());
        return finding;
    }
    finding.verdict = CheckVerdict::warn;
    finding.needed +=
        "; who sits at the machine may do without where udev gives devices to seats (uaccess), a service "
        "or a login from afar may not";
    if (machine.is_member(machine.user(), group)) {
        finding.found = fmt::format("{} is in it, but not yet in this login", machine.user());
        finding.commands = {fmt::format("newgrp {}    # or log out and in again", group)};
        return finding;
    }
    finding.found = fmt::format("{} is not in it", machine.user());
    finding.commands = {fmt::format("sudo usermod -aG {} {}    # then log out and in again", group, machine.user())};
    return finding;
}

Findings check_groups(const CheckUp& up) {
    const auto needed = groups_needed(up);
    if (needed.empty()) return {skipped(Check::groups, "the stage names no device that a group owns")};
    if (up.machine.is_root())
        return {skipped(Check::groups, "root may open everything: run doctor as the user who records")};
    Findings findings;
    for (const auto& [group, what] : needed) findings.push_back(check_group(up.machine, group, what));
    return findings;
}

struct Node {
    std::string path, what;
    std::string look;  // a command that shows which there are
};

// The node of a device of sysfs: /dev/bus/usb/001/004.
std::string usb_node(const Machine& machine, const std::string& folder) {
    return fmt::format("/dev/bus/usb/{:03}/{:03}", machine.read_number(folder + "/busnum").value_or(0),
                       machine.read_number(folder + "/devnum").value_or(0));
}

bool is_usb3_camera(const Machine& machine, const std::string& device, const std::vector<std::string>& all) {
    return std::ranges::any_of(all, [&](const std::string& name) {
        const std::string folder = "/sys/bus/usb/devices/" + name;
        return name.starts_with(device + ":") && machine.read(folder + "/bInterfaceClass") == "ef" &&
               machine.read(folder + "/bInterfaceSubClass") == "05" &&
               machine.read(folder + "/bInterfaceProtocol") == "00";
    });
}

std::vector<Node> usb_nodes(const CheckUp& up) {
    std::vector<Node> nodes;
    const Machine& machine = up.machine;
    const auto all = machine.list("/sys/bus/usb/devices");
    for (const std::string& name : all) {
        const std::string folder = "/sys/bus/usb/devices/" + name;
        const auto vendor = machine.read(folder + "/idVendor"), product = machine.read(folder + "/idProduct");
        const bool is_board = vendor == fmt::format("{:04x}", board_usb_vendor) &&
                              product == fmt::format("{:04x}", board_usb_product) &&
                              machine.read(folder + "/product") == board_usb_name;
        if (is_board && up.board_link.starts_with("usb:"))
            nodes.push_back({usb_node(machine, folder), "the board", "lsusb"});
        if (std::ranges::any_of(up.cameras, &CameraPlace::may_be_usb3) && is_usb3_camera(machine, name, all))
            nodes.push_back({usb_node(machine, folder), "a USB3 Vision camera", "lsusb"});
    }
    return nodes;
}

std::vector<Node> nodes_named(const CheckUp& up) {
    std::vector<Node> nodes = usb_nodes(up);
    for (const CameraPlace& camera : up.cameras)
        if (camera.kind == CameraPlace::v4l2)
            nodes.push_back({camera.name.starts_with('/') ? camera.name : "/dev/video" + camera.name, camera.title(),
                             "v4l2-ctl --list-devices"});
    if (!up.stage.gpio.has_lines()) return nodes;
    const std::string& chip = up.stage.gpio.chip;
    const bool is_number = !chip.empty() && std::ranges::all_of(chip, [](char c) { return c >= '0' && c <= '9'; });
    const std::string path = chip.starts_with('/') ? chip : (is_number ? "/dev/gpiochip" : "/dev/") + chip;
    if (up.machine.exists(path)) nodes.push_back({path, "[gpio]", "gpiodetect"});  // a label is looked up by gpio.lines
    return nodes;
}

Finding check_node(const Machine& machine, const Node& node) {
    Finding finding{Check::nodes,
                    node.path,
                    CheckVerdict::ok,
                    "may be read and written",
                    fmt::format("{} is opened to read and write", node.what),
                    {}};
    if (!machine.exists(node.path)) {
        finding.verdict = CheckVerdict::fail;
        finding.found = "there is no such node";
        finding.commands = {node.look + "    # which there are"};
    } else if (!machine.may_open(node.path)) {
        finding.verdict = CheckVerdict::fail;
        finding.found = fmt::format("{} may not open it", machine.user());
        finding.commands = {fmt::format("ls -l {}    # the group that owns it", node.path),
                            fmt::format("sudo usermod -aG $(stat -c %G {}) {}    # then log out and in again",
                                        node.path, machine.user())};
    }
    return finding;
}

}  // namespace

Findings check_permissions(const CheckUp& up) {
    Findings findings = {check_rules(up)};
    for (Finding& finding : check_groups(up)) findings.push_back(std::move(finding));
    const auto nodes = nodes_named(up);
    if (nodes.empty()) findings.push_back(skipped(Check::nodes, "the stage names no device node that is there"));
    for (const Node& node : nodes) findings.push_back(check_node(up.machine, node));
    return findings;
}

}  // namespace ols
