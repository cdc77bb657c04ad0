// SPDX-License-Identifier: MIT
// Fuzzes the host's side of an exchange: a board, on a byte stream or on a CAN bus, that answers with any bytes, with good frames
// of any content, and with logs and digests that are nearly good. Every call ends, takes no more than its bound of bytes, and
// what a log gives rises and is no more than a board keeps.
// links: ols_device
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "device/can_transfer.hpp"
#include "device/cycle_check.hpp"
#include "device/log_reader.hpp"
#include "layout_hash.h"

using namespace ols;

namespace {

using Bytes = std::vector<uint8_t>;

void expect(bool truth) {
    if (!truth) abort();
}

struct Script {
    const uint8_t* next;
    size_t left;

    uint8_t byte() {
        if (left == 0) return 0;
        left--;
        return *next++;
    }
    Bytes bytes(size_t count) {
        count = std::min(count, left);
        const Bytes taken(next, next + count);
        next += count;
        left -= count;
        return taken;
    }
};

template <typename T>
void append(Bytes& bytes, const T& value) {
    const auto* first = reinterpret_cast<const uint8_t*>(&value);
    bytes.insert(bytes.end(), first, first + sizeof value);
}

Bytes hello() {
    ols_hello_reply reply{};
    reply.layout_hash = OLS_LAYOUT_HASH;
    Bytes payload;
    append(payload, reply);
    return payload;
}

// A log or a list of digests such as a board sends, from what was asked for on.
Bytes honest_list(uint16_t type, uint32_t first, uint32_t count) {
    Bytes payload;
    if (type == OLS_READ_DIGESTS) {
        append(payload, ols_digests_reply{first, first + count, 0, uint16_t(count), 0});
        for (uint32_t n = first; n < first + count; n++) append(payload, ols_cycle_digest{n, n + 1, n, n, 0, 1, 0, 0});
    } else {
        append(payload, ols_trigger_log_reply{first, first + count, 0, uint16_t(count), 0});
        for (uint32_t n = first; n < first + count; n++)
            append(payload, ols_trigger_log_entry{1000ull * n, n, n, uint16_t(n), 1, 0});
    }
    return payload;
}

// What the board sends for a request.
Bytes answer_to(const ols_frame& request, Script& script) {
    const uint8_t how = script.byte();
    uint16_t type = request.type | OLS_REPLY, id = request.request_id;
    Bytes payload;
    uint32_t first = 0;
    if (request.payload_bytes >= sizeof first) std::memcpy(&first, request.payload, sizeof first);
    switch (how % 8) {
        case 0: return script.bytes(script.byte());
        case 1: payload = script.bytes(script.byte() + 4u * script.byte()); break;
        case 2: id = uint16_t(id + script.byte()); break;
        case 3: type = script.byte() | OLS_REPLY; break;
        default: payload = honest_list(request.type, first, script.byte() % 49); break;
    }
    if (request.type == OLS_HELLO && how % 8 != 1) payload = hello();
    if (request.type == OLS_STATUS && how % 8 != 1) payload.assign(sizeof(ols_status_reply), 0);
    if (how & 64)
        for (int changes = script.byte() % 4; changes >= 0 && !payload.empty(); changes--)
            payload[(script.byte() * 8u + script.byte()) % payload.size()] = script.byte();
    payload.resize(std::min<size_t>(payload.size(), OLS_PAYLOAD_BYTES_MAX));
    uint8_t frame[OLS_FRAME_BYTES_MAX];
    const size_t bytes = ols_frame_encode(type, id, payload.data(), payload.size(), frame, sizeof frame);
    return Bytes(frame, frame + bytes);
}

class FuzzedStream : public Transfer {
  public:
    explicit FuzzedStream(Script& script) : script_(script) {}

