// SPDX-License-Identifier: MIT
// Client: the command line's end of the daemon's Unix socket.
#pragma once

#include <chrono>
#include <deque>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "result.hpp"

namespace ols {

// $STAGECTL_SOCKET, or where a daemon listens by default.
std::string default_socket();

// For one thread.
class DaemonClient {
  public:
    // The error says to start the daemon.
    static Result<DaemonClient> connect(const std::string& socket_path);

    // The result of a call; waits for it as long as the daemon lives, for the end of light so long only. The error is the daemon's, that
    // it has gone, or that it does not answer.
    static constexpr std::chrono::seconds stop_patience{15};
    Result<nlohmann::json> call(const std::string& method, const nlohmann::json& params = nlohmann::json::object());

    // The same in two halves: for one who has something to do meanwhile. answer() waits so long.
    Status send(const std::string& method, const nlohmann::json& params = nlohmann::json::object());
    std::optional<Result<nlohmann::json>> answer(std::chrono::milliseconds timeout);

    // After `subscribe`: the next event, or nothing within `timeout`. The error: the daemon has gone.
    Result<std::optional<nlohmann::json>> next_event(std::chrono::milliseconds timeout);

    DaemonClient(DaemonClient&& other) noexcept;
    ~DaemonClient();

  private:
    DaemonClient(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
    // Takes in what comes within `timeout`: responses and events are put where they are looked for.
    Status receive(std::chrono::milliseconds timeout);
    Error gone() const;

    int fd_;
    std::string path_, input_;
    uint64_t last_id_ = 0;
    std::deque<nlohmann::json> events_;
    std::deque<nlohmann::json> responses_;
};

}  // namespace ols
