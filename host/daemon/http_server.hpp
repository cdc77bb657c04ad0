// SPDX-License-Identifier: MIT
// The API over HTTP on the loopback: POST /rpc, GET /events (a server-sent stream), GET /metrics.
#pragma once

#include <memory>
#include <string>

#include "daemon/api.hpp"

namespace ols {

// Every request shows the token: "Authorization: Bearer TOKEN". Requests whose Host is not this machine's loopback, or that a page of
// another origin makes, are refused, so that no web page that a browser shows here can reach it.
class HttpServer {
  public:
    // Errors: the port is taken, the token (daemon/token.hpp).
    static Result<std::unique_ptr<HttpServer>> listen(const DaemonSetup& setup, Api& api, EventLog& events);
    ~HttpServer();

    static constexpr size_t request_bytes_max = 64 << 10;
    static constexpr int threads = 24, streams_max = 16;

  private:
    struct State;
    explicit HttpServer(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

// "token" beside the socket, where none is configured.
std::string token_file_of(const DaemonSetup& setup);

}  // namespace ols
