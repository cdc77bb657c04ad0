// SPDX-License-Identifier: MIT
// Memory: room for frames that wait, and whether they stay in it.
#include <fmt/format.h>

#include <algorithm>

#include "doctor/check_up.hpp"

namespace ols {

namespace {

Finding check_free(const CheckUp& up) {
    const auto free = up.machine.memory_bytes("MemAvailable");
    if (!free) return skipped(Check::memory_free, "the kernel does not say how much memory is free");
    const double raw = up.needs.raw_bytes_per_s(), least = up.needs.held_bytes();
    const double take = raw * up.needs.take_s;
    Finding finding{
        Check::memory_free,
        "",
        CheckVerdict::ok,
        bytes_text(double(*free)) + " free",
        fmt::format("{}: {} frames of each camera; {} for a take of {:g} s that is held in memory, at {}/s",
                    bytes_text(least), up.needs.frames_held, bytes_text(take), up.needs.take_s, bytes_text(raw)),
        {}};
    if (double(*free) < least) {
        finding.verdict = CheckVerdict::fail;
        finding.commands = {"ps --sort=-rss -eo rss,pid,comm | head    # who has it: end it, or fit more"};
    } else if (double(*free) < take) {
        finding.verdict = CheckVerdict::warn;
        finding.found += fmt::format(", {:.1f} s of frames", double(*free) / raw);
        finding.commands = {
            "ps --sort=-rss -eo rss,pid,comm | head    # who has it",
            "stagectl doctor --spill FOLDER    # can a disk take the frames that memory has no room for?"};
    }
    return finding;
}

uint64_t swap_bytes(const Machine& machine) {
    return machine.memory_bytes("SwapTotal").value_or(0);
}

Finding check_lock(const CheckUp& up) {
    const auto limit = up.machine.limit("Max locked memory");
    if (!limit) return skipped(Check::memory_lock, "the kernel does not say how much memory may be locked");
    const double needed = up.needs.held_bytes();
    Finding finding{Check::memory_lock,
                    "",
                    CheckVerdict::ok,
                    limit->soft == Limit::none ? "no limit" : bytes_text(double(limit->soft)) + " at most",
                    fmt::format("{}: {} frames of each camera that the kernel must not swap out", bytes_text(needed),
                                up.needs.frames_held),
                    {}};
    if (limit->soft == Limit::none || double(limit->soft) >= needed) return finding;
    if (up.machine.has_capability(14 /* CAP_IPC_LOCK */)) {
        finding.found += ", and CAP_IPC_LOCK, which lifts that";
        return finding;
    }
    if (swap_bytes(up.machine) == 0) {
        finding.found += ", and there is no swap that frames could go to";
        return finding;
    }
    finding.verdict = CheckVerdict::warn;
    finding.commands = {write_file_command("/etc/security/limits.d/stage-memory.conf",
                                           {fmt::format("{} - memlock unlimited", up.machine.user())}) +
                        "    # then log out and in again"};
    return finding;
}

Finding check_swap(const CheckUp& up) {
    const auto total = up.machine.memory_bytes("SwapTotal"), free = up.machine.memory_bytes("SwapFree");
    if (!total || !free) return skipped(Check::memory_swap, "the kernel does not say how much is swapped out");
    const uint64_t used = *total - std::min(*total, *free);
    Finding finding{
        Check::memory_swap,
        "",
        CheckVerdict::ok,
        *total == 0 ? "no swap" : fmt::format("{} of {} in use", bytes_text(double(used)), bytes_text(double(*total))),
        "none in use: what is swapped out comes back from a disk, at the moment at which a frame needs it",
        {}};
    if (used == 0) return finding;
    finding.verdict = CheckVerdict::warn;
    finding.commands = {
        write_file_command("/etc/sysctl.d/60-stage-swap.conf", {"vm.swappiness = 1"}) + " && sudo sysctl --system",
        "sudo swapoff -a && sudo swapon -a    # brings back what is out; needs as much free memory"};
    return finding;
}

}  // namespace

Findings check_memory(const CheckUp& up) {
    return {check_free(up), check_lock(up), check_swap(up)};
}

}  // namespace ols
