// SPDX-License-Identifier: MIT
// Missing slots for the manifest: neighbours that are missing for one reason share an entry.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "record/identify.hpp"

namespace ols {

class MissingRanges {
  public:
    explicit MissingRanges(const Sequence& sequence) : sequence_(sequence) {}

    // Slots come in order of their triggers.
    void add(const MissingSlot& slot);

    // Why the first missing one of the slots `first` to `last` is; empty when none is.
    Reason cause_within(uint64_t first, uint64_t last) const;

    const CauseCounts& causes() const { return causes_; }

    // [{"first_trigger", "count", "cycle", "slot", "kind", "cause", "why", "witnesses": {"board", "camera", "optical"}}]; cycle,
    // slot and kind are the first trigger's.
    nlohmann::json to_json() const;

  private:
    struct Range {
        MissingSlot first;
        uint64_t count;
    };
    const Sequence& sequence_;
    std::vector<Range> ranges_;
    CauseCounts causes_;
};

}  // namespace ols
