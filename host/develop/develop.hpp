// SPDX-License-Identifier: MIT
// Develop: from the identified frames of one cycle to a target, by way of calibrate, align and demultiplex.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "demultiplex/row_filler.hpp"
#include "develop/aligned_rows.hpp"
#include "develop/target_witnesses.hpp"
#include "image/target.hpp"
#include "stage/calibration.hpp"
#include "stage/sequence.hpp"

namespace ols {

struct CycleFrames {
    uint32_t cycle = 0;
    std::vector<std::shared_ptr<const Frame>> slots;  // by slot; null where the slot is missing
    // By slot, frames of the same slot in the neighbouring cycles that may stand in for it; empty when none may.
    std::vector<std::vector<std::shared_ptr<const Frame>>> neighbours;
};

// Slots of the basis that have no frame.
std::vector<int> missing_basis_slots(const CycleFrames& frames, const Sequence& sequence);

struct DevelopOptions {
    Estimate estimate = Estimate::none;
    std::vector<LightPosition> lamps;  // of the sphere; for an estimate with a prior
    int threads = 0;                   // 0: as many as there are processors. Any number gives the same bits.
    // Every so manieth column of every so manieth pixel row is looked at by the witnesses (target_witnesses.hpp); 0: there are none.
    int witness_step = 0;
};

// The rows of a basis, brought to the target's time.
struct AlignedFrames {
    std::variant<AlignedRows<int16_t, int16_t>, AlignedRows<float, int32_t>, AlignedRows<float, float>> rows;
    std::shared_ptr<const Frame> like;  // any of them
};

// Inverts cycles into r (docs/architecture.md, "Units"). The whole part of the black level is subtracted before the
// inversion, so that counts stay integers and their sums exact, and the rest after it, which is the same since the
// inversion is linear. The variance plane is the camera's noise carried through the inversion; frames of floats, which
// come from a camera without noise, have none.
//
// A row of the basis is the mean of its slots that were recorded, without the samples that saturated; where it has none,
// of the neighbouring cycles' frames of the same slots; where none of these is there either, the sample is masked, and
// filled with what the other rows, and if asked for the prior, say of it (demultiplex/fill_model.hpp). The target's mask
// and noise gain tell which pixels that was, its provenance ("masked") how many and how far they may be off. A pixel that
// is not solved is 0 under every lamp, or with Estimate::clipped inverted with what its saturated samples read. With a
// basis that gives each row an image of its own, and no prior, a lost slot is a missing lamp, and a saturated sample
// stands as it is, a lower bound.
//
// With witnesses, targets come in order, each once. A row that is surely named (ParityVerdict) is missing, where the others make up for
// it, and the target is inverted again without it; its provenance says so ("witness_account").
class Developer {
  public:
    // References must outlive the developer.
    Developer(const Sequence& sequence, const CameraCalibration& calibration, const NoiseModel& noise,
              DevelopOptions options = {});
    ~Developer();

    // Error: slots are missing that the others cannot replace; it names them (`missing_slots`) and says what to do.
    Result<Target> develop(const CycleFrames& frames);
    Result<Target> develop(const RowFrames& rows, const std::vector<int>& missing_slots) {
        return develop(rows, missing_slots, false);
    }
    // The target has a confidence, and mask_misaligned where it is below trusted_confidence.
    Result<Target> develop(const AlignedFrames& frames, const std::vector<int>& missing_slots);

    // Whether saturated samples may count as they were read, so that rows must have them.
    bool keeps_clipped() const;

  private:
    template <typename Rows>
    Result<Target> invert(const Rows& rows, const Frame& like, const std::vector<int>& missing_slots,
                          bool stands_still);
    Result<Target> develop(const RowFrames& rows, const std::vector<int>& missing_slots, bool stands_still);
    bool makes_up_for(const std::vector<int>& lost_rows);
    bool stands_alone() const;  // every row is an image of its own, and what it lacks is not estimated
    FillCache& fills();         // made when the first sample is masked, by whichever thread meets it

    const Sequence& sequence_;
    const CameraCalibration& calibration_;
    const NoiseModel noise_;
    const DevelopOptions options_;
    std::once_flag fills_made_;
    FillModel model_;
    std::unique_ptr<FillCache> fills_;
    std::optional<TargetWitnesses> witnesses_;
};

// One cycle, without estimates.
Result<Target> develop_cycle(const CycleFrames& frames, const Sequence& sequence, const CameraCalibration& calibration,
                             const NoiseModel& noise);

}  // namespace ols
