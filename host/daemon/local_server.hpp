// SPDX-License-Identifier: MIT
// The API over a Unix socket: JSON-RPC 2.0, a request and a response a line; after `subscribe` events come as notifications.
#pragma once

#include <atomic>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "daemon/api.hpp"

namespace ols {

// Who may connect is the socket's permissions: its owner, and the group of [daemon] socket_group.
class LocalServer {
  public:
    // Errors: it cannot listen there, another daemon does, there is no such group.
    static Result<std::unique_ptr<LocalServer>> listen(const DaemonSetup& setup, Api& api, EventLog& events);
    ~LocalServer();

    static constexpr size_t clients_max = 32, request_bytes_max = 64 << 10;
    static constexpr int send_patience_ms = 5000;  // for a client that does not read

    LocalServer(const LocalServer&) = delete;

  private:
    struct Client;
    LocalServer(std::string path, int listener, Api& api, EventLog& events);
    void accept();
    void dismiss_one();
    void drop_ended();
    void serve(Client& client);

    const std::string path_;
    const int listener_;
    Api& api_;
    EventLog& events_;
    std::atomic<bool> end_ = false;
    std::list<std::unique_ptr<Client>> clients_;  // of the thread that accepts
    std::thread thread_;
};

}  // namespace ols
