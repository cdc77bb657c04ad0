// SPDX-License-Identifier: MIT
// The disks of takes and of spilled frames: room, and speed against what the stage asks for.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "doctor/check_up.hpp"
#include "doctor/disk_speed.hpp"
#include "image/disk_room.hpp"

namespace ols {

namespace {

// What a folder is for.
struct Use {
    std::string folder;
    const char* option;
    const char* what;  // "archives"
    double write_bytes_per_s = 0;
    const char* when_slow;  // what happens then
    bool is_read = false;   // while takes are recorded
};

std::vector<Use> uses_of(const CheckUp& up) {
    return {{up.takes_folder, "--takes", "archives", up.needs.archive_bytes_per_s(),
             "developing waits for the disk, and frames wait in memory meanwhile: `disk_was_late` when that is full",
             false},
            {up.spill_folder, "--spill", "raw frames", up.needs.raw_bytes_per_s(),
             "a take that memory has no room for loses frames", true}};
}

Finding finding_of(const Use& use, Check check) {
    return {check, use.folder, CheckVerdict::ok, "", "", {}};
}

Finding check_room(const CheckUp& up, const Use& use) {
    if (use.folder.empty())
        return skipped(Check::disk_space, fmt::format("no folder: give {} FOLDER", use.option), use.what);
    Finding finding = finding_of(use, Check::disk_space);
    double needed = use.write_bytes_per_s * up.needs.take_s;
    finding.needed = fmt::format("{}: {} of a take of {:g} s, {}/s without compression", bytes_text(needed), use.what,
                                 up.needs.take_s, bytes_text(use.write_bytes_per_s));
    if (use.folder == up.stage.daemon.takes) {
        const double reserve = up.stage.daemon.reserve_mb * 1e6;
        needed += reserve;
        finding.needed += fmt::format(", and {} that the daemon keeps ([daemon] reserve_mb)", bytes_text(reserve));
    }
    const auto room = room_of(use.folder);
    if (!room.ok()) {
        finding.verdict = CheckVerdict::fail;
        finding.found = room.error().message;
        finding.commands = {fmt::format("sudo install -d -o {} '{}'", up.machine.user(), use.folder)};
        return finding;
    }
    finding.found = bytes_text(double(room->free_bytes)) + " free";
    if (double(room->free_bytes) < needed) {
        finding.verdict = CheckVerdict::fail;
        finding.commands = {fmt::format("du -sh '{}'/* | sort -h | tail    # the largest there", use.folder)};
    } else if (room->is_memory) {
        finding.verdict = CheckVerdict::warn;
        finding.found += ", in memory (tmpfs), not on a disk";
        finding.needed += "; what is in memory is gone when the machine goes, and is no longer free for frames";
        finding.commands = {"df -hT    # which folders are on disks"};
    }
    return finding;
}

// `take_s`: how long the take is that was to be written, or read, in as long.
Finding judge_speed(const Use& use, Check check, double bytes_per_s, double needed, double take_s,
                    const std::string& how) {
    Finding finding = finding_of(use, check);
    finding.found = fmt::format("{}/s {}", bytes_text(bytes_per_s), how);
    finding.needed = fmt::format("{}/s of {}", bytes_text(needed), use.what);
    if (bytes_per_s >= needed) return finding;
    finding.verdict = CheckVerdict::warn;
    finding.found += fmt::format(": a take of {:g} s takes {:.0f} s", take_s, std::ceil(take_s * needed / bytes_per_s));
    finding.needed += fmt::format("; slower, {}", use.when_slow);
    finding.commands = {
        fmt::format("findmnt -T '{}' && lsblk -d -o NAME,ROTA,TRAN,MODEL    # a faster one? else a lower "
                    "frame rate, fewer pixels, or shorter takes",
                    use.folder)};
    return finding;
}

Findings skip_speed(const std::string& why, const std::string& subject) {
    return {skipped(Check::disk_write, why, subject), skipped(Check::disk_read, why, subject)};
}

Findings check_speed(const CheckUp& up, const Use& use, double shared_bytes_per_s) {
    if (use.folder.empty()) return skip_speed(fmt::format("no folder: give {} FOLDER", use.option), use.what);
    if (up.is_quick) return skip_speed("not measured (--quick)", use.folder);
    const auto room = room_of(use.folder);
    if (!room.ok()) return skip_speed("there is no such folder", use.folder);
    if (room->is_memory) return skip_speed("in memory (tmpfs), not on a disk", use.folder);
    DiskSpeedOptions options;
    options.seconds_max = up.disk_s;
    options.is_read = use.is_read;
    if (!use.is_read)
        for (const CameraNeeds& camera : up.needs.cameras)
            if (camera.target_bytes > 0) options.synced_bytes = std::min(options.synced_bytes, camera.target_bytes);
    options.progress = [&up](uint64_t done, uint64_t total) { up.progress("measuring a disk", done, total); };
    const auto speed = measure_disk(use.folder, options);
    if (!speed.ok()) {
        Finding finding = finding_of(use, Check::disk_write);
        finding.verdict = CheckVerdict::fail;
        finding.found = speed.error().message;
        finding.needed = fmt::format("{} are written there", use.what);
        finding.commands = {fmt::format("ls -ld '{0}'; df '{0}'    # sudo chown {1} '{0}', or make room", use.folder,
                                        up.machine.user())};
        return {finding, skipped(Check::disk_read, "nothing could be written", use.folder)};
    }
    const std::string how =
        fmt::format("over {} in {:.1f} s, synced", bytes_text(double(speed->bytes)), speed->write_s);
    Findings findings = {judge_speed(use, Check::disk_write, speed->write_bytes_per_s,
                                     use.write_bytes_per_s + shared_bytes_per_s, up.needs.take_s, how)};
    if (!use.is_read)
        findings.push_back(skipped(Check::disk_read, "archives are not read while takes are recorded", use.folder));
    else if (!speed->read_bytes_per_s)
        findings.push_back(
            skipped(Check::disk_read, "this file system gives no way past the system's memory (O_DIRECT)", use.folder));
    else
        findings.push_back(judge_speed(use, Check::disk_read, *speed->read_bytes_per_s, use.write_bytes_per_s,
                                       up.needs.take_s, "past the system's memory"));
    return findings;
}

bool is_same_disk(const std::string& one, const std::string& other) {
    if (one.empty() || other.empty()) return false;
    const auto first = room_of(one), second = room_of(other);
    return first.ok() && second.ok() && first->device == second->device;
}

}  // namespace

Findings check_disks(const CheckUp& up) {
    const std::vector<Use> uses = uses_of(up);
    // One disk for both writes both at once.
    const bool is_shared = is_same_disk(up.takes_folder, up.spill_folder);
    Findings findings;
    for (const Use& use : uses) findings.push_back(check_room(up, use));
    for (size_t n = 0; n < uses.size(); ++n)
        for (Finding& finding : check_speed(up, uses[n], is_shared ? uses[1 - n].write_bytes_per_s : 0))
            findings.push_back(std::move(finding));
    return findings;
}

}  // namespace ols
