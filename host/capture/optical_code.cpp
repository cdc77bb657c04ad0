// SPDX-License-Identifier: MIT
// Looking at frames by the kind of their slot, and the search for the one place in the cycle that fits.
#include "capture/optical_code.hpp"

#include <array>

namespace ols {

namespace {

Sight compare(const std::optional<FrameSummary>& known, const FrameSummary& summary) {
    if (!known) return Sight::silent;
    if (is_dark(*known)) return is_dark(summary) ? Sight::agrees : Sight::disagrees;
    return difference(*known, summary) <= same_kind_difference ? Sight::agrees : Sight::disagrees;
}

}  // namespace

Sight OpticalCode::look(uint64_t counter, const FrameSummary& summary) const {
    switch (kind_at(counter)) {
        case SlotKind::dark: return is_dark(summary) ? Sight::agrees : Sight::disagrees;
        case SlotKind::tracking: return is_dark(summary) ? Sight::disagrees : compare(tracking_, summary);
        case SlotKind::matte: return compare(matte_, summary);  // black where no matte board is in view
        case SlotKind::basis: break;
    }
    return Sight::silent;
}

void OpticalCode::learn(uint64_t counter, const FrameSummary& summary) {
    if (kind_at(counter) == SlotKind::tracking) tracking_ = summary;
    if (kind_at(counter) == SlotKind::matte) matte_ = summary;
}

Sight OpticalCode::look_at_all(std::span<const Seen> frames, uint64_t counter_of_first) const {
    OpticalCode trial = *this;
    std::array<bool, 4> agreed{};
    for (const Seen& frame : frames) {
        const uint64_t counter = counter_of_first + frame.position;
        const Sight sight = trial.look(counter, *frame.summary);
        if (sight == Sight::disagrees) return sight;
        if (sight == Sight::agrees) agreed[size_t(kind_at(counter))] = true;
        trial.learn(counter, *frame.summary);
    }
    const bool all =
        agreed[size_t(SlotKind::dark)] && agreed[size_t(SlotKind::matte)] && agreed[size_t(SlotKind::tracking)];
    return all ? Sight::agrees : Sight::silent;
}

std::optional<uint64_t> OpticalCode::find_unique(std::span<const Seen> frames, uint64_t first, uint64_t last) const {
    std::optional<uint64_t> found;
    bool proved = false;
    for (uint64_t counter = first; counter <= last; ++counter) {
        const Sight sight = look_at_all(frames, counter);
        if (sight == Sight::disagrees) continue;
        if (found) return std::nullopt;
        found = counter;
        proved = sight == Sight::agrees;
    }
    return proved ? found : std::nullopt;
}

}  // namespace ols
