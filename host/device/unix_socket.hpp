// SPDX-License-Identifier: MIT
// A Unix socket of the emulated board: connecting, and whole records, until a deadline.
#pragma once

#include <cstddef>
#include <string>

#include "device/patience.hpp"
#include "result.hpp"

namespace ols {

class UnixSocket {
  public:
    // A connected stream socket. `what` listens at `path`; errors name both, and say to start the stage first.
    static Result<UnixSocket> connect(const std::string& path, const std::string& what, const Deadline& deadline);

    // Sends or receives all `count` bytes. Errors: the other end has gone, or the deadline is over.
    Status send(const void* bytes, size_t count, const Deadline& deadline);
    Status receive(void* bytes, size_t count, const Deadline& deadline);

    // Whether bytes wait to be received, also from another end that has gone.
    bool has_bytes() const;

    // Whether receive() has something to do within so long: bytes, or another end that has gone.
    bool has_bytes_within(int timeout_ms) const;

    const std::string& name() const { return name_; }  // "the board at 'PATH'"

    UnixSocket(UnixSocket&& other) noexcept;
    UnixSocket& operator=(UnixSocket&&) = delete;
    ~UnixSocket();

  private:
    UnixSocket(int fd, std::string name) : fd_(fd), name_(std::move(name)) {}
    Status wait(short events, const Deadline& deadline) const;
    Error too_slow(const Deadline& deadline) const;
    Error gone() const;

    int fd_;
    std::string name_;
};

}  // namespace ols
