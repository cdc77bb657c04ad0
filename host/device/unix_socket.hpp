// SPDX-License-Identifier: MIT
// A Unix socket of the emulated board: connecting, and whole records, each within a bound of time.
#pragma once

#include <cstddef>
#include <string>

#include "result.hpp"

namespace ols {

class UnixSocket {
  public:
    // Time of the wall without one byte after which the other end is given up. An emulated board has its own time, which stands
    // still while it is stopped, and a machine may be busy: only a board that hangs is silent for so long.
    static constexpr int patience_ms = 60'000;

    // A connected stream socket. `what` listens at `path`; errors name both, and say to start the stage first.
    static Result<UnixSocket> connect(const std::string& path, const std::string& what, int patience_ms);

    // Sends or receives all `count` bytes. Errors: the other end has gone, or is silent.
    Status send(const void* bytes, size_t count);
    Status receive(void* bytes, size_t count);

    UnixSocket(UnixSocket&& other) noexcept;
    UnixSocket& operator=(UnixSocket&&) = delete;
    ~UnixSocket();

  private:
    UnixSocket(int fd, std::string name, int patience_ms)
        : fd_(fd), name_(std::move(name)), patience_ms_(patience_ms) {}
    Error failure(ssize_t result) const;

    int fd_;
    std::string name_;  // "the board at 'PATH'"
    int patience_ms_;
};

}  // namespace ols
