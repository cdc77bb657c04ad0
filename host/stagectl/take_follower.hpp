// SPDX-License-Identifier: MIT
// Follows what the daemon was asked to do by its events, to the end.
#pragma once

#include "record/stop_request.hpp"
#include "stagectl/daemon_options.hpp"

namespace ols {

class TakeFollower {
  public:
    // With `json` the end's data are printed, and nothing else on standard output.
    TakeFollower(const DaemonLink& link, DaemonClient& client, bool json) : link_(link), client_(client), json_(json) {}

    // Subscribes and calls; the call's result. From here on, when `stop` is wanted the daemon is told to stop, over a connection of
    // its own, as this one waits for its answer.
    Result<nlohmann::json> begin(const std::string& method, const nlohmann::json& params, const StopRequest& stop);

    // Until that take, or the calibration, has ended: the exit code, or the daemon's reason as an error. A stop is still followed to the
    // end.
    Result<int> follow(const StopRequest& stop);

  private:
    std::optional<Result<int>> take(const nlohmann::json& event);
    void show(const nlohmann::json& progress);

    void stop_if_wanted(const StopRequest& stop);
    bool is_mine(const nlohmann::json& event) const;

    const DaemonLink& link_;
    DaemonClient& client_;
    const bool json_;
    std::string name_;  // of the take; empty: a calibration
    bool told_to_stop_ = false;
};

}  // namespace ols
