// SPDX-License-Identifier: MIT
// Requests and replies of protocol/wire.h over a Transfer.
#include "device/board.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "layout_hash.h"

namespace ols {

namespace {

constexpr uint32_t reply_timeout_us = 1'000'000;
// Of 22 bytes each: two packets. The board takes in one and keeps another while it waits for somebody to read its first
// reply; a third would not be taken, and the write not end.
constexpr uint32_t log_messages_at_once = 4;
// Bytes among which a reply must be: it is one frame, behind those to a few requests given up. A read of nothing counts as one.
constexpr size_t bytes_a_reply = 16 * OLS_FRAME_BYTES_MAX;
constexpr int last_word_ms = 1000;
constexpr size_t packet_bytes = 64;  // full-speed bulk: a read must hold whole packets
constexpr size_t read_bytes = (OLS_FRAME_BYTES_MAX + packet_bytes - 1) / packet_bytes * packet_bytes;

template <typename T>
std::span<const uint8_t> bytes_of(const T& value) {
    return {reinterpret_cast<const uint8_t*>(&value), sizeof value};
}

template <size_t N>
void make_printable(char (&text)[N]) {
    const std::string ascii = printable(std::span<const char>(text, N - 1));
    std::memset(text, 0, N);
    std::memcpy(text, ascii.data(), ascii.size());
}

}  // namespace

std::string fault_text(const ols_status_reply& status) {
    const char* text = "unknown_fault: flash the firmware of this release: make flash";
    switch (status.fault) {
        case OLS_FAULT_NONE: return "none";
        case OLS_FAULT_TIMELINE_STARVED:
            text = "timeline_starved: the next event was not ready in time; lengthen the slots' periods";
            break;
        case OLS_FAULT_SHIFTER_STARVED:
            text = "shifter_starved: the next pattern was not ready in time; lengthen the slots' periods";
            break;
        case OLS_FAULT_SLIPPED:
            text = "slipped: a trigger was not at its scheduled tick; check the board's clock and trigger wiring";
            break;
        case OLS_FAULT_HOST_LOST: text = "host_lost: the USB bus was reset or unplugged; check the cable"; break;
        case OLS_FAULT_WATCHDOG: text = "watchdog: the processor hung and was reset; report this with its log"; break;
        case OLS_FAULT_PROCESSOR: text = "processor: a hard fault; report this with its log"; break;
        case OLS_FAULT_BAD_MEMORY:
            text = "bad_memory: the program in memory changed; load it again, and check the power supply";
            break;
        case OLS_FAULT_EMERGENCY_STOP:
            text = "emergency_stop: the button was pressed or its wire is open; release it when the stage is safe";
            break;
        case OLS_FAULT_OVER_TEMPERATURE:
            text = "over_temperature: a lamp driver is too hot; let it cool, and check the exposures";
            break;
        case OLS_FAULT_OPEN_LAMP: text = "open_lamp: a lamp driver found no lamp; check lamps and wiring"; break;
        case OLS_FAULT_HEARTBEAT:
            text = "heartbeat: the host was silent for too long; check its load, or arm with a longer time";
            break;
        case OLS_FAULT_OVER_DUTY:
            text =
                "over_duty: a light was longer than the program's longest; do not use this board before it is checked";
            break;
        case OLS_FAULT_LIGHT_STUCK:
            text =
                "light_stuck: LIGHT_EN is lit although the board holds it dark; switch the lamps' supply off and check "
                "the wiring";
            break;
    }
    const std::string slot =
        status.fault_slot == OLS_NO_SLOT ? "" : fmt::format(" in slot {}", uint16_t(status.fault_slot));
    return fmt::format("{} (at tick {}{})", text, uint64_t(status.fault_ticks), slot);
}

const char* state_name(uint8_t state) {
    switch (state) {
        case OLS_STATE_IDLE: return "idle";
        case OLS_STATE_LOADED: return "loaded";
        case OLS_STATE_ARMED: return "armed";
        case OLS_STATE_PLAYING: return "playing";
        case OLS_STATE_DONE: return "done";
        case OLS_STATE_FAULT: return "fault";
        case OLS_STATE_WAITING: return "waiting";
        default: return "unknown";
    }
}

Board::Board(std::unique_ptr<Transfer> transfer, const Patience& patience)
    : transfer_(std::move(transfer)), patience_(patience), parser_(std::make_unique<ols_frame_parser>()) {}

Error Board::refusal(std::span<const uint8_t> payload) const {
    ols_error_reply error{};
    if (payload.size() <= offsetof(ols_error_reply, text)) return wrong_length(OLS_ERROR, payload.size());
    // The text of another release may be shorter or longer.
    std::memcpy(&error, payload.data(), std::min(payload.size(), sizeof error));
    const std::string text = printable(error.text);
    if (error.slot == OLS_NO_SLOT) return says("refused: " + text);
    return says(fmt::format("refused: {} (slot {})", text, uint16_t(error.slot)));
}

Error Board::wrong_length(uint16_t type, size_t bytes) const {
    return says(fmt::format(
        "answered message {:#04x} with {} bytes, which this release does not know: flash the firmware of this "
        "release: make flash",
        type, bytes));
}

Result<Board> Board::connect(std::unique_ptr<Transfer> transfer, const Patience& patience) {
    auto board = connect_any_layout(std::move(transfer), patience);
    if (board.ok() && !board->same_layout())
        return board->says(
            fmt::format("speaks message layout {:016x} and this program {:016x}: flash the firmware of this release: "
                        "make flash",
                        board->layout_hash(), uint64_t(OLS_LAYOUT_HASH)));
    return board;
}

Result<Board> Board::connect_any_layout(std::unique_ptr<Transfer> transfer, const Patience& patience) {
    Board board(std::move(transfer), patience);
    const ols_hello hello{OLS_LAYOUT_HASH};
    const auto payload = board.request(OLS_HELLO, bytes_of(hello));
    if (!payload.ok()) return payload.error();
    // The hash, the first member, comes first in every version of the reply, so it is compared before the length.
    if (payload->size() < sizeof board.info_.layout_hash) return board.wrong_length(OLS_HELLO, payload->size());
    std::memcpy(static_cast<void*>(&board.info_), payload->data(), sizeof board.info_.layout_hash);
    if (!board.same_layout()) return board;
    if (payload->size() != sizeof board.info_) return board.wrong_length(OLS_HELLO, payload->size());
    std::memcpy(&board.info_, payload->data(), sizeof board.info_);
    make_printable(board.info_.firmware_version);
    make_printable(board.info_.board);
    return board;
}

bool Board::same_layout() const {
    return info_.layout_hash == OLS_LAYOUT_HASH;
}

std::string Board::id() const {
    std::string hex;
    for (const uint8_t byte : info_.board_id) hex += fmt::format("{:02x}", byte);
    return hex;
}

uint16_t Board::add_request(uint16_t type, std::span<const uint8_t> payload, std::vector<uint8_t>& bytes) {
    uint8_t frame[OLS_FRAME_BYTES_MAX];
    const uint16_t request_id = ++last_request_id_;
    const size_t frame_bytes = ols_frame_encode(type, request_id, payload.data(), payload.size(), frame, sizeof frame);
    assert(frame_bytes > 0);
    bytes.insert(bytes.end(), frame, frame + frame_bytes);
    return request_id;
}

Board::Exchange Board::begin(size_t requests) {
    return {begin_exchange(), requests * bytes_a_reply};
}

// Gives the parser what has come, or waits for more.
Status Board::receive(Exchange& exchange) {
    if (received_.empty()) {
        if (exchange.bytes_left == 0)
            return says("sends, but not the answer to what it was asked: reset it and start over");
        auto bytes = transfer_->read(read_bytes, reply_timeout_us, exchange.deadline);
        if (!bytes.ok()) return bytes.error();
        received_ = std::move(*bytes);
        exchange.bytes_left -= std::min(exchange.bytes_left, std::max<size_t>(received_.size(), 1));
        if (received_.empty()) return Done{};
    }
    const size_t taken = ols_frame_parser_write(parser_.get(), received_.data(), received_.size());
    received_.erase(received_.begin(), received_.begin() + ptrdiff_t(taken));
    return Done{};
}

Result<Board::RawReply> Board::wait_for_any_reply(uint16_t request_id, Exchange& exchange) {
    for (;;) {
        ols_frame reply;
        while (ols_frame_parser_read(parser_.get(), &reply)) {
            // A reply to a request that was given up earlier is nobody's any more.
            if (reply.request_id != request_id) continue;
            return RawReply{reply.type, {reply.payload, reply.payload + reply.payload_bytes}};
        }
        if (const Status more = receive(exchange); !more.ok()) return more.error();
    }
}

Result<std::vector<uint8_t>> Board::wait_for_reply(uint16_t type, uint16_t request_id, Exchange& exchange) {
    auto reply = wait_for_any_reply(request_id, exchange);
    if (!reply.ok()) return reply.error();
    if (reply->type == (OLS_ERROR | OLS_REPLY)) return refusal(reply->payload);
    if (reply->type == (type | OLS_REPLY)) return std::move(reply->payload);
    return says(
        fmt::format("answered message {:#04x} with one of type {:#04x}: reset it and start over", type, reply->type));
}

Result<Board::RawReply> Board::pass_on(uint16_t type, std::span<const uint8_t> payload) {
    Exchange exchange = begin(1);
    std::vector<uint8_t> bytes;
    const uint16_t request_id = add_request(type, payload, bytes);
    if (const Status sent = transfer_->write(bytes, reply_timeout_us, exchange.deadline); !sent.ok())
        return sent.error();
    return wait_for_any_reply(request_id, exchange);
}

Result<std::vector<uint8_t>> Board::request(uint16_t type, std::span<const uint8_t> payload) {
    Exchange exchange = begin(1);
    std::vector<uint8_t> bytes;
    const uint16_t request_id = add_request(type, payload, bytes);
    if (const Status sent = transfer_->write(bytes, reply_timeout_us, exchange.deadline); !sent.ok())
        return sent.error();
    return wait_for_reply(type, request_id, exchange);
}

Status Board::command(uint16_t type, std::span<const uint8_t> payload) {
    const auto reply = request(type, payload);
    if (!reply.ok()) return reply.error();
    if (!reply->empty()) return wrong_length(type, reply->size());
    return Done{};
}

template <typename Reply>
Result<Reply> Board::ask(uint16_t type) {
    const auto bytes = request(type, {});
    if (!bytes.ok()) return bytes.error();
    if (bytes->size() != sizeof(Reply)) return wrong_length(type, bytes->size());
    Reply reply;
    std::memcpy(&reply, bytes->data(), sizeof reply);
    return reply;
}

Status Board::load(std::span<const uint8_t> program, uint16_t slot_count, uint16_t chain_bits, uint32_t cycles,
                   const Playback& playback) {
    ols_load_begin begin{};
    describe_triggers(playback, begin);
    begin.slot_count = slot_count;
    begin.chain_bits = chain_bits;
    begin.cycles = cycles;
    begin.program_bytes = uint32_t(program.size());
    begin.program_crc32 = ols_crc32(0, program.data(), program.size());
    if (const Status begun = command(OLS_LOAD_BEGIN, bytes_of(begin)); !begun.ok()) return begun;
    constexpr size_t data_bytes_max = OLS_PAYLOAD_BYTES_MAX - sizeof(ols_load_chunk);
    for (size_t offset = 0; offset < program.size(); offset += data_bytes_max) {
        const ols_load_chunk chunk{uint32_t(offset)};
        const auto data = program.subspan(offset, std::min(data_bytes_max, program.size() - offset));
        std::vector<uint8_t> payload(sizeof chunk + data.size());
        std::memcpy(payload.data(), &chunk, sizeof chunk);
        std::copy(data.begin(), data.end(), payload.begin() + sizeof chunk);
        if (const Status taken = command(OLS_LOAD_CHUNK, payload); !taken.ok()) return taken;
    }
    return command(OLS_LOAD_END);
}

Status Board::arm(const Playback& playback) {
    const ols_arm arm = arm_message(playback);
    return command(OLS_ARM, bytes_of(arm));
}

Status Board::start() {
    return command(OLS_START);
}

Status Board::stop() {
    return command(OLS_STOP);
}

void Board::tell_to_stop() {
    Patience brief(last_word_ms);
    std::vector<uint8_t> bytes;
    add_request(OLS_STOP, {}, bytes);
    (void)transfer_->write(bytes, reply_timeout_us, brief.begin_exchange());
}

Status Board::clear_fault() {
    return command(OLS_CLEAR_FAULT);
}

Status Board::reboot_to_bootloader() {
    return command(OLS_REBOOT_TO_BOOTLOADER);
}

Result<ols_swap_reply> Board::swap() {
    return ask<ols_swap_reply>(OLS_SWAP);
}

Result<ols_status_reply> Board::status() {
    auto status = ask<ols_status_reply>(OLS_STATUS);
    if (status.ok() && status->state > OLS_STATE_WAITING)
        return says(fmt::format("says that it is in state {}, which there is not: reset it", status->state));
    return status;
}

Result<TriggerLog> Board::read_trigger_log(uint32_t first_counter, uint32_t known_counter) {
    const uint32_t waiting = known_counter > first_counter ? known_counter - first_counter : 0;
    const uint32_t messages = std::clamp(waiting / OLS_LOG_ENTRIES_MAX, 1u, log_messages_at_once);
    Exchange exchange = begin(messages);
    std::vector<uint8_t> bytes;
    std::vector<std::pair<uint16_t, ols_read_trigger_log>> asked;
    for (uint32_t n = 0; n < messages; ++n) {
        const ols_read_trigger_log what{first_counter + n * OLS_LOG_ENTRIES_MAX, OLS_LOG_ENTRIES_MAX, 0};
        asked.emplace_back(add_request(OLS_READ_TRIGGER_LOG, bytes_of(what), bytes), what);
    }
    if (const Status sent = transfer_->write(bytes, reply_timeout_us, exchange.deadline); !sent.ok())
        return sent.error();
    TriggerLog log;
    for (const auto& [id, what] : asked) {
        const auto reply = wait_for_reply(OLS_READ_TRIGGER_LOG, id, exchange);
        if (!reply.ok()) return reply.error();
        const auto more = parse_trigger_log(*reply, what);
        if (!more.ok()) return not_sound(more.error());
        if (const Status goes_on = append_log(log, *more); !goes_on.ok()) return not_sound(goes_on.error());
    }
    return log;
}

Result<CycleDigests> Board::read_digests(uint32_t first_digest) {
    const ols_read_digests what{first_digest, OLS_DIGESTS_MAX, 0};
    const auto reply = request(OLS_READ_DIGESTS, bytes_of(what));
    if (!reply.ok()) return reply.error();
    auto read = parse_digests(*reply, what);
    if (!read.ok()) return not_sound(read.error());
    return read;
}

}  // namespace ols
