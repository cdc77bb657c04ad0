// SPDX-License-Identifier: MIT
// Looking at frames by the kind of their slot, and the search for the one place in the cycle that fits.
#include "record/optical_code.hpp"

#include <array>

namespace ols {

std::optional<bool> OpticalCode::looks_like(SlotKind kind, const FrameSummary& summary) const {
    const bool dark = is_dark(summary);
    if (kind == SlotKind::dark) return dark;
    if (kind == SlotKind::tracking && dark) return false;
    const auto& known = kind == SlotKind::tracking ? tracking_ : matte_;
    if (!known) return std::nullopt;
    if (is_dark(*known)) return dark;  // the matte slot, where no matte board is in view
    return difference(*known, summary) <= same_kind_difference;
}

Sight OpticalCode::look(uint64_t counter, const FrameSummary& summary) const {
    const SlotKind kind = kind_at(counter);
    if (kind == SlotKind::basis) return Sight::silent;
    const auto alike = looks_like(kind, summary);
    if (!alike) return Sight::silent;
    if (!*alike) return Sight::disagrees;
    return mistakable_[size_t(kind)] ? Sight::agrees : Sight::proves;
}

void OpticalCode::learn(uint64_t counter, const FrameSummary& summary) {
    switch (kind_at(counter)) {
        case SlotKind::tracking: tracking_ = summary; break;
        case SlotKind::matte: matte_ = summary; break;
        case SlotKind::dark: break;
        case SlotKind::basis:
            for (const SlotKind kind : {SlotKind::tracking, SlotKind::matte, SlotKind::dark})
                if (looks_like(kind, summary) == true) mistakable_[size_t(kind)] = true;
    }
}

Sight OpticalCode::look_at_all(std::span<const Seen> frames, uint64_t counter_of_first) const {
    OpticalCode trial = *this;
    std::array<bool, 4> agreed{};
    for (const Seen& frame : frames) {
        const uint64_t counter = counter_of_first + frame.position;
        const Sight sight = trial.look(counter, *frame.summary);
        if (sight == Sight::disagrees) return sight;
        if (sight >= Sight::agrees) agreed[size_t(kind_at(counter))] = true;
        if (kind_at(counter) != SlotKind::basis) trial.learn(counter, *frame.summary);
    }
    const bool all =
        agreed[size_t(SlotKind::dark)] && agreed[size_t(SlotKind::matte)] && agreed[size_t(SlotKind::tracking)];
    return all ? Sight::proves : Sight::silent;
}

OpticalCode::Search OpticalCode::search(std::span<const Seen> frames, uint64_t first, uint64_t last) const {
    Search result;
    for (uint64_t counter = first; counter <= last && result.possible < 2; ++counter) {
        const Sight sight = look_at_all(frames, counter);
        if (sight == Sight::disagrees) continue;
        if (result.possible++ > 0) continue;
        result.counter = counter;
        result.proved = sight == Sight::proves;
    }
    return result;
}

}  // namespace ols
