// SPDX-License-Identifier: MIT
// The names of causes.
#include "record/cause.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <vector>

namespace ols {

const char* cause_name(Cause cause) {
    switch (cause) {
        case Cause::none: return "none";
        case Cause::board_did_not_fire: return "board_did_not_fire";
        case Cause::camera_missed_trigger: return "camera_missed_trigger";
        case Cause::link_lost_it: return "link_lost_it";
        case Cause::host_was_late: return "host_was_late";
        case Cause::disk_was_late: return "disk_was_late";
        case Cause::no_light: return "no_light";
        case Cause::stale: return "stale";
        case Cause::swapped: return "swapped";
        case Cause::wrong_size: return "wrong_size";
        case Cause::restarted: return "restarted";
        case Cause::not_proved: return "not_proved";
        case Cause::no_frame: return "no_frame";
        case Cause::log_lost_it: return "log_lost_it";
        case Cause::camera_gone: return "camera_gone";
        case Cause::board_gone: return "board_gone";
        case Cause::stopped: return "stopped";
    }
    return "";
}

std::string cause_words(Cause cause) {
    std::string words = cause_name(cause);
    std::ranges::replace(words, '_', ' ');
    return words;
}

uint64_t CauseCounts::total() const {
    return std::accumulate(counts_.begin(), counts_.end(), uint64_t(0));
}

nlohmann::json CauseCounts::to_json() const {
    auto json = nlohmann::json::object();
    for (size_t i = 0; i < cause_count; ++i)
        if (counts_[i] > 0) json[cause_name(Cause(i))] = counts_[i];
    return json;
}

std::string CauseCounts::to_words() const {
    std::vector<size_t> order(cause_count);
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, std::greater(), [this](size_t i) { return counts_[i]; });
    std::string words;
    for (const size_t i : order)
        if (counts_[i] > 0)
            words += fmt::format("{}{} {}", words.empty() ? "" : ", ", counts_[i], cause_words(Cause(i)));
    return words;
}

}  // namespace ols
