// SPDX-License-Identifier: MIT
// Scenario files, read strictly.
#include "scenario.hpp"

#include "stage/toml_section.hpp"

namespace ols::test {

namespace {

const std::map<std::string, FaultKind> fault_kinds = {
    {"miss_trigger", FaultKind::miss_trigger},
    {"lose_frame", FaultKind::lose_frame},
    {"cut_frame", FaultKind::cut_frame},
    {"wrong_size", FaultKind::wrong_size},
    {"stale_buffer", FaultKind::stale_buffer},
    {"bad_time", FaultKind::bad_time},
    {"late_within", FaultKind::late_within},
    {"late_beyond", FaultKind::late_beyond},
    {"twice", FaultKind::twice},
    {"swap_next", FaultKind::swap_next},
    {"no_light", FaultKind::no_light},
    {"restart", FaultKind::restart},
    {"clock_jump", FaultKind::clock_jump},
};

FaultSpec read_fault(TomlSection& section) {
    FaultSpec fault;
    if (!section.has("kind")) section.reject("kind", "is missing");
    section.read_choice<FaultKind>("kind", fault.kind, fault_kinds);
    section.read("count", fault.count, 1, 1 << 20);
    section.read("burst_max", fault.burst_max, 1, 1000);
    section.read("bursts", fault.bursts, 0.0, 1.0);
    section.read("apart", fault.apart);
    section.read("jump_ns", fault.jump_ns, -int64_t(1) << 50, int64_t(1) << 50);
    return fault;
}

StallSpec read_stall(TomlSection& section) {
    StallSpec stall;
    section.read_choice<bool>("of", stall.disk, {{"disk", true}, {"host", false}});
    section.read("episodes", stall.episodes, 1, 1000);
    section.read("frames", stall.frames, 1, 10'000);
    return stall;
}

}  // namespace

Result<Scenario> read_scenario(const std::string& path) {
    auto file = TomlSection::open(path);
    if (!file) return file.error();
    Scenario scenario;
    int64_t seed = 1;
    file->read("name", scenario.name);
    file->read("basis", scenario.basis);
    file->read("links", scenario.links);
    file->read("cycles", scenario.cycles, 1, 100'000);
    file->read("takes", scenario.takes, 1, 1000);
    file->read("width", scenario.width, 8, 640);
    file->read("height", scenario.height, 8, 480);
    file->read("seed", seed, int64_t(0), int64_t(1) << 40);
    scenario.seed = uint64_t(seed);
    file->read_choice<BoardFault>("board", scenario.board,
                                  {{"timeline_starved", BoardFault::timeline_starved},
                                   {"shifter_starved", BoardFault::shifter_starved},
                                   {"late_trigger", BoardFault::late_trigger},
                                   {"emergency_stop", BoardFault::emergency_stop},
                                   {"over_duty", BoardFault::over_duty},
                                   {"reset", BoardFault::reset}});
    for (TomlSection& section : file->sections("fault", 100)) scenario.faults.push_back(read_fault(section));
    for (TomlSection& section : file->sections("stall", 100)) scenario.stalls.push_back(read_stall(section));
    if (const Status status = file->finish(); !status) return status.error();
    return scenario;
}

const char* fault_kind_name(FaultKind kind) {
    for (const auto& [name, value] : fault_kinds)
        if (value == kind) return name.c_str();
    return "";
}

}  // namespace ols::test
