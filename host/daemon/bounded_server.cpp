// SPDX-License-Identifier: MIT
// A stream that ends when a bound is reached; the library takes that for a client that has left.
#include "daemon/bounded_server.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace ols {

namespace {

class BoundedStream : public httplib::Stream {
  public:
    BoundedStream(int socket, const HttpBounds& bounds)
        : socket_(socket), bounds_(bounds), end_(Clock::now() + bounds.request_patience) {}

    bool is_readable() const override { return wait(POLLIN, end_); }
    bool is_writable() const override { return wait(POLLOUT, Clock::now() + bounds_.write_patience) && is_open(); }

    ssize_t read(char* bytes, size_t size) override {
        if (at_ == got_ && !fill()) return -1;
        const size_t count = std::min(size, got_ - at_);
        std::copy_n(buffer_ + at_, count, bytes);
        at_ += count;
        return ssize_t(count);
    }
    ssize_t write(const char* bytes, size_t size) override {
        if (!wait(POLLOUT, Clock::now() + bounds_.write_patience)) return -1;
        return ::send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
    void get_remote_ip_and_port(std::string& ip, int& port) const override { ip = "127.0.0.1", port = 0; }
    void get_local_ip_and_port(std::string& ip, int& port) const override { ip = "127.0.0.1", port = 0; }
    int socket() const override { return socket_; }

  private:
    using Clock = std::chrono::steady_clock;

    bool wait(short events, Clock::time_point end) const {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
        pollfd ready{socket_, events, 0};
        return left.count() > 0 && ::poll(&ready, 1, int(left.count())) > 0;
    }
    // Whether the other end has not closed: a client that has left is noticed without a write.
    bool is_open() const {
        char byte;
        return ::recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT) != 0;
    }
    // The library reads a line byte by byte.
    bool fill() {
        const size_t room = std::min(sizeof buffer_, bounds_.request_bytes - total_);
        if (room == 0 || !wait(POLLIN, end_)) return false;
        const ssize_t got = ::recv(socket_, buffer_, room, MSG_DONTWAIT);
        if (got <= 0) return false;
        at_ = 0, got_ = size_t(got), total_ += size_t(got);
        return true;
    }

    const int socket_;
    const HttpBounds& bounds_;
    const Clock::time_point end_;
    char buffer_[4096];
    size_t at_ = 0, got_ = 0, total_ = 0;
};

// What a refused client still sends is let go of for a moment: closing with bytes unread would reset the connection, and take the
// answer with it before the client has read it.
void close_gently(int socket) {
    (void)::shutdown(socket, SHUT_WR);
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
    char bytes[64 << 10];
    for (pollfd ready{socket, POLLIN, 0}; std::chrono::steady_clock::now() < end && ::poll(&ready, 1, 20) >= 0;)
        if (ready.revents != 0 && ::recv(socket, bytes, sizeof bytes, MSG_DONTWAIT) <= 0) break;
    ::close(socket);
}

}  // namespace

bool BoundedHttpServer::process_and_close_socket(int socket) {
    BoundedStream stream(socket, bounds_);
    bool is_closed = false;
    const bool done = process_request(stream, true, is_closed, [](httplib::Request&) {});
    close_gently(socket);
    return done;
}

}  // namespace ols
