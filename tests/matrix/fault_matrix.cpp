// SPDX-License-Identifier: MIT
// fault_matrix SCENARIO.toml LINK WORK: plays the takes of a scenario over a link (ring, gige, v4l2) and prints a line of JSON for each:
// what was done to which trigger, and what the recorder's account says. matrix.py judges. WORK is a folder for the ring.
#include <cstdio>

#include "playing.hpp"

namespace ols::test {

namespace {

nlohmann::json describe(const Scenario& scenario, const Played& played) {
    nlohmann::json strikes = nlohmann::json::array(), stalls = nlohmann::json::array();
    for (const auto& [trigger, strike] : played.injection.strikes)
        strikes.push_back({trigger, fault_kind_name(strike.kind)});
    for (size_t n = 0; n < played.stalled.size(); ++n)
        stalls.push_back(
            {played.stalled[n].first, played.stalled[n].second, played.stalls_of_disk[n] ? "disk" : "host"});
    std::string kinds;
    for (const Slot& slot : played.sequence.slots) kinds += slot_kind_name(slot.kind)[0];
    return {{"name", scenario.name},
            {"triggers", played.sequence.trigger_count()},
            {"kinds", kinds},
            {"lit", played.lit},
            {"strikes", strikes},
            {"stalls", stalls},
            {"fired", played.fired},
            {"kept", played.kept},
            {"without_room", played.without_room},
            {"missing", played.missing},
            {"report", played.report}};
}

int run(const char* path, const std::string& link, const std::string& work) {
    const auto scenario = read_scenario(path);
    if (!scenario.ok()) return fprintf(stderr, "%s\n", scenario.error().message.c_str()), 1;
    for (int take = 0; take < scenario->takes; ++take) {
        const auto played = play_take(*scenario, link, take, work);
        if (!played.ok()) return fprintf(stderr, "%s\n", played.error().message.c_str()), 1;
        puts(describe(*scenario, *played).dump().c_str());
        fflush(stdout);
    }
    return 0;
}

}  // namespace

}  // namespace ols::test

int main(int argc, char** argv) {
    if (argc != 4) return fprintf(stderr, "usage: fault_matrix SCENARIO.toml ring|gige|v4l2 WORK\n"), 1;
    return ols::test::run(argv[1], argv[2], argv[3]);
}
