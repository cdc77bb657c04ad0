// SPDX-License-Identifier: MIT
// stagectl sequence: compiles a sequence and says what it would do, without a board.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "program.hpp"
#include "stage/flicker.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    SequenceOptions sequence;
    std::string stage;
    bool json = false, slots = false;
};

struct Summary {
    size_t kinds[4] = {};
    double cycle_us = 0, seconds = 0;
    size_t program_bytes = 0;
    Flicker flicker;
    size_t slowest_lamp = 0;  // the one with the lowest strobe rate

    bool whole_is_dangerous() const { return flicker.whole.modulation > photosensitive_modulation; }
    bool lamp_is_dangerous() const { return flicker.worst_lamp.modulation > photosensitive_modulation; }
};

Summary summarize(const Sequence& sequence, const StageConfig& stage) {
    Summary summary;
    for (const Slot& slot : sequence.slots) ++summary.kinds[size_t(slot.kind)];
    summary.cycle_us = double(sequence.cycle_ticks()) / double(ticks_per_us);
    summary.seconds = summary.cycle_us * 1e-6 * sequence.config.cycles;
    summary.program_bytes = encode_program(sequence, stage).size();
    summary.flicker = measure_flicker(sequence);
    const auto& lamps = summary.flicker.lamps;
    const auto slowest = std::min_element(
        lamps.begin(), lamps.end(), [](const LampLight& a, const LampLight& b) { return a.strobe_hz < b.strobe_hz; });
    summary.slowest_lamp = size_t(slowest - lamps.begin());
    return summary;
}

// The numbers of the lamps that a slot lights.
std::vector<int> lit_lamps(const Slot& slot) {
    std::vector<int> lamps;
    for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp)
        if (slot.lit[lamp]) lamps.push_back(int(lamp));
    return lamps;
}

nlohmann::json to_json(const Summary& summary, const Sequence& sequence) {
    auto lamps = nlohmann::json::array();
    for (const LampLight& lamp : summary.flicker.lamps)
        lamps.push_back(
            {{"strobe_hz", lamp.strobe_hz}, {"longest_dark_us", lamp.longest_dark_us}, {"duty", lamp.duty}});
    auto slots = nlohmann::json::array();
    for (const Slot& slot : sequence.slots)
        slots.push_back({{"kind", slot_kind_name(slot.kind)},
                         {"row", slot.row},
                         {"lit", lit_lamps(slot)},
                         {"exposure_ticks", slot.exposure_ticks},
                         {"period_ticks", slot.period_ticks},
                         {"trigger_offset_ticks", slot.trigger_offset_ticks},
                         {"planes", slot.planes},
                         {"levels", slot.levels},
                         {"name", slot.name},
                         {"scale", slot.scale},
                         {"trigger_mask", slot.trigger_mask}});
    const auto peak = [](const FlickerPeak& p) { return nlohmann::json{{"hz", p.hz}, {"modulation", p.modulation}}; };
    return {{"basis", sequence.basis.name},
            {"cycles", sequence.config.cycles},
            {"cycle_us", summary.cycle_us},
            {"seconds", summary.seconds},
            {"optical_code_unique", sequence.is_capture()},  // or compiling had failed
            {"program_bytes", summary.program_bytes},
            {"light_duty", summary.flicker.light_duty},
            {"flicker_whole", peak(summary.flicker.whole)},
            {"flicker_worst_lamp", peak(summary.flicker.worst_lamp)},
            {"worst_lamp", summary.flicker.worst_lamp_index},
            {"photosensitivity_warning", summary.whole_is_dangerous() || summary.lamp_is_dangerous()},
            {"lamps", lamps},
            {"slots", slots}};
}

void print_slots(const Sequence& sequence) {
    for (size_t s = 0; s < sequence.slots.size(); ++s) {
        const Slot& slot = sequence.slots[s];
        fmt::print("slot {:4}  {:8}  {:3} lamps  {:7.2f} us{}\n", s, slot_kind_name(slot.kind),
                   std::count(slot.lit.begin(), slot.lit.end(), 1), double(slot.exposure_ticks) / double(ticks_per_us),
                   !slot.name.empty() ? "  " + slot.name
                   : slot.row < 0     ? ""
                                      : fmt::format("  row {}", slot.row));
    }
}

void print_summary(const Summary& summary, const Sequence& sequence) {
    const LampLight& slowest = summary.flicker.lamps[summary.slowest_lamp];
    fmt::print("{} slots a cycle: {} of basis {}, {} tracking, {} matte, {} dark\n", sequence.slots.size(),
               summary.kinds[size_t(SlotKind::basis)], sequence.basis.name, summary.kinds[size_t(SlotKind::tracking)],
               summary.kinds[size_t(SlotKind::matte)], summary.kinds[size_t(SlotKind::dark)]);
    if (sequence.is_capture())
        fmt::print("optical code: the order of tracking, matte and dark slots is unique over the cycle\n");
    fmt::print("cycle {:.3f} ms, {} cycles {:.3f} s; program of {} bytes\n", summary.cycle_us * 1e-3,
               sequence.config.cycles, summary.seconds, summary.program_bytes);
    fmt::print(
        "light is on {:.1f} % of the time; lamp {} flashes least, {:.1f} times a second, lit {:.3f} % of the "
        "time, dark for up to {:.1f} ms\n",
        summary.flicker.light_duty * 100, summary.slowest_lamp, slowest.strobe_hz, slowest.duty * 100,
        slowest.longest_dark_us * 1e-3);
    fmt::print("flicker from {} to {} Hz: {:.1f} % of all light at {:.1f} Hz; {:.0f} % of lamp {} at {:.1f} Hz\n",
               photosensitive_min_hz, photosensitive_max_hz, summary.flicker.whole.modulation * 100,
               summary.flicker.whole.hz, summary.flicker.worst_lamp.modulation * 100, summary.flicker.worst_lamp_index,
               summary.flicker.worst_lamp.hz);
    if (summary.whole_is_dangerous())
        fmt::print(
            "WARNING: the light as a whole flickers by more than {:.0f} % at a rate that can trigger seizures. "
            "Warn everyone in the room.\n",
            photosensitive_modulation * 100);
    else if (summary.lamp_is_dangerous())
        fmt::print(
            "WARNING: whoever looks straight at a lamp sees it flicker at a rate that can trigger seizures. "
            "Warn everyone in the room.\n");
}

Result<int> run(const Options& options) {
    const auto config = open_sequence(options.sequence);
    if (!config.ok()) return config.error();
    const auto stage = options.stage.empty() ? Result<StageConfig>(default_stage()) : read_stage(options.stage);
    if (!stage.ok()) return stage.error();
    const auto sequence = compile_sequence(*config, *stage);
    if (!sequence.ok()) return sequence.error();
    const Summary summary = summarize(*sequence, *stage);
    if (options.json) {
        print_json(to_json(summary, *sequence));
    } else {
        if (options.slots) print_slots(*sequence);
        print_summary(summary, *sequence);
    }
    return 0;
}

}  // namespace

void add_sequence_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("sequence", "compile a sequence and say what it does: length, light, flicker");
    verb->footer(
        "Example: stagectl sequence examples/sequence_single.toml --stage examples/stage.toml --slots\n"
        "         stagectl sequence --basis paley163");
    options->sequence.add_to(*verb, "sequence");
    verb->add_option("--stage", options->stage, "stage.toml; without it, the default stage");
    verb->add_flag("--slots", options->slots, "list every slot");
    verb->add_flag("--json", options->json, "print as JSON, with slots and lamps");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