    Status write(std::span<const uint8_t> bytes, uint32_t, const Deadline&) override {
        expect(ols_frame_parser_write(&parser_, bytes.data(), bytes.size()) == bytes.size());
        for (ols_frame request; ols_frame_parser_read(&parser_, &request);) {
            const Bytes answer = answer_to(request, script_);
            out_.insert(out_.end(), answer.begin(), answer.end());
        }
        taken_ = 0;
        return Done{};
    }
    Result<Bytes> read(size_t capacity, uint32_t, const Deadline&) override {
        if (out_.empty() && (script_.left == 0 || script_.byte() % 4)) return fail("did not answer in time");
        const size_t piece = script_.left == 0 ? capacity : size_t(1 + script_.byte() * 8);
        const size_t count = std::min({capacity, out_.size(), piece});
        Bytes bytes(out_.begin(), out_.begin() + ptrdiff_t(count));
        out_.erase(out_.begin(), out_.begin() + ptrdiff_t(count));
        taken_ += std::max<size_t>(count, 1);
        expect(taken_ <= 5 * 16 * OLS_FRAME_BYTES_MAX);  // the bound of four requests, and a read more
        return bytes;
    }

  private:
    Script& script_;
    ols_frame_parser parser_{};
    Bytes out_;
    size_t taken_ = 0;
};

// A bus whose frames and whose time come from the script; time stands still as long as it likes.
class FuzzedBus : public CanBus {
  public:
    explicit FuzzedBus(Script& script) : script_(script) {}

    Status send(const can_frame& frame, const Deadline&) override {
        expect(frame.can_dlc >= 1 && frame.can_dlc <= 8);
        if (script_.byte() == 255) return fail("the bus is down");
        return Done{};
    }
    Result<std::optional<can_frame>> receive(uint64_t until_us, const Deadline&) override {
        if (script_.left == 0) now_us_ += 10'000;
        const uint8_t how = script_.byte();
        now_us_ += how * 64u;
        if (how % 4 == 0) now_us_ = std::max(now_us_, std::min(until_us, now_us_ + 2'000'000));
        if (how % 4 < 2) return std::optional<can_frame>();
        can_frame frame{};
        frame.can_id = how % 16 == 3 ? 0x100 : OLS_CANBUS_TO_HOST;
        frame.can_dlc = script_.byte() % 9;
        const Bytes data = script_.bytes(frame.can_dlc);
        std::copy(data.begin(), data.end(), frame.data);
        return std::optional(frame);
    }
    uint64_t now_us() const override { return now_us_; }

  private:
    Script& script_;
    uint64_t now_us_ = 0;
};

void use(Board& board, Script& script) {
    (void)board.status();
    const auto entries = read_kept_log(board);
    if (entries.ok()) {
        expect(entries->size() <= log_entries_kept + 4 * OLS_LOG_ENTRIES_MAX);
        for (size_t n = 1; n < entries->size(); n++) {
            expect((*entries)[n].counter > (*entries)[n - 1].counter);
            expect((*entries)[n].rise_ticks > (*entries)[n - 1].rise_ticks);
        }
    }
    const auto digests = read_kept_digests(board);
    if (digests.ok()) expect(digests->size() <= digests_kept + OLS_DIGESTS_MAX);
    if (entries.ok() && digests.ok())
        for (const ols_cycle_digest& digest : *digests) (void)check_cycle(digest, *entries);
    LogReader reader(board, script.byte() * 16u);
    for (uint32_t last = 0; script.left > 0;) {
        const auto log = reader.read_on();
        if (!log.ok()) break;
        expect(reader.next() >= last && reader.fired() >= reader.next());
        last = reader.next();
    }
    (void)board.load(Bytes(1500, 1), 2, 176, 1);
    (void)board.swap();
    board.tell_to_stop();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    Script script{data, size};
    std::unique_ptr<Transfer> transfer;
    if (script.byte() % 4 == 0)
        transfer = can_transfer(std::make_unique<FuzzedBus>(script), 0);
    else
        transfer = std::make_unique<FuzzedStream>(script);
    auto board = Board::connect(std::move(transfer));
    if (board.ok()) use(*board, script);
    return 0;
}
