// SPDX-License-Identifier: MIT
// posix_spawn, waitpid and an AF_UNIX listener.
#include "run/board_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

extern char** environ;

namespace ols {

namespace {

constexpr std::chrono::seconds stop_patience(20);

}  // namespace

Result<BoardProcess> BoardProcess::start(const std::vector<std::string>& command) {
    std::vector<char*> argv;
    for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    // The child gets its own process group: Ctrl-C reaches stagesim, which then ends the board in order.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    pid_t pid = -1;
    const int error = posix_spawnp(&pid, argv[0], nullptr, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    if (error != 0) return fail("cannot start '" + command[0] + "': " + std::strerror(error) + ": install it first");
    return BoardProcess(pid);
}

void BoardProcess::stop() {
    if (!running()) return;
    kill(pid_, SIGTERM);
    if (!kill_at_) kill_at_ = std::chrono::steady_clock::now() + stop_patience;
}

bool BoardProcess::running() {
    if (pid_ < 0 || status_) return false;
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_) status_ = status;
    if (!status_ && kill_at_ && std::chrono::steady_clock::now() > *kill_at_) kill(pid_, SIGKILL);
    return !status_;
}

int BoardProcess::wait() {
    while (running()) usleep(10'000);
    if (!status_) return -1;
    return WIFEXITED(*status_) ? WEXITSTATUS(*status_) : 128 + WTERMSIG(*status_);
}

BoardProcess::~BoardProcess() {
    if (pid_ < 0) return;
    stop();
    wait();
}

Result<LineListener> LineListener::listen(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path)
        return fail("socket path '" + path + "' is too long for the system: choose a shorter --work folder");
    std::memcpy(address.sun_path, path.c_str(), path.size());
    struct stat info {};
    if (lstat(path.c_str(), &info) == 0) {
        if (!S_ISSOCK(info.st_mode)) return fail("'" + path + "' exists and is not a socket: remove it");
        unlink(path.c_str());
    }
    const int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (listener < 0 || bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(listener, 1) != 0) {
        const std::string reason = std::strerror(errno);
        if (listener >= 0) close(listener);
        return fail("cannot listen at '" + path + "': " + reason);
    }
    return LineListener(path, listener);
}

LineListener::LineListener(LineListener&& other) noexcept
    : path_(std::move(other.path_)), listener_(other.listener_), client_(other.client_) {
    other.listener_ = other.client_ = -1;
}

LineListener::~LineListener() {
    if (client_ >= 0) close(client_);
    if (listener_ < 0) return;
    close(listener_);
    unlink(path_.c_str());
}

void LineListener::send(const std::string& line) {
    for (size_t sent = 0; client_ >= 0 && sent < line.size();) {
        const ssize_t count = ::send(client_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return;
        sent += size_t(count);
    }
}

LineListener::Event LineListener::read(std::string& line) {
    for (;;) {
        const size_t end = input_.find('\n', read_to_);
        if (end != std::string::npos) {
            line = input_.substr(0, end);
            input_.erase(0, end + 1);
            read_to_ = 0;
            return Event::line;
        }
        read_to_ = input_.size();
        pollfd wait{client_ >= 0 ? client_ : listener_, POLLIN, 0};
        if (poll(&wait, 1, 20) <= 0) return Event::timeout;
        if (client_ < 0) {
            client_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
            continue;
        }
        // Small reads: what lies unread in the socket is what holds the board back in virtual pace.
        char buffer[4096];
        const ssize_t count = recv(client_, buffer, sizeof buffer, 0);
        if (count == 0 || (count < 0 && errno != EINTR)) return Event::end;
        if (count > 0) input_.append(buffer, size_t(count));
    }
}

}  // namespace ols
