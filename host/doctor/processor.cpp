// SPDX-License-Identifier: MIT
// The processor: its clock's governor and its cores; and how many files a process may have open.
#include <fmt/format.h>

#include <map>

#include "doctor/check_up.hpp"

namespace ols {

namespace {

std::string cores_text(int cores) {
    return fmt::format("{} core{}", cores, cores == 1 ? "" : "s");
}

Finding check_governor(const Machine& machine) {
    std::map<std::string, int> cores_of;
    for (const std::string& name : machine.list("/sys/devices/system/cpu"))
        if (const auto governor = machine.read("/sys/devices/system/cpu/" + name + "/cpufreq/scaling_governor"))
            ++cores_of[*governor];
    if (cores_of.empty())
        return skipped(Check::governor,
                       "the kernel has no governor here: the firmware, or a virtual machine's host, "
                       "rules the processor's clock");
    std::string found;
    for (const auto& [governor, cores] : cores_of)
        found += fmt::format("{}{} on {}", found.empty() ? "" : ", ", governor, cores_text(cores));
    Finding finding{
        Check::governor,
        "",
        CheckVerdict::ok,
        found,
        "performance: at 2160 frames/s a core rests some 0.4 ms between frames, and one that was clocked down "
        "meanwhile is late for the next",
        {}};
    if (cores_of.size() == 1 && cores_of.contains("performance")) return finding;
    finding.verdict = CheckVerdict::warn;
    const std::string file = "/etc/tmpfiles.d/stage-governor.conf";
    finding.commands = {
        write_file_command(file, {"w- /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor - - - - performance"}),
        "sudo systemd-tmpfiles --create " + file};
    return finding;
}

// "0-3,8": how many.
int cores_in(const std::string& ranges) {
    int cores = 0, first = 0, last = 0;
    for (size_t at = 0; at < ranges.size();) {
        const size_t end = std::min(ranges.find(',', at), ranges.size());
        const std::string range = ranges.substr(at, end - at);
        const int read = std::sscanf(range.c_str(), "%d-%d", &first, &last);
        if (read < 1) return 0;
        cores += read == 2 ? last - first + 1 : 1;
        at = end + 1;
    }
    return cores;
}

Finding check_cores(const CheckUp& up) {
    // Those that this process may use: a service or a container may have fewer than the machine.
    const int cores = cores_in(up.machine.process_status("Cpus_allowed_list").value_or(""));
    if (cores == 0) return skipped(Check::cores, "the kernel does not say which cores this process may use");
    const int needed = int(up.cameras.size()) + 1;
    Finding finding{
        Check::cores,
        "",
        CheckVerdict::ok,
        cores_text(cores),
        fmt::format("{}: a reader for each camera and one for developing; more make developing faster", needed),
        {}};
    if (cores >= needed) return finding;
    finding.verdict = CheckVerdict::warn;
    finding.commands = {"lscpu    # fewer than the machine has? see CPUAffinity= and `taskset -p $$`"};
    return finding;
}

// Aravis, libusb and the archive keep a handful each open; the page's clients one each.
constexpr uint64_t files_apart = 256, files_a_camera = 64;

Finding check_files(const CheckUp& up) {
    const auto limit = up.machine.limit("Max open files");
    if (!limit) return skipped(Check::open_files, "the kernel does not say how many files may be open");
    const uint64_t needed = files_apart + files_a_camera * up.cameras.size();
    Finding finding{Check::open_files,
                    "",
                    CheckVerdict::ok,
                    limit->soft == Limit::none ? "no limit" : fmt::format("{} files", limit->soft),
                    fmt::format("{}: {} for each camera and {} for the rest", needed, files_a_camera, files_apart),
                    {}};
    if (limit->soft >= needed) return finding;
    finding.verdict = CheckVerdict::fail;
    finding.commands = {write_file_command("/etc/security/limits.d/stage.conf",
                                           {fmt::format("{} - nofile {}", up.machine.user(), 4 * needed)}) +
                        "    # then log out and in again"};
    return finding;
}

}  // namespace

Findings check_processor(const CheckUp& up) {
    return {check_governor(up.machine), check_cores(up), check_files(up)};
}

}  // namespace ols
