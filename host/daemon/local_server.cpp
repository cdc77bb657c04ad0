// SPDX-License-Identifier: MIT
// A thread that accepts, and one for each client, who waits for nobody but himself.
#include "daemon/local_server.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include "daemon/call_rate.hpp"
#include "daemon/subscriber.hpp"
#include "device/unix_listener.hpp"
#include "exceptions.hpp"
#include "image/json_object.hpp"

namespace ols {

namespace {

constexpr int look_ms = 20;  // between two looks at events and at the end

// "uid 1000 (process 4711)", of the other end.
std::string peer_of(int fd) {
    ucred peer{};
    socklen_t bytes = sizeof peer;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &bytes) != 0) return "somebody";
    return fmt::format("uid {} (process {})", peer.uid, peer.pid);
}

Status give_to_group(const std::string& path, const std::string& group) {
    const struct group* const found = getgrnam(group.c_str());
    if (!found)
        return fail("there is no group '" + group + "', which [daemon] socket_group names: add it by `groupadd`");
    if (::chown(path.c_str(), uid_t(-1), found->gr_gid) != 0)
        return fail(
            fmt::format("the socket cannot be given to group '{}': {}: be its member", group, std::strerror(errno)));
    return Done{};
}

}  // namespace

struct LocalServer::Client {
    explicit Client(int socket) : fd(socket), name(peer_of(socket)) {}
    ~Client() {
        if (thread.joinable()) thread.join();
        ::close(fd);
    }

    // False when the client does not read, or has left.
    bool send(std::string line) {
        line += '\n';
        const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(send_patience_ms);
        for (size_t sent = 0; sent < line.size();) {
            const ssize_t count = ::send(fd, line.data() + sent, line.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
            if (count > 0) sent += size_t(count);
            if (count > 0 || (count < 0 && errno == EINTR)) continue;
            if (count == 0 || errno != EAGAIN) return false;
            pollfd ready{fd, POLLOUT, 0};
            (void)::poll(&ready, 1, look_ms);
            if (std::chrono::steady_clock::now() > end) return is_slow = true, false;
        }
        return true;
    }

    // Takes in what has come. False when the client has left.
    bool receive() {
        char bytes[16 << 10];
        const ssize_t got = ::recv(fd, bytes, sizeof bytes, MSG_DONTWAIT);
        if (got > 0) input.append(bytes, size_t(got));
        return got > 0 || (got < 0 && (errno == EAGAIN || errno == EINTR));
    }

    // A whole line, without its end.
    std::optional<std::string> line() {
        const size_t end = input.find('\n', searched);
        searched = input.size();
        if (end == std::string::npos) return std::nullopt;
        std::string text = input.substr(0, end);
        input.erase(0, end + 1);
        searched = 0;
        return text;
    }

    const int fd;
    const std::string name;
    std::string input;
    size_t searched = 0;
    std::unique_ptr<Subscriber> subscriber;
    uint64_t known_number = 0;  // of the event that the present state, as it was sent, holds last
    bool is_slow = false;
    // By the steady clock, while it has nothing asked and is told nothing.
    std::atomic<int64_t> silent_since_ms = INT64_MAX;
    std::atomic<bool> is_dismissed = false, has_ended = false;
    std::thread thread;
};

Result<std::unique_ptr<LocalServer>> LocalServer::listen(const DaemonSetup& setup, Api& api, EventLog& events) {
    const auto listener = listen_at(setup.socket, true);
    if (!listener) return listener.error();
    std::unique_ptr<LocalServer> server(new LocalServer(setup.socket, *listener, api, events));
    if (!setup.socket_group.empty())
        if (const Status given = give_to_group(setup.socket, setup.socket_group); !given) return given.error();
    server->thread_ = std::thread([&server = *server] { server.accept(); });
    return server;
}

LocalServer::LocalServer(std::string path, int listener, Api& api, EventLog& events)
    : path_(std::move(path)), listener_(listener), api_(api), events_(events) {}

LocalServer::~LocalServer() {
    end_ = true;
    if (thread_.joinable()) thread_.join();
    clients_.clear();
    ::close(listener_);
    ::unlink(path_.c_str());
}

void LocalServer::drop_ended() {
    std::erase_if(clients_, [](const auto& client) { return client->has_ended.load(); });
}

// Of a full house the one that has been silent longest leaves: who comes may want to put the light out. Subscribers stay.
void LocalServer::dismiss_one() {
    const auto longest =
        std::ranges::min_element(clients_, {}, [](const auto& client) { return client->silent_since_ms.load(); });
    if ((*longest)->silent_since_ms != INT64_MAX) (*longest)->is_dismissed = true;
}

void LocalServer::accept() {
    while (!end_) {
        // Beyond that many the others wait in the kernel's queue, which has its own bound.
        pollfd ready{listener_, POLLIN, 0};
        const bool somebody_comes = ::poll(&ready, 1, look_ms) > 0;
        drop_ended();
        if (clients_.size() >= clients_max) {
            if (somebody_comes) {
                dismiss_one();
                (void)::poll(nullptr, 0, look_ms);
            }
            continue;
        }
        const int fd = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd < 0) {
            if (errno != EAGAIN) (void)::poll(nullptr, 0, look_ms);  // no descriptor is left: not at once again
            continue;
        }
        Client& client = *clients_.emplace_back(std::make_unique<Client>(fd));
        const auto serve_it = [this, &client] {
            serve(client);
            client.has_ended = true;
        };
        const Status begun =
            guarded("no thread for a client", [&] { return client.thread = std::thread(serve_it), Status(Done{}); });
        if (begun) continue;
        events_.add(EventKind::client_refused, begun.error().message);
        clients_.pop_back();
    }
}

