// SPDX-License-Identifier: MIT
// What the verbs that ask the daemon share.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "daemon/client.hpp"

namespace ols {

// --socket: where the daemon listens.
struct DaemonLink {
    std::string socket = default_socket();

    void add_to(CLI::App& verb);
    Result<DaemonClient> connect() const { return DaemonClient::connect(socket); }
};

// What a take is to be, where it is not as the daemon's configuration says.
struct TakeParams {
    std::optional<double> seconds, fps;
    std::optional<int> number;
    std::string slate, notes, quality;
    std::vector<std::string> also;
    bool memory_only = false;

    void add_to(CLI::App& verb, bool with_slate);
    nlohmann::json to_json() const;
};

// One call, its result printed by `print`. The verb's exit code.
template <typename Print>
Result<int> call_and_print(const DaemonLink& link, const std::string& method, const nlohmann::json& params,
                           const Print& print) {
    auto client = link.connect();
    if (!client.ok()) return client.error();
    const auto result = client->call(method, params);
    if (!result.ok()) return result.error();
    print(*result);
    return 0;
}

// A verb that is one call of the daemon without parameters of its own: --socket and --json.
struct CallVerb {
    const char *name, *purpose, *footer;
    void (*print)(const nlohmann::json& result);
};
void add_call_verb(CLI::App& app, int& exit_code, const CallVerb& verb);

// "12:00:01 warning 306 slots_missing: ..." of an event.
std::string event_line(const nlohmann::json& event);

// "12A_001: 700 of 1440 triggers, 698 frames, 2 slots missing, dark" of a take's progress, all cameras together.
std::string take_line(const nlohmann::json& progress);

}  // namespace ols
