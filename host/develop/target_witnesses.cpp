// SPDX-License-Identifier: MIT
// Rows to slots, and findings to words.
#include "develop/target_witnesses.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ols {

TargetWitnesses::TargetWitnesses(const Sequence& sequence, const std::vector<LightPosition>& lamps, int step,
                                 int threads)
    : sequence_(sequence), step_(step), threads_(threads), parity_(sequence.basis), lamps_(lamps) {
    if (int(lamps.size()) != sequence.basis.lamps) return;
    lamp_witness_.emplace(sequence.basis, lamps);
    lights_ = image_lights(sequence.basis, lamps);
}

ParitySamples TargetWitnesses::grid(const Frame& like) const {
    return {step_, int(like.width), int(like.height), samples_per_pixel(like.cfa), sequence_.basis.rows};
}

std::vector<int> TargetWitnesses::slots_of(const std::vector<int>& rows) const {
    std::vector<int> slots;
    for (size_t s = 0; s < sequence_.slots.size(); ++s)
        if (sequence_.slots[s].kind == SlotKind::basis && std::ranges::find(rows, sequence_.slots[s].row) != rows.end())
            slots.push_back(int(s));
    return slots;
}

std::string TargetWitnesses::lamp_name(int lamp) const {
    return size_t(lamp) < lamps_.size() ? lamps_[size_t(lamp)].name : fmt::format("lamp {}", lamp);
}

nlohmann::json TargetWitnesses::describe(const RowFinding& finding) const {
    nlohmann::json json = {
        {"fault", row_fault_name(finding.fault)}, {"sigma", finding.sigma}, {"share", finding.share}};
    for (const auto& rows : finding.candidates) json["slots"].push_back(slots_of(rows));
    if (finding.lamp >= 0) json["lamp"] = lamp_name(finding.lamp);
    return json;
}

std::string TargetWitnesses::say(const RowFinding& finding) const {
    std::vector<std::string> names;
    constexpr size_t names_max = 8;
    for (const auto& rows : finding.candidates)
        if (names.size() < names_max) names.push_back(fmt::format("{}", fmt::join(slots_of(rows), " and ")));
    std::string where = (names.size() == 1 ? "slot " : "one of the slots ") + fmt::format("{}", fmt::join(names, ", "));
    if (finding.fault == RowFault::swapped)
        where = (names.size() == 1 ? "slots " : "a pair of the slots ") + fmt::format("{}", fmt::join(names, "; "));
    if (finding.candidates.size() > names_max)
        where += fmt::format(" and {} more", finding.candidates.size() - names_max);
    switch (finding.fault) {
        case RowFault::swapped:
            where += names.size() == 1 ? " show each other's picture" : " shows each other's picture";
            break;
        case RowFault::copied: where += " shows another slot's picture"; break;
        case RowFault::mislit:
            where = lamp_name(finding.lamp) + " was out, or on, against the pattern in " + where;
            break;
        case RowFault::changed: where += " looks other than in the target before, while the others do not"; break;
    }
    if (finding.share < 1) where += fmt::format(", in {:.0f} % of the frame's height", 100 * finding.share);
    return where + fmt::format(" ({:.0f} sigma)", finding.sigma);
}

std::string TargetWitnesses::say(const LampFinding& finding) const {
    const std::string& name = lights_[size_t(finding.image)].name;
    return fmt::format("{} gives {:.2f} +- {:.2f} of the light that {}", name, finding.factor, finding.spread,
                       finding.is_new ? "it gave in the first target" : "its neighbours foretell");
}

WitnessAccount TargetWitnesses::judge(const ParitySamples& samples, const std::vector<int>& lost_rows,
                                      bool stands_still) {
    WitnessAccount account;
    const ParityVerdict verdict = parity_.judge(samples, lost_rows, stands_still, threads_);
    account.json = {{"checks", verdict.checks}, {"samples", verdict.samples}};
    if (verdict.checks > 0 && verdict.samples > 0)
        account.json.update({{"chi_square", verdict.chi_square}, {"weighted_chi_square", verdict.weighted_chi_square}});
    if (verdict.finding) {
        account.json["suspect"] = describe(*verdict.finding);
        account.json["says"].push_back(say(*verdict.finding));
        const bool is_row_wrong =
            verdict.finding->fault == RowFault::swapped || verdict.finding->fault == RowFault::copied;
        if (is_row_wrong && verdict.names_surely()) account.named_rows = verdict.finding->candidates.front();
        std::ranges::sort(account.named_rows);
    }
    if (!lamp_witness_ || !lost_rows.empty()) return account;
    for (const LampFinding& finding : lamp_witness_->judge(samples)) {
        account.json["lamps"].push_back({{"lamp", lights_[size_t(finding.image)].name},
                                         {"factor", finding.factor},
                                         {"spread", finding.spread},
                                         {"sigma", finding.sigma()},
                                         {"since_first_target", finding.is_new}});
        account.json["says"].push_back(say(finding));
    }
    account.json["lamps_not_judged"] = lamp_witness_->unjudged();
    return account;
}

}  // namespace ols
