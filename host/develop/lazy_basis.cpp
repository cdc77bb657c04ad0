// SPDX-License-Identifier: MIT
// Counting in triggers: a capture sequence's come at an even pace.
#include "develop/lazy_basis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "stage/playback.hpp"

namespace ols {

namespace {

std::vector<uint64_t> tracking_slots(const Sequence& sequence) {
    std::vector<uint64_t> slots;
    for (size_t s = 0; s < sequence.slots.size(); ++s)
        if (sequence.slots[s].kind == SlotKind::tracking) slots.push_back(s);
    return slots;
}

// The number of slot `slot` in the cycle where it is nearest to the target, and in the cycle on the other side; nothing
// where the take has no such cycle.
struct Nearest {
    std::optional<uint64_t> nearest, other;
};

Nearest nearest_of(const Sequence& sequence, uint64_t target, uint64_t slot) {
    const auto length = int64_t(sequence.slots.size());
    const int64_t away = (int64_t(slot) - int64_t(target)) % length;
    const int64_t after = away < 0 ? away + length : away,
                  before = after - length;  // from the target, before < 0 <= after
    const auto number = [&](int64_t distance) -> std::optional<uint64_t> {
        const int64_t at = int64_t(target) + distance;
        if (at < 0 || at >= int64_t(sequence.trigger_count())) return std::nullopt;
        return uint64_t(at);
    };
    const bool is_after_nearer = after < -before;
    return {number(is_after_nearer ? after : before), number(is_after_nearer ? before : after)};
}

}  // namespace

double tracking_rate_hz(const Sequence& sequence) {
    return double(tracking_slots(sequence).size()) * double(tick_hz) / double(sequence.cycle_ticks());
}

double target_rate_hz(const Sequence& sequence, int every) {
    return tracking_rate_hz(sequence) / every;
}

// The cameras' frame rates nearest to the sequence's, below and above, whose tracking frames are a multiple of fps.
static std::string frame_rates_for(const Sequence& sequence, double fps) {
    const double rate = tracking_rate_hz(sequence);
    const double slots = double(sequence.slots.size()) / double(tracking_slots(sequence).size());
    const double below = std::floor(rate / fps) * fps * slots, above = std::ceil(rate / fps) * fps * slots;
    return below > 0 ? fmt::format("{:.6g}, or {:.6g} where the cameras can", below, above)
                     : fmt::format("{:.6g}", above);
}

Result<int> tracking_frames_a_target(const Sequence& sequence, double fps) {
    const double rate = tracking_rate_hz(sequence);
    if (rate == 0) return fail("the sequence has no tracking slots: motion cannot be compensated without");
    const int every = int(std::lround(rate / fps));
    if (every >= 1 && std::abs(every * fps / rate - 1) < 1e-3) return every;
    std::string rates;
    for (const int n : {1, 2, 3, 4, 5, 6, 8, 10}) rates += fmt::format("{}{:.5g}", n > 1 ? ", " : "", rate / n);
    return fail(
        fmt::format("{} targets a second: targets stand at tracking frames, of which a second has {:.5g}; there "
                    "can be {} a second. For {}, say in the sequence frame_rate_hz = {}",
                    fps, rate, rates, fps, frame_rates_for(sequence, fps)));
}

std::vector<int> evenly_apart(const Sequence& sequence, int every, double apart_s) {
    const double between_s = every / tracking_rate_hz(sequence);
    constexpr double tolerance = 0.01;  // of a part: rates are whole ticks
    const int parts = apart_s > 0 ? int(std::clamp(between_s / apart_s + tolerance, 1.0, double(every))) : every;
    std::vector<int> frames;
    for (int part = 0; part < parts; ++part) frames.push_back((2 * part * every + parts) / (2 * parts));
    return frames;
}

uint64_t tracking_frames_before(const Sequence& sequence, uint64_t number) {
    const std::vector<uint64_t> tracking = tracking_slots(sequence);
    const uint64_t length = sequence.slots.size();
    return number / length * tracking.size() +
           uint64_t(std::ranges::lower_bound(tracking, number % length) - tracking.begin());
}

std::vector<uint64_t> target_numbers(const Sequence& sequence, int every) {
    const std::vector<uint64_t> tracking = tracking_slots(sequence);
    const auto is_whole = [&](uint64_t target) {
        for (size_t s = 0; s < sequence.slots.size(); ++s)
            if (sequence.slots[s].kind == SlotKind::basis && !nearest_of(sequence, target, s).nearest) return false;
        return true;
    };
    std::vector<uint64_t> targets;
    int since = 0;  // tracking frames since the last target
    for (uint64_t cycle = 0; cycle < uint64_t(sequence.config.cycles); ++cycle)
        for (const uint64_t slot : tracking) {
            const uint64_t number = cycle * sequence.slots.size() + slot;
            if (!targets.empty() && ++since < every) continue;
            if (!is_whole(number)) continue;
            targets.push_back(number);
            since = 0;
        }
    return targets;
}

LazyBasis gather_basis(const Sequence& sequence, uint64_t target, const std::function<bool(uint64_t)>& is_recorded) {
    LazyBasis basis;
    basis.target = target;
    for (size_t s = 0; s < sequence.slots.size(); ++s) {
        if (sequence.slots[s].kind != SlotKind::basis) continue;
        const Nearest at = nearest_of(sequence, target, s);
        const auto other = at.other && is_recorded(*at.other) ? at.other : std::nullopt;
        if (at.nearest && is_recorded(*at.nearest))
            basis.choices.push_back({*at.nearest, int(s), false, other});
        else if (other)
            basis.choices.push_back({*other, int(s), true, {}});
        else
            basis.lost.push_back(int(s));
    }
    return basis;
}

FrameRange frames_around(const Sequence& sequence, uint64_t target) {
    const uint64_t cycle = sequence.slots.size(), last = sequence.trigger_count() - 1;
    return {target > cycle ? target - cycle : 0, std::min(target + cycle, last)};
}

}  // namespace ols
