// SPDX-License-Identifier: MIT
// Causes: why a slot has no frame. One enumeration for the manifest, the log and the report.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace ols {

enum class Cause {
    none,
    board_did_not_fire,     // by its own log, or it ended before
    camera_missed_trigger,  // it fired, and the camera's count did not step
    link_lost_it,           // the camera counted the frame, and it did not come, not whole, or far too late
    host_was_late,          // it came, and there was no room: this program, or its processor, was behind
    disk_was_late,          // the same, and what was waited for was a disk
    no_light,               // it came, and is dark where its slot is lit
    stale,                  // it came with the samples of an earlier one
    swapped,                // it came with the light of another slot
    wrong_size,             // it came with another size or format than the stage's
    restarted,              // the camera or its clock began anew
    not_proved,             // it came, and which slot's it is could not be proved
    no_frame,               // none came, and no later one tells whether the camera or the link is to blame
    log_lost_it,            // it came, and the board's log does not tell of its trigger
    camera_gone,            // the camera failed or ended before
    board_gone,             // the board is heard no more
    stopped,                // the take was stopped
};
constexpr size_t cause_count = size_t(Cause::stopped) + 1;

// "link_lost_it", as JSON has it.
const char* cause_name(Cause cause);

// "link lost it", as people read it.
std::string cause_words(Cause cause);

// A cause with what is known of this case. Empty (none, "") where nothing is wrong.
struct Reason {
    Cause cause = Cause::none;
    std::string text = "";

    bool empty() const { return cause == Cause::none; }
    friend bool operator==(const Reason&, const Reason&) = default;
};

// How many slots are missing by each cause.
class CauseCounts {
  public:
    void add(Cause cause, uint64_t count = 1) { counts_[size_t(cause)] += count; }
    void add(const CauseCounts& other) {
        for (size_t i = 0; i < cause_count; ++i) counts_[i] += other.counts_[i];
    }
    uint64_t of(Cause cause) const { return counts_[size_t(cause)]; }
    uint64_t total() const;

    nlohmann::json to_json() const;  // {"link_lost_it": 9, ...}, those that are not 0
    std::string to_words() const;    // "9 link lost it, 2 stale", most first

  private:
    std::array<uint64_t, cause_count> counts_{};
};

}  // namespace ols
