// SPDX-License-Identifier: MIT
// A board that plays by a clock of the test's: it takes any program and speaks the protocol at the other end of a Transfer, without
// hardware or emulation, so that it costs next to nothing.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "device/board.hpp"
#include "frame.h"
#include "layout_hash.h"
#include "wire.h"

namespace ols::test {

// Thread-safe.
class PlayedBoard {
  public:
    static constexpr uint64_t first_rise_ticks = 1000;

    // `ticks`: the clock, which goes on by itself. Triggers come each `period_ticks` from the start on.
    PlayedBoard(std::function<uint64_t()> ticks, uint32_t period_ticks)
        : ticks_(std::move(ticks)), period_ticks_(period_ticks) {}

    std::unique_ptr<Transfer> connect() { return std::make_unique<End>(*this); }

    // By the clock, when it was started; nothing before.
    std::optional<uint64_t> started_ticks() const {
        const std::lock_guard lock(mutex_);
        return started_;
    }
    uint32_t triggers_fired() const {
        const std::lock_guard lock(mutex_);
        return fired();
    }

  private:
    class End : public Transfer {
      public:
        explicit End(PlayedBoard& board) : board_(board) {}
        Status write(std::span<const uint8_t> bytes, uint32_t, const Deadline&) override {
            const std::lock_guard lock(board_.mutex_);
            ols_frame frame;
            for (size_t at = 0; at < bytes.size();) {
                at += ols_frame_parser_write(&parser_, bytes.data() + at, bytes.size() - at);
                while (ols_frame_parser_read(&parser_, &frame)) board_.answer(frame, replies_);
            }
            return Done{};
        }
        Result<std::vector<uint8_t>> read(size_t capacity, uint32_t, const Deadline&) override {
            if (replies_.empty()) return fail("the board says nothing");
            const auto end = replies_.begin() + ptrdiff_t(std::min(capacity, replies_.size()));
            std::vector<uint8_t> bytes(replies_.begin(), end);
            replies_.erase(replies_.begin(), end);
            return bytes;
        }

      private:
        PlayedBoard& board_;
        ols_frame_parser parser_{};
        std::vector<uint8_t> replies_;
    };

    // Since the start; of a stopped board, until its stop.
    uint64_t now_ticks() const { return !started_ ? 0 : stopped_.value_or(ticks_()) - *started_; }
    uint32_t triggers() const { return slots_ * cycles_; }
    uint32_t fired() const {
        const uint64_t now = now_ticks();
        if (now < first_rise_ticks) return 0;
        return uint32_t(std::min<uint64_t>((now - first_rise_ticks) / period_ticks_ + 1, triggers()));
    }
    uint8_t state() const {
        if (stopped_ || !started_) return OLS_STATE_LOADED;
        return now_ticks() > first_rise_ticks + uint64_t(triggers()) * period_ticks_ ? OLS_STATE_DONE
                                                                                     : OLS_STATE_PLAYING;
    }

    static void reply(const ols_frame& request, const void* payload, size_t bytes, std::vector<uint8_t>& out) {
        uint8_t frame[OLS_FRAME_BYTES_MAX];
        const size_t size =
            ols_frame_encode(request.type | OLS_REPLY, request.request_id, payload, bytes, frame, sizeof frame);
        out.insert(out.end(), frame, frame + size);
    }

    void answer(const ols_frame& request, std::vector<uint8_t>& out) {
        ols_hello_reply hello{};
        switch (request.type) {
            case OLS_HELLO:
                hello.layout_hash = OLS_LAYOUT_HASH;
                hello.boot_nonce = 1, hello.tick_hz = 125'000'000;
                std::strcpy(hello.board, "played");
                return reply(request, &hello, sizeof hello, out);
            case OLS_LOAD_BEGIN: {
                ols_load_begin begin;
                std::memcpy(static_cast<void*>(&begin), request.payload, sizeof begin);
                slots_ = begin.slot_count, cycles_ = begin.cycles;
                started_.reset(), stopped_.reset();
                break;
            }
            case OLS_START: started_ = ticks_(); break;
            case OLS_STOP: stopped_ = ticks_(); break;
            case OLS_STATUS: {
                ols_status_reply status{};
                status.state = state(), status.boot_nonce = 1, status.now_ticks = now_ticks();
                status.fault_slot = OLS_NO_SLOT, status.triggers_fired = fired();
                return reply(request, &status, sizeof status, out);
            }
            case OLS_READ_TRIGGER_LOG: return answer_log(request, out);
        }
        reply(request, nullptr, 0, out);
    }

    void answer_log(const ols_frame& request, std::vector<uint8_t>& out) const {
        ols_read_trigger_log asked;
        std::memcpy(&asked, request.payload, sizeof asked);
        const uint32_t first = std::min<uint32_t>(asked.first_counter, fired());
        const uint32_t count = std::min({fired() - first, uint32_t(asked.entries_max), uint32_t(OLS_LOG_ENTRIES_MAX)});
        const ols_trigger_log_reply head{first, fired(), 0, uint16_t(count), 0};
        std::vector<uint8_t> payload(sizeof head + count * sizeof(ols_trigger_log_entry));
        std::memcpy(payload.data(), &head, sizeof head);
        for (uint32_t n = 0; n < count; ++n) {
            const uint32_t counter = first + n;
            const ols_trigger_log_entry entry{(first_rise_ticks + uint64_t(counter) * period_ticks_) & ~1ull,
                                              counter,
                                              counter / slots_,
                                              uint16_t(counter % slots_),
                                              1,
                                              0};
            std::memcpy(&payload[sizeof head + n * sizeof entry], &entry, sizeof entry);
        }
        reply(request, payload.data(), payload.size(), out);
    }

    const std::function<uint64_t()> ticks_;
    const uint32_t period_ticks_;
    mutable std::mutex mutex_;
    uint32_t slots_ = 0, cycles_ = 0;
    std::optional<uint64_t> started_, stopped_;  // by the clock
};

}  // namespace ols::test
