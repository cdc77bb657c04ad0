// SPDX-License-Identifier: MIT
// Events into lines and an exit code.
#include "stagectl/take_follower.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"

namespace ols {

namespace {

int exit_code_of(const nlohmann::json& take) {
    if (!take.value("write_error", "").empty()) return 1;
    const uint64_t missing = take.value("targets_missing", uint64_t(0)) + take.value("slots_left_out", uint64_t(0)) +
                             take.value("slots_missing_total", uint64_t(0));
    return missing > 0 ? 2 : 0;
}

}  // namespace

void TakeFollower::show(const nlohmann::json& progress) {
    if (!isatty(STDERR_FILENO)) return;
    uint64_t received = 0, missing = 0;
    double behind_s = 0;
    for (const auto& camera : progress["cameras"]) {
        received += camera["frames_received"].get<uint64_t>();
        for (const auto& [cause, count] : camera["slots_missing"].items()) missing += count.get<uint64_t>();
    }
    uint64_t written = 0;
    for (const auto& output : progress["outputs"]) {
        written += output["targets_written"].get<uint64_t>();
        behind_s = std::max(behind_s, output["seconds_behind"].get<double>());
    }
    fmt::print(stderr, "\r{}: {} of {} triggers, {} frames, {} slots missing, {} targets, {:.1f} s behind{}  ",
               progress["take"].get<std::string>(), progress["triggers_fired"].get<uint64_t>(),
               progress["triggers_planned"].get<uint64_t>(), received, missing, written, behind_s,
               progress["dark"].get<bool>() ? ", dark" : "");
}

std::optional<Result<int>> TakeFollower::take(const nlohmann::json& event) {
    const std::string kind = event["event"];
    if (kind == "take_progress") return show(event["data"]), std::nullopt;
    if (kind == "state_changed" || kind == "armed" || kind == "take_began") return std::nullopt;
    const bool is_end = kind == "take_finished" || kind == "calibration_finished";
    if (isatty(STDERR_FILENO)) fmt::print(stderr, "\r\033[K");
    if (kind == "take_failed" || kind == "calibration_failed")
        return Result<int>(fail(event["text"].get<std::string>()));
    if (!is_end) return say({event["text"].get<std::string>()}), std::nullopt;
    if (json_)
        print_json(event["data"]);
    else
        fmt::print("{}\n", event["text"].get<std::string>());
    return Result<int>(kind == "take_finished" ? exit_code_of(event["data"]) : 0);
}

Result<int> TakeFollower::follow(const StopRequest& stop) {
    for (bool told = false;;) {
        if (stop.wanted && !told) {
            told = true;
            if (const Status sent = client_.send("stop"); !sent.ok()) return sent.error();
        }
        const auto event = client_.next_event(std::chrono::milliseconds(100));
        if (!event.ok()) return event.error();
        if (!*event) continue;
        if (auto ended = take(**event)) return std::move(*ended);
    }
}

}  // namespace ols
