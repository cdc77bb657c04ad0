// SPDX-License-Identifier: MIT
// Board: the sequencer board as a typed client of protocol/wire.h, one function a message.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device/transfer.hpp"
#include "frame.h"
#include "stage/playback.hpp"
#include "wire.h"

namespace ols {

// What the trigger log says of one request.
struct TriggerLog {
    std::vector<ols_trigger_log_entry> entries;
    uint32_t next_counter = 0;  // that the next trigger will have
    uint32_t entries_lost = 0;  // since start: the board's log had no room
};

// The digests of cycles that one request gave.
struct CycleDigests {
    std::vector<ols_cycle_digest> digests;
    uint32_t first_digest = 0;  // number of the first of them
    uint32_t next_digest = 0;   // number that the next one will have
    uint32_t digests_lost = 0;  // since start: overwritten before they were read
};

// "timeline_starved: ..." with what to do, for a latched fault (enum ols_fault).
std::string fault_text(const ols_status_reply& status);

const char* state_name(uint8_t state);

// One request at a time; not for use by two threads at once. Every function fails when the board is gone, does not
// answer within a second of its own time, or refuses; a refusal carries the board's own words.
class Board {
  public:
    // Says hello. A board of another message layout is refused: the error says to flash this release's firmware.
    static Result<Board> connect(std::unique_ptr<Transfer> transfer);

    // For flashing: a board of any layout is good enough. Only reboot_to_bootloader and layout_hash may be used of one
    // whose layout is another.
    static Result<Board> connect_any_layout(std::unique_ptr<Transfer> transfer);
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
    Status clear_fault();
    Result<ols_status_reply> status();
    Status reboot_to_bootloader();  // the board leaves; refused while a program is armed or plays

    // The log from `first_counter` on. Asks for one message of it, or, when triggers up to `known_counter` are known to have
    // fired, for up to four at once: at 20 000 triggers a second a message fills in 2.4 ms, which a host that waits for each
    // reply may not keep up with.
    Result<TriggerLog> read_trigger_log(uint32_t first_counter, uint32_t known_counter = 0);

    // The digests from number `first_digest` on, as many as one message holds.
    Result<CycleDigests> read_digests(uint32_t first_digest);

  private:
    explicit Board(std::unique_ptr<Transfer> transfer);

    // Sends a request and waits for its reply, whose payload it returns.
    Result<std::vector<uint8_t>> request(uint16_t type, std::span<const uint8_t> payload);
    // The two halves of that: appends the request to `bytes`, and returns its id; waits for the reply to that id.
    uint16_t add_request(uint16_t type, std::span<const uint8_t> payload, std::vector<uint8_t>& bytes);
    Result<std::vector<uint8_t>> wait_for_reply(uint16_t type, uint16_t request_id);
    Status command(uint16_t type);
    template <typename Reply>
    Result<Reply> ask(uint16_t type, std::span<const uint8_t> payload = {});

    std::unique_ptr<Transfer> transfer_;
    std::unique_ptr<ols_frame_parser> parser_;
    std::vector<uint8_t> received_;  // bytes that the parser has not taken yet
    uint16_t last_request_id_ = 0;
    ols_hello_reply info_{};
};

}  // namespace ols
