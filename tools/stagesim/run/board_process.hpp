// SPDX-License-Identifier: MIT
// The emulated board as a child process, and the socket on which it tells of exposures.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "result.hpp"

namespace ols {

class BoardProcess {
  public:
    // Starts a program found on the PATH.
    static Result<BoardProcess> start(const std::vector<std::string>& command);

    // Asks it to end (SIGTERM); one that has not after twenty seconds is killed in running() or wait().
    void stop();
    // Waits for its end; its exit status, 128 + signal if one killed it.
    int wait();
    bool running();

    BoardProcess(BoardProcess&& other) noexcept : pid_(other.pid_), status_(other.status_), kill_at_(other.kill_at_) {
        other.pid_ = -1;
    }
    BoardProcess& operator=(BoardProcess&&) = delete;
    ~BoardProcess();

  private:
    explicit BoardProcess(int pid) : pid_(pid) {}
    int pid_;
    std::optional<int> status_;
    std::optional<std::chrono::steady_clock::time_point> kill_at_;
};

class LineListener {
  public:
    // Listens at a path, replacing an old socket there.
    static Result<LineListener> listen(const std::string& path);

    enum class Event { line, timeout, end };
    // The next line of the one client, without its newline. `timeout` after 20 ms without one; `end` when the client
    // has closed the connection.
    Event read(std::string& line);

    bool has_client() const { return client_ >= 0; }
    // Sends the client a line, given with its newline. One that has gone is seen by read().
    void send(const std::string& line);

    LineListener(LineListener&& other) noexcept;
    LineListener& operator=(LineListener&&) = delete;
    ~LineListener();

  private:
    LineListener(std::string path, int listener) : path_(std::move(path)), listener_(listener) {}
    std::string path_;
    int listener_, client_ = -1;
    std::string input_;
    size_t read_to_ = 0;
};

}  // namespace ols
