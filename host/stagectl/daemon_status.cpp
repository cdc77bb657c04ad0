// SPDX-License-Identifier: MIT
// The present state in words, and what changes.
#include "stagectl/daemon_status.hpp"

#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/session.hpp"

namespace ols {

namespace {

void print_take(const nlohmann::json& take) {
    fmt::print("{}\n", take_line(take));
    for (const auto& output : take["outputs"])
        fmt::print("  {} of {} targets written, {} missing; {:.1f} s behind\n",
                   output["targets_written"].get<uint64_t>(), output["targets_planned"].get<uint64_t>(),
                   output["targets_missing"].get<uint64_t>(), output["seconds_behind"].get<double>());
}

void print_state(const nlohmann::json& state) {
    fmt::print("{}{}\n", state["state"].get<std::string>(),
               state["fault_is_latched"].get<bool>() ? " (until `stagectl status --clear-fault`)" : "");
    const auto line = [&](const char* label, const char* key) {
        if (const std::string text = state[key]; !text.empty()) fmt::print("{}: {}\n", label, text);
    };
    line("fault", "fault");
    line("waits for", "waits_for");
    line("devices", "devices");
    line("sequence", "sequence");
    if (!state["disk_bytes_free"].is_null())
        fmt::print("takes: {}, {:.1f} GB free\n", state["takes_folder"].get<std::string>(),
                   state["disk_bytes_free"].get<double>() * 1e-9);
    if (!state["take"].is_null()) print_take(state["take"]);
    if (const auto& last = state["last_take"]; last.is_object())
        fmt::print("last take: {}, {} targets written, {} missing\n", last["take"].get<std::string>(),
                   last["targets_written"].get<int>(), last["targets_missing"].get<int>());
}

Result<int> watch(DaemonClient& client, bool json) {
    const auto state = client.call("subscribe");
    if (!state.ok()) return state.error();
    if (json)
        print_json(*state, on_one_line);
    else
        print_state(*state);
    std::fflush(stdout);
    for (const StopRequest& stop = stop_on_signal(); !stop.wanted;) {
        const auto event = client.next_event(std::chrono::milliseconds(200));
        if (!event.ok()) return event.error();
        if (!*event) continue;
        if (json)
            print_json(**event, on_one_line);
        else if ((**event)["event"] == "take_progress")
            print_take((**event)["data"]);
        else
            fmt::print("{}\n", event_line(**event));
        std::fflush(stdout);
    }
    return 0;
}

}  // namespace

Result<int> daemon_status(const DaemonLink& link, const DaemonStatusOptions& options) {
    auto client = link.connect();
    if (!client.ok()) return client.error();
    if (options.clear_fault)
        if (const auto cleared = client->call("clear_fault"); !cleared.ok()) return cleared.error();
    if (options.watch) return watch(*client, options.json);
    if (options.metrics) {
        const auto metrics = client->call("metrics");
        if (!metrics.ok()) return metrics.error();
        fmt::print("{}", (*metrics)["text"].get<std::string>());
        return 0;
    }
    const auto version = client->call("version");
    if (!version.ok()) return version.error();
    auto state = client->call("status");
    if (!state.ok()) return state.error();
    (*state)["program"] = (*version)["program"];
    (*state)["api"] = (*version)["api"];
    if (options.json)
        print_json(*state);
    else
        print_state(*state);
    return (*state)["state"] == "fault" ? 1 : 0;
}

}  // namespace ols
