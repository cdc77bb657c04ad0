// SPDX-License-Identifier: MIT
// Board: the sequencer board as a typed client of protocol/wire.h, one function a message.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device/board_replies.hpp"
#include "device/transfer.hpp"
#include "frame.h"
#include "stage/playback.hpp"
#include "wire.h"

namespace ols {

// "timeline_starved: ..." with what to do, for a latched fault (enum ols_fault).
std::string fault_text(const ols_status_reply& status);

const char* state_name(uint8_t state);

// One request at a time; not for use by two threads at once. Every function fails when the board is gone, does not
// answer within a second of its own time, takes longer than the patience for the whole exchange, sends more than some frames
// without the answer among them, answers with what the request has no room for, or refuses; a refusal carries the board's own
// words. Errors name the board.
class Board {
  public:
    // Says hello. A board of another message layout is refused: the error says to flash this release's firmware.
    static Result<Board> connect(std::unique_ptr<Transfer> transfer, const Patience& patience = Patience());

    // For flashing: a board of any layout is good enough. Only reboot_to_bootloader and layout_hash may be used of one
    // whose layout is another.
    static Result<Board> connect_any_layout(std::unique_ptr<Transfer> transfer, const Patience& patience = Patience());
    std::string name() const { return transfer_->name(); }  // for errors: "the board at 'PATH'"
    Deadline begin_exchange() { return patience_.begin_exchange(); }
    uint64_t layout_hash() const { return info_.layout_hash; }
    bool same_layout() const;

    const ols_hello_reply& info() const { return info_; }
    std::string id() const;  // the flash chip's unique number, in hex

    // Sends a program (encode_program) of `slot_count` slots in chunks; `cycles` 0 plays until stopped. While the board plays
    // it is the one that swap lets follow.
    Status load(std::span<const uint8_t> program, uint16_t slot_count, uint16_t chain_bits, uint32_t cycles,
                const Playback& playback = {});
    Status arm(const Playback& playback = {});
    // Lets the program loaded last follow at the end of a cycle, which the reply names.
    Result<ols_swap_reply> swap();
    Status start();
    Status stop();
    void tell_to_stop();  // one that may be heard no more: waits for no answer, and a second at most
    Status clear_fault();
    Result<ols_status_reply> status();
    Status reboot_to_bootloader();  // the board leaves; refused while a program is armed or plays

    // A message of another program's as it is, and the board's reply as it is, a refusal too (board_relay.hpp).
    struct RawReply {
        uint16_t type = 0;
        std::vector<uint8_t> payload;
    };
    Result<RawReply> pass_on(uint16_t type, std::span<const uint8_t> payload);

    // The log from `first_counter` on. Asks for one message of it, or, when triggers up to `known_counter` are known to have
    // fired, for up to four at once: at 20 000 triggers a second a message fills in 2.4 ms, which a host that waits for each
    // reply may not keep up with.
    Result<TriggerLog> read_trigger_log(uint32_t first_counter, uint32_t known_counter = 0);

    // The digests from number `first_digest` on, as many as one message holds.
    Result<CycleDigests> read_digests(uint32_t first_digest);

  private:
    // What is left for requests that are sent together, and their replies.
    struct Exchange {
        Deadline deadline;
        size_t bytes_left;
    };

    Board(std::unique_ptr<Transfer> transfer, const Patience& patience);

    Exchange begin(size_t requests);
    // Sends a request and waits for its reply, whose payload it returns.
    Result<std::vector<uint8_t>> request(uint16_t type, std::span<const uint8_t> payload);
    // The two halves of that: appends the request to `bytes`, and returns its id; waits for the reply to that id.
    uint16_t add_request(uint16_t type, std::span<const uint8_t> payload, std::vector<uint8_t>& bytes);
    Result<std::vector<uint8_t>> wait_for_reply(uint16_t type, uint16_t request_id, Exchange& exchange);
    Result<RawReply> wait_for_any_reply(uint16_t request_id, Exchange& exchange);
    Status receive(Exchange& exchange);
    Status command(uint16_t type, std::span<const uint8_t> payload = {});
    template <typename Reply>
    Result<Reply> ask(uint16_t type);
    Error says(const std::string& what) const { return fail(name() + " " + what); }
    Error not_sound(const Error& reply) const { return says(reply.message + "; reset it and start over"); }
    Error refusal(std::span<const uint8_t> payload) const;
    Error wrong_length(uint16_t type, size_t bytes) const;

    std::unique_ptr<Transfer> transfer_;
    Patience patience_;
    std::unique_ptr<ols_frame_parser> parser_;
    std::vector<uint8_t> received_;  // bytes that the parser has not taken yet
    uint16_t last_request_id_ = 0;
    ols_hello_reply info_{};
};

}  // namespace ols
