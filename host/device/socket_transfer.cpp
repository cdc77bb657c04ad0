// SPDX-License-Identifier: MIT
// USB transfers to the emulated board, carried by an AF_UNIX stream socket (docs/architecture.md).
#include "device/transfer.hpp"
#include "device/unix_socket.hpp"

namespace ols {

namespace {

constexpr uint32_t request_magic = 0x54425355;  // "USBT", little-endian
constexpr uint32_t reply_magic = 0x52425355;    // "USBR"
constexpr uint8_t type_bulk = 1;
constexpr int32_t status_busy = -6;  // to no transfer: the client is turned away
constexpr uint8_t endpoint_out = 0x01, endpoint_in = 0x82;

#pragma pack(push, 1)
struct TransferRequest {
    uint32_t magic = request_magic, tag = 0;
    uint8_t type = type_bulk, endpoint = 0;
    uint16_t reserved = 0;
    uint32_t length = 0, timeout_us = 0;
    uint8_t setup[8] = {};
};
struct TransferReply {
    uint32_t magic, tag;
    int32_t status;
    uint32_t length;
};
#pragma pack(pop)
static_assert(sizeof(TransferRequest) == 28 && sizeof(TransferReply) == 16);

const char* status_text(int32_t status) {
    switch (status) {
        case -1: return "the board refused the transfer (endpoint stalled)";
        case -2: return "the board was disconnected: connect it again and start over";
        case -3: return "the board did not answer in time: reset it and start over";
        case -4: return "the transfer was cancelled";
        case status_busy:
            return "the board is busy: another program has it, and it serves one at a time; wait until that one has "
                   "finished, or "
                   "end it";
        default: return "the transfer failed";
    }
}

class SocketTransfer : public Transfer {
  public:
    SocketTransfer(UnixSocket socket, std::string path) : socket_(std::move(socket)), path_(std::move(path)) {}

    Status write(std::span<const uint8_t> bytes, uint32_t timeout_us) override {
        if (const Status sent = request(endpoint_out, uint32_t(bytes.size()), timeout_us); !sent.ok()) return sent;
        if (const Status sent = socket_.send(bytes.data(), bytes.size()); !sent.ok()) return sent;
        const auto reply = receive_reply();
        if (!reply.ok()) return reply.error();
        return Done{};
    }

    Result<std::vector<uint8_t>> read(size_t capacity, uint32_t timeout_us) override {
        if (const Status sent = request(endpoint_in, uint32_t(capacity), timeout_us); !sent.ok()) return sent.error();
        return receive_reply();
    }

  private:
    Status request(uint8_t endpoint, uint32_t length, uint32_t timeout_us) {
        TransferRequest request;
        request.tag = ++tag_;
        request.endpoint = endpoint;
        request.length = length;
        request.timeout_us = timeout_us;
        return socket_.send(&request, sizeof request);
    }

    // The payload of the reply to the last request; replies to transfers given up earlier are passed over.
    Result<std::vector<uint8_t>> receive_reply() {
        for (int passed_over = 0;; ++passed_over) {
            TransferReply reply;
            if (const Status got = socket_.receive(&reply, sizeof reply); !got.ok()) return got.error();
            if (reply.magic != reply_magic || passed_over > replies_max)
                return fail("'" + path_ + "' does not speak USB transfers: is it the board's socket?");
            std::vector<uint8_t> payload(reply.length);
            if (const Status got = socket_.receive(payload.data(), payload.size()); !got.ok()) return got.error();
            if (reply.status == status_busy) return fail(status_text(reply.status));
            if (reply.tag != tag_) continue;
            if (reply.status != 0) return fail(status_text(reply.status));
            return payload;
        }
    }

    static constexpr int replies_max = 1000;  // to transfers given up earlier; a client has a few under way at most

    UnixSocket socket_;
    std::string path_;
    uint32_t tag_ = 0;
};

}  // namespace

Result<std::unique_ptr<Transfer>> open_socket_transfer(const std::string& path, int patience_ms) {
    auto socket = UnixSocket::connect(path, "the board", patience_ms);
    if (!socket.ok()) return socket.error();
    return std::unique_ptr<Transfer>(std::make_unique<SocketTransfer>(std::move(*socket), path));
}

}  // namespace ols