void LocalServer::serve(Client& client) {
    CallRate rate;
    const auto call = [&](const std::string& method, const nlohmann::json& params) -> RpcOutcome {
        if (method != "subscribe") return api_.call(method, params, client.name);
        if (!params.empty()) return {nullptr, RpcError{RpcError::invalid_params, "subscribe takes no parameters"}};
        if (!client.subscriber) client.subscriber = std::make_unique<Subscriber>(events_);
        nlohmann::json state = api_.present_state();
        client.known_number = state["event_number"];
        return {state};
    };
    const auto fall_silent = [&] {
        const auto now = std::chrono::steady_clock::now().time_since_epoch();
        client.silent_since_ms =
            client.subscriber ? INT64_MAX : std::chrono::duration_cast<std::chrono::milliseconds>(now).count();
    };
    fall_silent();
    for (bool goes_on = true; goes_on && !end_ && !client.is_dismissed;) {
        pollfd ready{client.fd, POLLIN, 0};
        if (!client.subscriber) (void)::poll(&ready, 1, look_ms);
        goes_on = client.receive();
        while (const auto line = client.line()) {
            if (line->empty()) continue;
            client.silent_since_ms = INT64_MAX;
            std::this_thread::sleep_for(rate.take());
            const auto answer = answer_rpc(*line, call);
            if (answer && !client.send(*answer)) goes_on = false;
            fall_silent();
            if (!goes_on || end_) break;
        }
        if (client.input.size() > request_bytes_max) {
            const RpcError too_long{RpcError::too_much,
                                    fmt::format("a request has at most {} bytes", request_bytes_max)};
            (void)client.send(json_line(too_long.to_json(nullptr)));
            break;
        }
        if (!client.subscriber) continue;
        const auto event = client.subscriber->next(std::chrono::milliseconds(look_ms));
        if (event && event->number > client.known_number)
            goes_on = client.send(json_line({{"jsonrpc", "2.0"}, {"method", "event"}, {"params", event->to_json()}})) &&
                      goes_on;
        if (client.subscriber->is_behind()) client.is_slow = true, goes_on = false;
    }
    const bool was_slow = client.is_slow;
    client.subscriber.reset();
    (void)::shutdown(client.fd, SHUT_RDWR);
    if (client.is_dismissed)
        events_.add(EventKind::client_dropped,
                    client.name + " was silent while another waited for its place, and was let go of");
    if (was_slow) events_.add(EventKind::client_dropped, client.name + " did not read its events, and was let go of");
}

}  // namespace ols
