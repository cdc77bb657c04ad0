// SPDX-License-Identifier: MIT
// cpp-httplib's server with bounds that it lacks: on all bytes of a request, on the time in which they come, and on the time that a
// client takes to read. One request a connection, so that nothing of a refused one is taken for the next.
#pragma once

#include <httplib.h>

#include <chrono>

namespace ols {

struct HttpBounds {
    size_t request_bytes = 80 << 10;            // line, headers and body
    std::chrono::seconds request_patience{10};  // from the connection on until all of it has come
    std::chrono::seconds write_patience{5};     // without a byte being taken
};

class BoundedHttpServer : public httplib::Server {
  public:
    explicit BoundedHttpServer(const HttpBounds& bounds) : bounds_(bounds) {}

  private:
    bool process_and_close_socket(int socket) override;

    const HttpBounds bounds_;
};

}  // namespace ols
