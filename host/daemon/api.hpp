// SPDX-License-Identifier: MIT
// API: the daemon's methods (states.hpp) as calls of JSON-RPC, the same over every link.
#pragma once

#include <memory>
#include <string>

#include "daemon/conductor.hpp"
#include "daemon/json_rpc.hpp"

namespace ols {

// Rises with what is added; the first number with what no longer works as before.
constexpr const char* api_version = "1.0";

class Api {
  public:
    // References outlive it. `program_version`: "stagectl 0.1.0 (...)".
    Api(Conductor& conductor, EventLog& events, std::string program_version);

    // `caller`: who calls, for the log. All methods but `subscribe`, which is the link's.
    RpcOutcome call(const std::string& method, const nlohmann::json& params, const std::string& caller);

    // The present state, whole: what `status` returns and a subscriber gets first. Every event up to its "event_number" is in it.
    nlohmann::json present_state() const;
    nlohmann::json version() const;
    std::string metrics() const;

  private:
    RpcOutcome call_now(const std::string& method, class JsonObject& params, const std::string& caller);

    Conductor& conductor_;
    EventLog& events_;
    const std::string program_version_;
};

}  // namespace ols
