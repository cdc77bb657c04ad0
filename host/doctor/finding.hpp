// SPDX-License-Identifier: MIT
// What a check of the machine found, what is needed and why, and what to type about it.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "image/bytes_text.hpp"

namespace ols {

// Every check there is. Each gives one finding at least, if only that it was skipped.
enum class Check {
    udev_rules,
    groups,
    nodes,
    rmem_max,
    rmem_default,
    mtu,
    rp_filter,
    packet_socket,
    disk_space,
    disk_write,
    disk_read,
    memory_free,
    memory_lock,
    memory_swap,
    governor,
    cores,
    open_files,
    clock_source,
    clock_synchronised,
    board_link,
    board_firmware,
    board_fault,
    camera_link,
    camera_setup,
    gpio_lines,
    can_interface,
    can_bit_rate,
    can_queue,
    can_isotp,
    count,
};

struct CheckName {
    std::string_view id, what;
};

// By Check, in the order in which they are made. docs/checking_the_machine.md explains each.
inline constexpr std::array<CheckName, size_t(Check::count)> check_names = {{
    {"permissions.udev_rules", "the udev rules of this release are installed"},
    {"permissions.groups", "this user is in the groups that own the stage's devices"},
    {"permissions.nodes", "each device node that the stage names may be opened"},
    {"network.rmem_max", "a GigE camera's socket may be as large as its rate needs"},
    {"network.rmem_default", "the same, before Aravis has enlarged it"},
    {"network.mtu", "the port of a GigE camera takes jumbo frames"},
    {"network.rp_filter", "the kernel does not drop what a GigE camera answers"},
    {"network.packet_socket", "Aravis may use its packet socket"},
    {"disk.space", "takes and spilled frames have room"},
    {"disk.write", "disks write as fast as archives and raw frames come (measured)"},
    {"disk.read", "disks read raw frames back as fast (measured)"},
    {"memory.free", "memory holds the frames that wait"},
    {"memory.lock", "frames in memory may be locked there"},
    {"memory.swap", "nothing is swapped out"},
    {"processor.governor", "the processor's clock does not go down between frames"},
    {"processor.cores", "each camera's reader has a core"},
    {"limits.files", "enough files may be open"},
    {"clock.source", "the kernel's clock is quick to read"},
    {"clock.synchronised", "the wall's clock is right, for the dates of takes"},
    {"board.link", "the board answers"},
    {"board.firmware", "the board's firmware is this release's"},
    {"board.fault", "no fault is latched, and nothing plays"},
    {"camera.link", "each camera is there and can be opened"},
    {"camera.setup", "each camera takes what the stage asks of it"},
    {"gpio.lines", "the capture PC's own lines are there and free"},
    {"can.interface", "the CAN interface is up"},
    {"can.bit_rate", "it has the board's bit rate"},
    {"can.queue", "its queue holds a message"},
    {"can.isotp", "the kernel has ISO-TP"},
}};

enum class CheckVerdict { ok, warn, fail, skipped };
inline constexpr std::array<std::string_view, 4> verdict_names = {"ok", "warn", "fail", "skipped"};

struct Finding {
    Check check = Check::count;
    std::string subject;  // which camera, folder, interface; empty where there is one thing to look at
    CheckVerdict verdict = CheckVerdict::skipped;
    std::string found;                  // with figure and unit; of a skipped check, why it was
    std::string needed;                 // what is needed, and why; empty for a skipped check
    std::vector<std::string> commands;  // what to type where it is not ok, a line each

    std::string_view id() const { return check_names[size_t(check)].id; }
};

using Findings = std::vector<Finding>;

// What could not be determined is no "ok".
Finding skipped(Check check, std::string why, std::string subject = "");

// 0: all is well; 2: warnings; 1: something that keeps a shoot from going well.
int exit_code_of(const Findings& findings);
size_t count_of(const Findings& findings, CheckVerdict verdict);

// A file of settings that lasts: the line that writes it, for a shell.
std::string write_file_command(const std::string& path, const std::vector<std::string>& lines);

}  // namespace ols
