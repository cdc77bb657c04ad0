// SPDX-License-Identifier: MIT
// Follows what the daemon was asked to do by its events, to the end.
#pragma once

#include "daemon/client.hpp"
#include "record/stop_request.hpp"

namespace ols {

class TakeFollower {
  public:
    // `client` has subscribed, or will have before follow(). With `json` the end's data are printed, and nothing else on standard output.
    TakeFollower(DaemonClient& client, bool json) : client_(client), json_(json) {}

    // Until a take or a calibration has ended: the exit code, or the daemon's reason as an error. When `stop` is wanted the daemon is
    // told to stop, and the end is still awaited.
    Result<int> follow(const StopRequest& stop);

  private:
    std::optional<Result<int>> take(const nlohmann::json& event);
    void show(const nlohmann::json& progress);

    DaemonClient& client_;
    const bool json_;
};

}  // namespace ols
