// SPDX-License-Identifier: MIT
// Which frames a row has, and whether they are enough.
#include "develop/develop.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "develop/signal_planes.hpp"
#include "develop/target_inversion.hpp"

namespace ols {

namespace {

// The frames of each row: its own slots', or where there are none, those of the neighbouring cycles.
RowFrames row_frames(const CycleFrames& frames, const Sequence& sequence) {
    RowFrames own(size_t(sequence.basis.rows)), neighbours(size_t(sequence.basis.rows));
    for (size_t s = 0; s < frames.slots.size(); ++s) {
        if (sequence.slots[s].kind != SlotKind::basis) continue;
        const auto row = size_t(sequence.slots[s].row);
        if (frames.slots[s]) own[row].push_back(frames.slots[s]);
        if (!frames.neighbours.empty())
            neighbours[row].insert(neighbours[row].end(), frames.neighbours[s].begin(), frames.neighbours[s].end());
    }
    for (size_t row = 0; row < own.size(); ++row)
        if (own[row].empty()) own[row] = std::move(neighbours[row]);
    return own;
}

// Any frame of the rows.
const Frame* first_frame(const RowFrames& rows) {
    const auto shown = std::find_if(rows.begin(), rows.end(), [](const auto& row) { return !row.empty(); });
    return shown == rows.end() ? nullptr : shown->front().get();
}

}  // namespace

std::vector<int> missing_basis_slots(const CycleFrames& frames, const Sequence& sequence) {
    std::vector<int> missing;
    for (size_t s = 0; s < frames.slots.size(); ++s)
        if (sequence.slots[s].kind == SlotKind::basis && !frames.slots[s]) missing.push_back(int(s));
    return missing;
}

Developer::Developer(const Sequence& sequence, const CameraCalibration& calibration, const NoiseModel& noise,
                     DevelopOptions options)
    : sequence_(sequence), calibration_(calibration), noise_(noise), options_(std::move(options)) {
    assert(!has_prior(options_.estimate) || int(options_.lamps.size()) == sequence.basis.lamps);
    if (options_.witness_step > 0)
        witnesses_.emplace(sequence, options_.lamps, options_.witness_step, options_.threads);
}

Developer::~Developer() = default;

FillCache& Developer::fills() {
    std::call_once(fills_made_, [this] {
        model_ = fill_model(sequence_.basis);
        if (has_prior(options_.estimate)) add_smooth_prior(model_, image_lights(sequence_.basis, options_.lamps));
        fills_ = std::make_unique<FillCache>(model_, options_.estimate);
    });
    return *fills_;
}

bool Developer::stands_alone() const {
    return !has_prior(options_.estimate) && is_one_image_a_row(sequence_.basis);
}

bool Developer::keeps_clipped() const {
    return stands_alone() || options_.estimate == Estimate::clipped;
}

bool Developer::makes_up_for(const std::vector<int>& lost_rows) {
    return stands_alone() || fills().fill_for(lost_rows)->kind != FillKind::unsolved;
}

template <typename Rows>
Result<Target> Developer::invert(const Rows& rows, const Frame& like, const std::vector<int>& missing_slots,
                                 bool stands_still) {
    std::vector<int> lost = empty_rows(rows.rows);
    const Basis& basis = sequence_.basis;
    if (!lost.empty() && !makes_up_for(lost))
        return fail(
            fmt::format("every lamp of basis {} rests on all rows, slots {} are missing, and the other rows do not "
                        "make up for them: "
                        "record again, or run with --fill neighbours (the subject holds still) or --estimate smooth",
                        basis.name, fmt::join(missing_slots, ", ")));
    InversionJob job{basis, calibration_, noise_, nullptr, options_.estimate, options_.threads};
    if (!stands_alone()) job.fills = [this]() -> FillCache& { return fills(); };
    if (!witnesses_ || like.format != PixelFormat::u16) return invert_rows(rows, like, job);

    ParitySamples samples = witnesses_->grid(like);
    job.parity = &samples;
    Target target = invert_rows(rows, like, job);
    job.parity = nullptr;
    WitnessAccount account = witnesses_->judge(samples, lost, stands_still);
    lost.insert(lost.end(), account.named_rows.begin(), account.named_rows.end());
    std::ranges::sort(lost);
    if (!account.named_rows.empty() && !stands_alone() && makes_up_for(lost)) {
        Rows others = rows;
        for (const int row : account.named_rows) others.rows[size_t(row)].clear();
        target = invert_rows(others, like, job);
        account.json["taken_as_missing"] = witnesses_->slots_of(account.named_rows);
    }
    target.provenance["witness_account"] = std::move(account.json);
    return target;
}

Result<Target> Developer::develop(const RowFrames& rows, const std::vector<int>& missing_slots, bool stands_still) {
    const Frame* const like = first_frame(rows);
    if (!like) return fail("every basis slot of the cycle is missing");
    if (fits_shorts(like->format, like->white, calibration_.black))
        return invert(RecordedRows<int16_t>{rows}, *like, missing_slots, stands_still);
    if (like->format == PixelFormat::u16)
        return invert(RecordedRows<int32_t>{rows}, *like, missing_slots, stands_still);
    return invert(RecordedRows<float>{rows}, *like, missing_slots, stands_still);
}

Result<Target> Developer::develop(const CycleFrames& frames) {
    return develop(row_frames(frames, sequence_), missing_basis_slots(frames, sequence_), true);
}

Result<Target> Developer::develop(const AlignedFrames& frames, const std::vector<int>& missing_slots) {
    return std::visit(
        [&](const auto& rows) -> Result<Target> {
            auto target = invert(rows, *frames.like, missing_slots, false);
            if (!target.ok()) return target;
            target->confidence = rows.confidence();
            for (size_t p = 0; p < target->mask.size(); ++p)
                if (target->confidence[p] < trusted_confidence) target->mask[p] |= mask_misaligned;
            return target;
        },
        frames.rows);
}

Result<Target> develop_cycle(const CycleFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                             const NoiseModel& noise) {
    return Developer(sequence, calibration, noise).develop(frames);
}

}  // namespace ols
