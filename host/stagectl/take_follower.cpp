// SPDX-License-Identifier: MIT
// Events into lines and an exit code.
#include "stagectl/take_follower.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <utility>

#include "program.hpp"
#include "stagectl/session.hpp"

namespace ols {

namespace {

// The first archive's account is the take's; the others' stand beside it.
int exit_code_of(const nlohmann::json& take) {
    auto archives = take.value("also", nlohmann::json::array());
    archives.push_back(take);
    uint64_t missing = take.value("slots_missing_total", uint64_t(0));
    bool is_written = take.value("/memory/problem"_json_pointer, "").empty();
    for (const nlohmann::json& archive : archives) {
        missing += archive.value("targets_missing", uint64_t(0)) + archive.value("slots_left_out", uint64_t(0));
        is_written = is_written && archive.value("write_error", "").empty();
    }
    return !is_written ? 1 : missing > 0 ? 2 : 0;
}

}  // namespace

void TakeFollower::show(const nlohmann::json& progress) {
    if (!isatty(STDERR_FILENO)) return;
    uint64_t written = 0;
    double behind_s = 0;
    for (const auto& output : progress["outputs"]) {
        written += output["targets_written"].get<uint64_t>();
        behind_s = std::max(behind_s, output["seconds_behind"].get<double>());
    }
    fmt::print(stderr, "\r{}, {} targets, {:.1f} s behind  ", take_line(progress), written, behind_s);
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
    if (const std::string fault = event["data"].value("fault", ""); !fault.empty())
        say({"the stage is in state fault: " + fault + ": `stagectl status --clear-fault` when the cause is gone"});
    return Result<int>(kind == "take_finished" ? exit_code_of(event["data"]) : 0);
}

// Others may ask for takes, too: their ends are not this one's.
bool TakeFollower::is_mine(const nlohmann::json& event) const {
    const std::string kind = event["event"];
    if (kind.starts_with("calibration_")) return name_.empty();
    if (kind != "take_finished" && kind != "take_failed") return true;
    return !name_.empty() && event["data"].value("take", "") == name_;
}

void TakeFollower::stop_if_wanted(const StopRequest& stop) {
    if (!stop.wanted || std::exchange(told_to_stop_, true)) return;
    if (auto other = link_.connect(); other.ok()) (void)other->call("stop");  // how it went is told by events
}

Result<nlohmann::json> TakeFollower::begin(const std::string& method, const nlohmann::json& params,
                                           const StopRequest& stop) {
    if (const auto subscribed = client_.call("subscribe"); !subscribed.ok()) return subscribed;
    if (const Status sent = client_.send(method, params); !sent.ok()) return sent.error();
    for (;;) {
        stop_if_wanted(stop);
        auto answered = client_.answer(std::chrono::milliseconds(100));
        if (!answered) continue;
        if (answered->ok()) name_ = (*answered)->value("take", "");
        return std::move(*answered);
    }
}

Result<int> TakeFollower::follow(const StopRequest& stop) {
    for (;;) {
        stop_if_wanted(stop);
        const auto event = client_.next_event(std::chrono::milliseconds(100));
        if (!event.ok()) return event.error();
        if (!*event || !is_mine(**event)) continue;
        if (auto ended = take(**event)) return std::move(*ended);
    }
}

}  // namespace ols
