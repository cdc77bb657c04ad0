// SPDX-License-Identifier: MIT
// Target witnesses: what a target's own samples say of its slots and lamps, in words and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "develop/lamp_witness.hpp"
#include "develop/parity_witness.hpp"
#include "stage/sequence.hpp"

namespace ols {

struct WitnessAccount {
    // "checks", "samples", "chi_square", "weighted_chi_square"; if anything is wrong "suspect" (a slot) or "lamps", and "says", sentences.
    nlohmann::json json;
    std::vector<int> named_rows;  // that are surely not what they should be, ascending
};

class TargetWitnesses {
  public:
    // `sequence` must outlive this. `lamps`: of the sphere; without them there is no lamp witness.
    TargetWitnesses(const Sequence& sequence, const std::vector<LightPosition>& lamps, int step, int threads);

    // To gather a target's samples in.
    ParitySamples grid(const Frame& like) const;

    // Targets in order, each once.
    WitnessAccount judge(const ParitySamples& samples, const std::vector<int>& lost_rows, bool stands_still);

    // Of the cycle, that serve these rows.
    std::vector<int> slots_of(const std::vector<int>& rows) const;

  private:
    nlohmann::json describe(const RowFinding& finding) const;
    std::string say(const RowFinding& finding) const;
    std::string say(const LampFinding& finding) const;
    std::string lamp_name(int lamp) const;

    const Sequence& sequence_;
    const int step_, threads_;
    ParityWitness parity_;
    std::optional<LampWitness> lamp_witness_;
    std::vector<LightPosition> lamps_, lights_;  // of the sphere, of the basis's images
};

}  // namespace ols
