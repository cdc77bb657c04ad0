// SPDX-License-Identifier: MIT
// The device's end of "USB transfers over a socket", with a board behind it that its user lends out.
#include "device/board_relay.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>

#include "device/socket_usb.hpp"
#include "device/unix_listener.hpp"

namespace ols {

namespace {

constexpr size_t out_bytes_max = 16 * OLS_FRAME_BYTES_MAX;  // of one transfer
constexpr size_t read_bytes = 64 << 10;
constexpr std::chrono::seconds last_answer_kept{2};

bool send_reply(int fd, const SocketUsbReply& reply, std::span<const uint8_t> payload = {}) {
    std::vector<uint8_t> bytes(sizeof reply + payload.size());
    std::memcpy(bytes.data(), &reply, sizeof reply);
    std::copy(payload.begin(), payload.end(), bytes.begin() + sizeof reply);
    return ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) == ssize_t(bytes.size());
}

}  // namespace

// Its functions return false when it is to be let go: it left, or does not speak as it must.
struct BoardRelay::Client {
    explicit Client(int socket) : fd(socket), parser(std::make_unique<ols_frame_parser>()) {}
    ~Client() { ::close(fd); }

    using Clock = std::chrono::steady_clock;
    struct Wanted {
        uint32_t tag, capacity;
        std::optional<Clock::time_point> end;
    };

    bool receive() {
        uint8_t bytes[read_bytes];
        const ssize_t got = ::recv(fd, bytes, sizeof bytes, MSG_DONTWAIT);
        if (got < 0) return errno == EAGAIN || errno == EINTR;
        input.insert(input.end(), bytes, bytes + got);
        while (got > 0) {
            const std::optional<bool> taken = take_transfer();
            if (!taken) return true;
            if (!*taken) return false;
        }
        return false;  // it has left
    }

    // Nothing while not all of it has come.
    std::optional<bool> take_transfer() {
        SocketUsbRequest request;
        if (input.size() < sizeof request) return std::nullopt;
        std::memcpy(&request, input.data(), sizeof request);
        const bool is_out = request.type == socket_usb_bulk && request.endpoint == socket_usb_out;
        if (request.magic != socket_usb_request_magic || request.type > socket_usb_cancel) return false;
        const size_t payload_bytes = is_out ? request.length : 0;
        if (payload_bytes > out_bytes_max) return false;
        if (input.size() < sizeof request + payload_bytes) return std::nullopt;
        const auto payload = input.begin() + sizeof request;
        if (is_out) messages.insert(messages.end(), payload, payload + ptrdiff_t(payload_bytes));
        input.erase(input.begin(), payload + ptrdiff_t(payload_bytes));
        return answer(request, is_out);
    }

    bool answer(const SocketUsbRequest& request, bool is_out) {
        if (is_out)
            return messages.size() <= out_bytes_max && send_reply(fd, {socket_usb_reply_magic, request.tag, 0, 0});
        if (request.type == socket_usb_cancel) {
            if (!wanted || wanted->tag != request.tag) return true;
            wanted.reset();
            return send_reply(fd, {socket_usb_reply_magic, request.tag, socket_usb_cancelled, 0});
        }
        if (request.type != socket_usb_bulk || request.endpoint != socket_usb_in)
            return send_reply(fd, {socket_usb_reply_magic, request.tag, socket_usb_stalled, 0});
        if (wanted) return false;
        wanted = Wanted{request.tag, request.length, std::nullopt};
        if (request.timeout_us > 0) wanted->end = Clock::now() + std::chrono::microseconds(request.timeout_us);
        return true;
    }

    // What the client waits for, if it is there.
    bool deliver() {
        if (!wanted) return true;
        if (output.empty() && (!wanted->end || Clock::now() < *wanted->end)) return true;
        const Wanted asked = *wanted;
        wanted.reset();
        if (output.empty()) return send_reply(fd, {socket_usb_reply_magic, asked.tag, socket_usb_timed_out, 0});
        const size_t count = std::min<size_t>(asked.capacity, output.size());
        const bool sent =
            send_reply(fd, {socket_usb_reply_magic, asked.tag, 0, uint32_t(count)}, std::span(output).first(count));
        output.erase(output.begin(), output.begin() + ptrdiff_t(count));
        return sent;
    }

    // The next whole message; nothing while there is none.
    bool next_message(ols_frame& message) {
        while (!ols_frame_parser_read(parser.get(), &message)) {
            if (messages.empty()) return false;
            const size_t taken = ols_frame_parser_write(parser.get(), messages.data(), messages.size());
            messages.erase(messages.begin(), messages.begin() + ptrdiff_t(taken));
        }
        return true;
    }

    // Also while there is still something of it to be read.
    bool has_left() const {
        pollfd state{fd, 0, 0};
        return ::poll(&state, 1, 0) == 1 && (state.revents & (POLLHUP | POLLERR));
    }

    const int fd;
    std::vector<uint8_t> input, messages, output;
    std::unique_ptr<ols_frame_parser> parser;
    std::optional<Wanted> wanted;
};

Result<std::unique_ptr<BoardRelay>> BoardRelay::listen(const std::string& path) {
    const auto listener = listen_at(path);
    if (!listener.ok()) return listener.error();
    return std::unique_ptr<BoardRelay>(new BoardRelay(path, *listener));
}

BoardRelay::BoardRelay(std::string path, int listener) : path_(std::move(path)), listener_(listener) {}

// A client that has been answered, as one that stopped the board, may still fetch the answer.
BoardRelay::~BoardRelay() {
    const auto end = Client::Clock::now() + last_answer_kept;
    while (client_ && !client_->output.empty() && Client::Clock::now() < end) {
        pollfd asks{client_->fd, POLLIN, 0};
        (void)::poll(&asks, 1, 10);
        if (!client_->receive() || !client_->deliver()) client_.reset();
    }
    ::close(listener_);
    ::unlink(path_.c_str());
}

Status BoardRelay::serve(Board& board) {
    if (client_)
        if (const Status served = serve_client(board); !served.ok()) return served;
    // After that: one that left makes room for the next.
    const int fd = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) return Done{};
    // One that had its answer just now may have left before this one came.
    while (client_ && client_->has_left())
        if (const Status served = serve_client(board); !served.ok()) return ::close(fd), served;
    if (!client_) {
        client_ = std::make_unique<Client>(fd);
        return Done{};
    }
    (void)send_reply(fd, {socket_usb_reply_magic, 0, socket_usb_busy, 0});
    ::close(fd);
    return Done{};
}

Status BoardRelay::serve_client(Board& board) {
    const bool stays = client_->receive();
    ols_frame message;
    if (client_->next_message(message)) {
        const uint16_t request_id = message.request_id;
        const auto reply = board.pass_on(message.type, {message.payload, message.payload_bytes});
        if (!reply.ok()) return reply.error();
        uint8_t frame[OLS_FRAME_BYTES_MAX];
        const size_t bytes = ols_frame_encode(reply->type, request_id, reply->payload.data(), reply->payload.size(),
                                              frame, sizeof frame);
        client_->output.insert(client_->output.end(), frame, frame + bytes);
    }
    if (!stays || !client_->deliver()) client_.reset();
    return Done{};
}

}  // namespace ols
