// SPDX-License-Identifier: MIT
// stagectl sequence: compiles a sequence and says what it would do, without a board.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "program.hpp"
#include "stage/flicker.hpp"
#include "stagectl/flicker_warning.hpp"
#include "stagectl/lost_slots.hpp"
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
    int slowest_lamp = -1;  // of the lamps that are lit, the one with the lowest strobe rate
};

Summary summarize(const Sequence& sequence, const StageConfig& stage) {
    Summary summary;
    for (const Slot& slot : sequence.slots) ++summary.kinds[size_t(slot.kind)];
    summary.cycle_us = double(sequence.cycle_ticks()) / double(ticks_per_us);
    summary.seconds = summary.cycle_us * 1e-6 * sequence.config.cycles;
    summary.program_bytes = encode_program(sequence, stage).size();
    summary.flicker = measure_flicker(sequence);
    const auto& lamps = summary.flicker.lamps;
    for (size_t lamp = 0; lamp < lamps.size(); ++lamp) {
        if (lamps[lamp].duty == 0) continue;
        const int slowest = summary.slowest_lamp;
        if (slowest < 0 || lamps[lamp].strobe_hz < lamps[size_t(slowest)].strobe_hz) summary.slowest_lamp = int(lamp);
    }
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
    const int worst = summary.flicker.worst_lamp_index;
    return {{"basis", sequence.basis.name},
            {"cycles", sequence.config.cycles},
            {"cycle_us", summary.cycle_us},
            {"seconds", summary.seconds},
            {"optical_code_unique", sequence.is_capture()},  // or compiling had failed
            {"program_bytes", summary.program_bytes},
            {"light_duty", summary.flicker.light_duty},
            {"flicker_whole", peak(summary.flicker.whole)},
            {"flicker_worst_lamp", peak(summary.flicker.worst_lamp)},
            {"worst_lamp", worst < 0 ? nlohmann::json() : nlohmann::json(worst)},
            {"photosensitivity_warning", !flicker_warning(summary.flicker).empty()},
            {"lost_slots", sequence.is_capture() ? lost_slots_json(sequence) : nlohmann::json()},
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

void print_light(const Flicker& flicker, int slowest_lamp) {
    if (slowest_lamp < 0) {
        fmt::print("no lamp is lit\n");
        return;
    }
    const LampLight& slowest = flicker.lamps[size_t(slowest_lamp)];
    fmt::print(
        "light is on {:.1f} % of the time; of the lamps that are lit, lamp {} flashes least, {:.1f} times a second, "
        "lit "
        "{:.3f} % of the time, dark for up to {:.1f} ms\n",
        flicker.light_duty * 100, slowest_lamp, slowest.strobe_hz, slowest.duty * 100, slowest.longest_dark_us * 1e-3);
    fmt::print("flicker from {} to {} Hz: ", photosensitive_min_hz, photosensitive_max_hz);
    if (flicker.worst_lamp_index < 0)
        fmt::print("none\n");
    else
        fmt::print("{:.1f} % of all light at {:.1f} Hz; {:.0f} % of lamp {} at {:.1f} Hz\n",
                   flicker.whole.modulation * 100, flicker.whole.hz, flicker.worst_lamp.modulation * 100,
                   flicker.worst_lamp_index, flicker.worst_lamp.hz);
    if (const std::string warning = flicker_warning(flicker); !warning.empty()) fmt::print("{}\n", warning);
}

void print_summary(const Summary& summary, const Sequence& sequence) {
    fmt::print("{} slots a cycle: {} of basis {}, {} tracking, {} matte, {} dark\n", sequence.slots.size(),
               summary.kinds[size_t(SlotKind::basis)], sequence.basis.name, summary.kinds[size_t(SlotKind::tracking)],
               summary.kinds[size_t(SlotKind::matte)], summary.kinds[size_t(SlotKind::dark)]);
    if (sequence.is_capture()) {
        fmt::print("optical code: the order of tracking, matte and dark slots is unique over the cycle\n");
        fmt::print("lost slots: {}\n", describe_lost_slots(sequence));
    }
    fmt::print("cycle {:.3f} ms, {} cycles {:.3f} s{}; program of {} bytes\n", summary.cycle_us * 1e-3,
               sequence.config.cycles, summary.seconds,
               sequence.config.playback.start == StartSource::photo ? " and what each waits for its edge" : "",
               summary.program_bytes);
    print_light(summary.flicker, summary.slowest_lamp);
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
