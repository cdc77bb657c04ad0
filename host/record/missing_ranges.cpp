// SPDX-License-Identifier: MIT
// Missing slots, joined.
#include "record/missing_ranges.hpp"

namespace ols {

namespace {

const char* sight_name(Sight sight) {
    switch (sight) {
        case Sight::disagrees: return "disagrees";
        case Sight::silent: return "silent";
        case Sight::agrees:
        case Sight::proves: return "agrees";
    }
    return "";
}

}  // namespace

void MissingRanges::add(const MissingSlot& slot) {
    causes_.add(slot.why.cause);
    if (!ranges_.empty()) {
        Range& last = ranges_.back();
        const MissingSlot& first = last.first;
        if (first.counter + last.count == slot.counter && first.why == slot.why && first.board == slot.board &&
            first.camera == slot.camera && first.optical == slot.optical) {
            ++last.count;
            return;
        }
    }
    ranges_.push_back({slot, 1});
}

Reason MissingRanges::cause_within(uint64_t first, uint64_t last) const {
    for (const Range& range : ranges_)
        if (range.first.counter <= last && range.first.counter + range.count > first) return range.first.why;
    return {};
}

nlohmann::json MissingRanges::to_json() const {
    auto list = nlohmann::json::array();
    for (const Range& range : ranges_) {
        const uint64_t slot = range.first.counter % sequence_.slots.size();
        list.push_back({{"first_trigger", range.first.counter},
                        {"count", range.count},
                        {"cycle", range.first.counter / sequence_.slots.size()},
                        {"slot", slot},
                        {"kind", slot_kind_name(sequence_.slots[slot].kind)},
                        {"cause", cause_name(range.first.why.cause)},
                        {"why", range.first.why.text},
                        {"witnesses",
                         {{"board", range.first.board},
                          {"camera", range.first.camera},
                          {"optical", sight_name(range.first.optical)}}}});
    }
    return list;
}

}  // namespace ols
