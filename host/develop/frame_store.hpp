// SPDX-License-Identifier: MIT
// Frame store: the identified frames of a take that targets are still to be made of.
#pragma once

#include <map>
#include <memory>

#include "develop/lazy_basis.hpp"
#include "develop/motion_developer.hpp"
#include "image/frame.hpp"

namespace ols {

// The number of an identified frame in the take (lazy_basis.hpp).
uint64_t number_of(const Frame& frame, const Sequence& sequence);

// Frames by their number.
class FrameStore {
  public:
    explicit FrameStore(const Sequence& sequence) : sequence_(sequence) {}

    void add(std::shared_ptr<const Frame> frame);
    void forget_before(uint64_t number) { frames_.erase(frames_.begin(), frames_.lower_bound(number)); }
    bool has(uint64_t number) const { return frames_.contains(number); }

    // One cycle, slot by slot; `fills` takes lost basis slots from the cycles before and after.
    CycleFrames cycle(uint32_t cycle, bool fills) const;

    // What is nearest to a target.
    TargetFrames around(uint32_t index, uint64_t target) const;

  private:
    std::shared_ptr<const Frame> find(uint64_t number) const;

    const Sequence& sequence_;
    std::map<uint64_t, std::shared_ptr<const Frame>> frames_;
};

}  // namespace ols
