// SPDX-License-Identifier: MIT
// Picking frames by number.
#include "develop/frame_store.hpp"

namespace ols {

uint64_t number_of(const Frame& frame, const Sequence& sequence) {
    return uint64_t(frame.cycle) * sequence.slots.size() + frame.slot;
}

void FrameStore::add(std::shared_ptr<const Frame> frame) {
    const uint64_t number = number_of(*frame, sequence_);
    frames_[number] = std::move(frame);
}

std::shared_ptr<const Frame> FrameStore::find(uint64_t number) const {
    const auto found = frames_.find(number);
    return found == frames_.end() ? nullptr : found->second;
}

CycleFrames FrameStore::cycle(uint32_t cycle, bool fills) const {
    const size_t length = sequence_.slots.size();
    const uint64_t first = uint64_t(cycle) * length;
    CycleFrames frames;
    frames.cycle = cycle;
    for (size_t s = 0; s < length; ++s) frames.slots.push_back(find(first + s));
    if (!fills) return frames;
    frames.neighbours.resize(length);
    for (const int slot : missing_basis_slots(frames, sequence_)) {
        if (cycle > 0)
            if (auto before = find(first + uint64_t(slot) - length)) frames.neighbours[size_t(slot)].push_back(before);
        if (auto after = find(first + uint64_t(slot) + length)) frames.neighbours[size_t(slot)].push_back(after);
    }
    return frames;
}

TargetFrames FrameStore::around(uint32_t index, uint64_t target) const {
    TargetFrames frames;
    frames.index = index;
    frames.basis = gather_basis(sequence_, target, [this](uint64_t number) { return has(number); });
    for (const auto& choice : frames.basis.choices) {
        frames.frames.push_back(find(choice.number));
        frames.across.push_back(choice.across ? find(*choice.across) : nullptr);
    }
    const FrameRange range = frames_around(sequence_, target);
    for (uint64_t number = range.first; number <= range.last; ++number) {
        if (sequence_.slots[number % sequence_.slots.size()].kind != SlotKind::tracking) continue;
        if (auto frame = find(number))
            frames.tracking.push_back({number, std::move(frame)});
        else
            frames.lost_tracking.push_back(number);
    }
    for (const uint64_t number : nearest_matte_frames(sequence_, target, [this](uint64_t one) { return has(one); }))
        frames.matte.push_back({number, find(number)});
    return frames;
}

}  // namespace ols
