// SPDX-License-Identifier: MIT
// Drawing without replacement: kinds of slots in turn as long as they last, single triggers and bursts, neighbours of other faults,
// and the ends of the take.
#include "injection.hpp"

#include <algorithm>
#include <array>

namespace ols::test {

namespace {

// Of the slots of a kind so many are struck at most: landmarks that are all gone prove nothing.
constexpr double struck_max = 0.25;
// Faults that move frames in the order of delivery, by up to so many.
constexpr int64_t late_within_frames = 10, late_beyond_frames = 40;

class Drawing {
  public:
    Drawing(const Sequence& sequence, uint64_t seed)
        : sequence_(sequence), random_(seed), end_(sequence.trigger_count()) {
        for (size_t n = 0; n < sequence.slots.size(); ++n) places_[size_t(sequence.slots[n].kind)].push_back(n);
    }

    void strike(const FaultSpec& spec, Injection& injection) {
        int left = spec.count;
        // The ends of the take first.
        for (const uint64_t edge : {uint64_t(0), end_ - 1})
            if (spec.count >= 100 && left > 0) left -= put(spec, injection, edge, 1);
        for (int turn = 0; left > 0 && turn < 1000 * spec.count; ++turn) {
            const bool is_burst = spec.burst_max > 1 && draw_share() < spec.bursts;
            const int length = is_burst ? 2 + int(draw(uint64_t(spec.burst_max - 1))) : 1;
            left -= put(spec, injection, draw_trigger(turn, injection), std::min(length, left));
        }
    }
    void stall(const StallSpec& spec, Injection& injection) {
        // Each needs a stretch of its own: as many frames as are in flight before the first finds no room.
        for (int n = 0; n < spec.episodes; ++n)
            injection.stalls[end_ / uint64_t(spec.episodes) * uint64_t(n) + draw(200)] = {spec.disk, spec.frames};
    }
    uint64_t draw_trigger(int turn, const Injection& injection) {
        // Every eighth beside another fault.
        if (turn % 8 == 7 && !injection.strikes.empty()) {
            auto beside = injection.strikes.lower_bound(draw(end_));
            if (beside == injection.strikes.end()) beside = injection.strikes.begin();
            return std::min(end_ - 1, beside->first + 1);
        }
        const auto& places = places_[size_t(turn % 4)];
        if (places.empty()) return draw(end_);
        return draw(uint64_t(sequence_.config.cycles)) * sequence_.slots.size() + places[draw(places.size())];
    }

  private:
    uint64_t draw(uint64_t below) { return random_() % below; }
    double draw_share() { return double(random_() % 1'000'000) / 1e6; }

    int64_t draw_amount(const FaultSpec& spec) {
        if (spec.kind == FaultKind::late_within) return 2 + int64_t(draw(late_within_frames - 1));
        if (spec.kind == FaultKind::late_beyond) return late_beyond_frames;
        return spec.jump_ns;
    }
    // How many were free.
    int put(const FaultSpec& spec, Injection& injection, uint64_t first, int length) {
        int count = 0;
        for (uint64_t n = first; n < std::min(end_, first + uint64_t(length)); ++n) {
            const auto kind = size_t(sequence_.slots[n % sequence_.slots.size()].kind);
            const double most = struck_max * double(places_[kind].size()) * double(sequence_.config.cycles);
            if (!can_strike(spec.kind, n) || struck_[kind] >= most || (spec.apart && is_beside_another(n, injection)) ||
                !injection.strikes.emplace(n, Strike{spec.kind, draw_amount(spec)}).second)
                continue;
            ++struck_[kind];
            ++count;
        }
        return count;
    }
    // There is an older buffer, and frames that come before one that is late.
    bool can_strike(FaultKind kind, uint64_t n) const {
        if (kind == FaultKind::stale_buffer) return n > 0;
        if (kind == FaultKind::late_beyond) return n + 2 * uint64_t(late_beyond_frames) < end_;
        return true;
    }
    static bool is_beside_another(uint64_t n, const Injection& injection) {
        const auto beside = injection.strikes.lower_bound(n - std::min<uint64_t>(n, 1));
        return beside != injection.strikes.end() && beside->first <= n + 1;
    }

    const Sequence& sequence_;
    std::mt19937_64 random_;
    const uint64_t end_;
    std::array<std::vector<uint64_t>, 4> places_;  // in a cycle, by kind of slot
    std::array<double, 4> struck_{};
};

}  // namespace

Injection draw_injection(const Scenario& scenario, const Sequence& sequence, int take) {
    Injection injection;
    Drawing drawing(sequence, scenario.seed * 1'000'003 + uint64_t(take));
    for (const FaultSpec& spec : scenario.faults) drawing.strike(spec, injection);
    for (const StallSpec& spec : scenario.stalls) drawing.stall(spec, injection);
    if (scenario.board != BoardFault::none) injection.board_ends_at = drawing.draw_trigger(take % 4, injection);
    return injection;
}

}  // namespace ols::test
