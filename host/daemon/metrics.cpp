// SPDX-License-Identifier: MIT
// Names, labels and values.
#include "daemon/metrics.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "image/disk_room.hpp"

namespace ols {

namespace {

// A label's value, escaped as the format asks for.
std::string label_text(const std::string& text) {
    std::string escaped;
    for (const char c : text) {
        if (c == '\\' || c == '"') escaped += '\\';
        escaped += c == '\n' ? std::string("\\n") : std::string(1, c);
    }
    return escaped;
}

class Page {
  public:
    void family(const char* name, const char* type, const char* help) {
        name_ = name;
        text_ += fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", name, help, type);
    }
    void value(double value, const std::string& labels = "") {
        text_ += fmt::format("{}{} {}\n", name_, labels.empty() ? "" : "{" + labels + "}", value);
    }
    void value(uint64_t value, const std::string& labels = "") {
        text_ += fmt::format("{}{} {}\n", name_, labels.empty() ? "" : "{" + labels + "}", value);
    }
    std::string text() && { return std::move(text_); }

  private:
    const char* name_ = "";
    std::string text_;
};

void add_takes(Page& page, const TakeTotals& totals) {
    page.family("stagectl_camera_frames_received_total", "counter", "Frames that came from a camera.");
    for (const auto& [camera, one] : totals.cameras) page.value(one.frames, fmt::format("camera=\"{}\"", camera));
    page.family("stagectl_camera_slots_missing_total", "counter", "Slots without a frame, by cause.");
    for (const auto& [camera, one] : totals.cameras)
        for (size_t cause = 1; cause < cause_count; ++cause)
            page.value(one.missing.of(Cause(cause)),
                       fmt::format("camera=\"{}\",cause=\"{}\"", camera, cause_name(Cause(cause))));
    page.family("stagectl_triggers_fired_total", "counter", "Triggers that the board fired.");
    page.value(totals.triggers);
    page.family("stagectl_targets_written_total", "counter", "Targets in archives.");
    page.value(totals.targets_written);
    page.family("stagectl_targets_missing_total", "counter", "Targets that could not be made or written.");
    page.value(totals.targets_missing);
}

void add_running(Page& page, const Snapshot& now) {
    TakeProgress progress;
    if (now.take) progress = now.take->monitor.progress();
    RoomUse room;
    double behind_s = 0;
    for (const CameraProgress& camera : progress.record.cameras) {
        room.frames_in_memory += camera.room.frames_in_memory, room.bytes_in_memory += camera.room.bytes_in_memory;
        room.bytes_on_disk += camera.room.bytes_on_disk;
    }
    for (const OutputProgress& output : progress.outputs) behind_s = std::max(behind_s, output.seconds_behind());
    page.family("stagectl_frames_in_memory", "gauge", "Frames that wait for developing in memory.");
    page.value(room.frames_in_memory);
    page.family("stagectl_frames_in_memory_bytes", "gauge", "Their samples.");
    page.value(room.bytes_in_memory);
    page.family("stagectl_frames_spilled_bytes", "gauge", "Samples of frames that wait for developing on a disk.");
    page.value(room.bytes_on_disk);
    page.family("stagectl_behind_seconds", "gauge", "Recorded, and not developed yet.");
    page.value(behind_s);
}

// What every program has, by the names that Prometheus' own clients give.
void add_process(Page& page) {
    page.family("process_resident_memory_bytes", "gauge", "Resident memory size in bytes.");
    uint64_t total_pages = 0, resident_pages = 0;
    std::ifstream("/proc/self/statm") >> total_pages >> resident_pages;
    page.value(resident_pages * uint64_t(sysconf(_SC_PAGESIZE)));
    page.family("process_open_fds", "gauge", "Number of open file descriptors.");
    std::error_code error;
    page.value(uint64_t(std::distance(std::filesystem::directory_iterator("/proc/self/fd", error), {})));
    page.family("process_threads", "gauge", "Number of threads.");
    page.value(uint64_t(std::distance(std::filesystem::directory_iterator("/proc/self/task", error), {})));
}

}  // namespace

std::string metrics_text(const Snapshot& now, const DaemonSetup& setup, const EventLog& events,
                         const std::string& program_version) {
    Page page;
    page.family("stagectl_build_info", "gauge", "The program's version; always 1.");
    page.value(uint64_t(1), fmt::format("version=\"{}\"", label_text(program_version)));
    page.family("stagectl_state", "gauge", "1 for the state that the stage is in.");
    for (size_t state = 0; state < daemon_state_count; ++state)
        page.value(uint64_t(now.state == DaemonState(state)),
                   fmt::format("state=\"{}\"", state_name(DaemonState(state))));
    page.family("stagectl_events_total", "counter", "Events by their kind.");
    auto counts = events.counts();
    for (const EventKindFacts& kind :
         event_kinds())  // also those that have not come: a rate needs the nought before the first
        page.value(uint64_t(counts[kind.kind]), fmt::format("event=\"{}\"", kind.name));
    TakeTotals totals = now.totals;
    if (now.take) totals.add(now.take->monitor.progress());
    add_takes(page, totals);
    add_running(page, now);
    if (const auto disk = room_of(setup.takes)) {
        page.family("stagectl_takes_disk_free_bytes", "gauge", "Free for takes, the reserve included.");
        page.value(disk->free_bytes);
    }
    add_process(page);
    return std::move(page).text();
}

}  // namespace ols
