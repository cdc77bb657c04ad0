// SPDX-License-Identifier: MIT
// USB transfers to the emulated board, carried by an AF_UNIX stream socket (docs/architecture.md).
#include <fmt/format.h>

#include <algorithm>

#include "device/socket_usb.hpp"
#include "device/transfer.hpp"
#include "device/unix_socket.hpp"

namespace ols {

namespace {

// What the board did, behind its name, and what to do.
std::string status_text(int32_t status) {
    switch (status) {
        case -1: return "refused the transfer (endpoint stalled): start the stage again";
        case -2: return "was disconnected: connect it again and start over";
        case -3: return "did not answer in time: reset it and start over";
        case -4: return "cancelled the transfer: start over";
        case -5: return "sent more than was asked for (overflow): reset it and start over";
        case socket_usb_busy:
            return "is busy: another program has it, and it serves one at a time; wait until that one has finished, or "
                   "end it";
        default: return fmt::format("failed the transfer with the unknown status {}: start the stage again", status);
    }
}

class SocketTransfer : public Transfer {
  public:
    explicit SocketTransfer(UnixSocket socket) : socket_(std::move(socket)) {}

    std::string name() const override { return socket_.name(); }

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us, const Deadline& deadline) override {
        if (const Status sent = request(socket_usb_out, bytes.size(), timeout_us, deadline); !sent.ok()) return sent;
        if (const Status sent = send(bytes.data(), bytes.size(), deadline); !sent.ok()) return sent;
        const auto reply = receive_reply(0, deadline);
        if (!reply.ok()) return reply.error();
        return Done{};
    }

    // An empty packet ends a message whose last packet was full; it is not what the caller waits for.
    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us, const Deadline& deadline) override {
        for (int empty_packets = 0; empty_packets < empty_packets_max; ++empty_packets) {
            if (const Status sent = request(socket_usb_in, capacity, timeout_us, deadline); !sent.ok())
                return sent.error();
            auto payload = receive_reply(capacity, deadline);
            if (!payload.ok() || !payload->empty()) return payload;
        }
        return fail(name() + " sends nothing but empty packets: start the stage again");
    }

  private:
    static constexpr int empty_packets_max = 16;
    static constexpr int late_replies_max = 16;  // to transfers given up earlier; a client has a few under way at most

    Status request(uint8_t endpoint, size_t length, uint32_t timeout_us, const Deadline& deadline) {
        SocketUsbRequest request;
        request.tag = ++tag_;
        request.endpoint = endpoint;
        request.length = uint32_t(length);
        request.timeout_us = timeout_us;
        largest_ = std::max(largest_, length);
        return send(&request, sizeof request, deadline);
    }

    // A board that has gone may have said why before, which is then still to be received: that it is busy.
    Status send(const void* bytes, size_t count, const Deadline& deadline) {
        const Status sent = socket_.send(bytes, count, deadline);
        return !sent.ok() && socket_.has_bytes() ? Done{} : sent;
    }

    // The payload of the reply to the last request; replies to transfers given up earlier are passed over.
    Result<std::vector<uint8_t>> receive_reply(size_t capacity, const Deadline& deadline) {
        for (int late = 0; late <= late_replies_max; ++late) {
            SocketUsbReply reply;
            if (const Status got = socket_.receive(&reply, sizeof reply, deadline); !got.ok()) return got.error();
            if (const Status sound = check(reply, capacity); !sound.ok()) return sound.error();
            std::vector<uint8_t> payload(reply.length);
            if (const Status got = socket_.receive(payload.data(), payload.size(), deadline); !got.ok())
                return got.error();
            if (reply.tag != tag_) continue;
            if (reply.status != 0) return fail(name() + " " + status_text(reply.status));
            return payload;
        }
        return fail(name() + " answers transfers that were given up long ago: start the stage again");
    }

    // Nothing is taken from a reply, memory for it neither, before its head is known to be sound.
    Status check(const SocketUsbReply& reply, size_t capacity) const {
        if (reply.magic != socket_usb_reply_magic)
            return fail(name() + " does not speak USB transfers: is it the board's socket?");
        if (reply.status == socket_usb_busy) return fail(name() + " " + status_text(reply.status));
        if (reply.tag == 0 || reply.tag > tag_)
            return fail(fmt::format("{} answers transfer {}, which it was not asked for: start the stage again", name(),
                                    reply.tag));
        const size_t length_max = reply.tag == tag_ ? capacity : largest_;
        if (reply.length > length_max)
            return fail(fmt::format("{} announces {} bytes where {} were asked for at most: start the stage again",
                                    name(), reply.length, length_max));
        return Done{};
    }

    UnixSocket socket_;
    uint32_t tag_ = 0;
    size_t largest_ = 0;  // that any request asked for
};

}  // namespace

Result<std::unique_ptr<Transfer>> open_socket_transfer(const std::string& path, const Deadline& deadline) {
    auto socket = UnixSocket::connect(path, "the board", deadline);
    if (!socket.ok()) return socket.error();
    return std::unique_ptr<Transfer>(std::make_unique<SocketTransfer>(std::move(*socket)));
}

}  // namespace ols
