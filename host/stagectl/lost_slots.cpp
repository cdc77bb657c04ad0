// SPDX-License-Identifier: MIT
// Bursts in words and as JSON.
#include "stagectl/lost_slots.hpp"

#include <fmt/format.h>

#include "stage/bursts.hpp"

namespace ols {

std::string describe_lost_slots(const Sequence& sequence) {
    if (is_one_image_a_row(sequence.basis)) return "each is one missing image, and no other image suffers";
    const RowLosses losses(sequence.basis);
    if (losses.redundancy() == 0)
        return "none is made up for by the others: one that is lost costs the target, unless it is "
               "estimated or taken from a neighbouring cycle";
    std::string text;
    for (const BurstLoss& burst : measure_bursts(losses, sequence.order_of_play())) {
        text += text.empty() ? "" : "; ";
        text += burst.slots == 1 ? "one alone" : fmt::format("{} in a row", burst.slots);
        text += fmt::format(": {} of {} made up for", burst.made_up_for, burst.windows);
        if (burst.made_up_for > 0) text += fmt::format(" (noise variance x {:.2f})", burst.worst_noise_gain);
    }
    return text + fmt::format("; more than {}: none", losses.redundancy());
}

nlohmann::json lost_slots_json(const Sequence& sequence) {
    const RowLosses losses(sequence.basis);
    auto bursts = nlohmann::json::array();
    for (const BurstLoss& burst : measure_bursts(losses, sequence.order_of_play()))
        bursts.push_back(
            {{"slots", burst.slots},
             {"windows", burst.windows},
             {"made_up_for", burst.made_up_for},
             {"worst_noise_gain", burst.made_up_for > 0 ? nlohmann::json(burst.worst_noise_gain) : nullptr}});
    return {{"redundancy", losses.redundancy()},
            {"is_one_image_a_row", is_one_image_a_row(sequence.basis)},
            {"bursts", bursts}};
}

}  // namespace ols
