// SPDX-License-Identifier: MIT
// Requests out, responses and events in.
#include "daemon/client.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "device/unix_address.hpp"
#include "image/json_object.hpp"
#include "stage/daemon_setup.hpp"

namespace ols {

std::string default_socket() {
    const char* const named = std::getenv("STAGECTL_SOCKET");
    return named && *named ? named : DaemonSetup{}.socket;
}

Result<DaemonClient> DaemonClient::connect(const std::string& path) {
    const auto address = unix_address(path);
    if (!address) return address.error();
    DaemonClient client(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0), path);
    // A place among those who wait is not waited for without end.
    const timeval patience{stop_patience.count(), 0};
    (void)::setsockopt(client.fd_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    if (client.fd_ < 0 || ::connect(client.fd_, reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0) {
        const int error = errno;
        const char* const hint =
            error == EACCES ? "be a member of the group that may use it ([daemon] socket_group)"
            : error == EAGAIN
                ? "it hangs, or too many others wait for it: `systemctl restart stagectl`, and the emergency stop "
                  "for light that is to end"
                : "start it with `systemctl start stagectl` or `stagectl serve`, or say where it "
                  "listens with --socket";
        return fail(fmt::format("no daemon answers at '{}' ({}): {}", path, std::strerror(error), hint));
    }
    return client;
}

DaemonClient::DaemonClient(DaemonClient&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      path_(std::move(other.path_)),
      input_(std::move(other.input_)),
      last_id_(other.last_id_),
      events_(std::move(other.events_)),
      responses_(std::move(other.responses_)) {}

DaemonClient::~DaemonClient() {
    if (fd_ >= 0) ::close(fd_);
}

Error DaemonClient::gone() const {
    return fail("the daemon at '" + path_ + "' has gone: `journalctl -u stagectl` says why");
}

Status DaemonClient::send(const std::string& method, const nlohmann::json& params) {
    const std::string line =
        json_line({{"jsonrpc", "2.0"}, {"id", ++last_id_}, {"method", method}, {"params", params}}) + "\n";
    for (size_t sent = 0; sent < line.size();) {
        const ssize_t count = ::send(fd_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return gone();
        sent += size_t(count);
    }
    return Done{};
}

Status DaemonClient::receive(std::chrono::milliseconds timeout) {
    pollfd ready{fd_, POLLIN, 0};
    if (::poll(&ready, 1, int(timeout.count())) <= 0) return Done{};
    char bytes[64 << 10];
    const ssize_t got = ::recv(fd_, bytes, sizeof bytes, MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Done{};
    if (got <= 0) return gone();
    input_.append(bytes, size_t(got));
    for (size_t end; (end = input_.find('\n')) != std::string::npos;) {
        auto message = parse_json(std::string_view(input_).substr(0, end), "the daemon's answer");
        input_.erase(0, end + 1);
        if (!message) return message.error();
        if (!message->is_object()) return fail("the daemon's answer is no object: are both of one release?");
        (message->contains("method") ? events_ : responses_).push_back(std::move(*message));
    }
    return Done{};
}

std::optional<Result<nlohmann::json>> DaemonClient::answer(std::chrono::milliseconds timeout) {
    if (responses_.empty())
        if (const Status received = receive(timeout); !received) return Result<nlohmann::json>(received.error());
    if (responses_.empty()) return std::nullopt;
    nlohmann::json response = std::move(responses_.front());
    responses_.pop_front();
    if (response.contains("error"))
        return Result<nlohmann::json>(fail(response["error"].value("message", "the daemon refuses without a reason")));
    return Result<nlohmann::json>(response.value("result", nlohmann::json()));
}

Result<nlohmann::json> DaemonClient::call(const std::string& method, const nlohmann::json& params) {
    const auto begun = std::chrono::steady_clock::now();
    if (const Status sent = send(method, params); !sent) return sent.error();
    for (;;) {
        if (auto answered = answer(std::chrono::milliseconds(500))) return std::move(*answered);
        if (method == "stop" && std::chrono::steady_clock::now() - begun > stop_patience)
            return fail(fmt::format(
                "the daemon at '{}' has not answered for {} s: use the emergency stop; `systemctl kill -s KILL "
                "stagectl` ends a daemon that hangs, and the board goes dark without it",
                path_, stop_patience.count()));
    }
}

Result<std::optional<nlohmann::json>> DaemonClient::next_event(std::chrono::milliseconds timeout) {
    if (events_.empty())
        if (const Status received = receive(timeout); !received) return received.error();
    if (events_.empty()) return std::optional<nlohmann::json>();
    nlohmann::json event = events_.front().value("params", nlohmann::json::object());
    events_.pop_front();
    return std::optional(std::move(event));
}

}  // namespace ols
