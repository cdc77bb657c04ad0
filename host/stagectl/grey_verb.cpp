// SPDX-License-Identifier: MIT
// stagectl grey: how linear grey levels are at a stage's lamps, and which unit they need.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "program.hpp"
#include "stage/sequence.hpp"
#include "stage/stage.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    std::string stage;
    std::optional<double> on_delay_us, off_delay_us, rise_us, fall_us;
    GreyTiming timing;
    bool json = false;
};

LampResponse lamp_of(const Options& options, LampResponse lamp) {
    lamp.on_delay_us = options.on_delay_us.value_or(lamp.on_delay_us);
    lamp.off_delay_us = options.off_delay_us.value_or(lamp.off_delay_us);
    lamp.rise_us = options.rise_us.value_or(lamp.rise_us);
    lamp.fall_us = options.fall_us.value_or(lamp.fall_us);
    return lamp;
}

size_t worst_level(const std::vector<double>& errors) {
    size_t worst = 0;
    for (size_t level = 0; level < errors.size(); ++level)
        if (std::abs(errors[level]) > std::abs(errors[worst])) worst = level;
    return worst;
}

double us(double ticks) {
    return ticks / double(ticks_per_us);
}

Result<int> run(const Options& options) {
    const auto stage = options.stage.empty() ? Result<StageConfig>(default_stage()) : read_stage(options.stage);
    if (!stage.ok()) return stage.error();
    const LampResponse lamp = lamp_of(options, stage->lamp_response);
    const auto light = grey_light_ticks(lamp, options.timing);
    const auto errors = grey_errors_levels(lamp, options.timing);
    const size_t worst = worst_level(errors);
    const uint32_t least = least_unit_ticks(lamp, options.timing);
    GreyTiming with_least = options.timing;
    with_least.unit_ticks = least;
    if (options.json) {
        auto levels = nlohmann::json::array();
        for (size_t level = 0; level < errors.size(); ++level)
            levels.push_back({{"level", level}, {"light_ticks", light[level]}, {"error_levels", errors[level]}});
        print_json({{"worst_error_levels", errors[worst]},
                    {"worst_level", worst},
                    {"least_unit_ticks", least},
                    {"span_us", us(grey_span_ticks(options.timing))},
                    {"span_us_with_least_unit", us(grey_span_ticks(with_least))},
                    {"levels", levels}});
        return 0;
    }
    fmt::print("lamp: on after {} us, 10 to 90 % in {} us; off after {} us, 90 to 10 % in {} us\n", lamp.on_delay_us,
               lamp.rise_us, lamp.off_delay_us, lamp.fall_us);
    fmt::print(
        "a unit of {} ticks ({:.3f} us): level {} is off by {:+.3f} levels, no other by more; a slot spans {:.1f} us\n",
        options.timing.unit_ticks, us(options.timing.unit_ticks), worst, errors[worst],
        us(grey_span_ticks(options.timing)));
    fmt::print("for half a level: {} ticks ({:.3f} us) or more; a slot then spans {:.1f} us\n", least, us(least),
               us(grey_span_ticks(with_least)));
    return 0;
}

}  // namespace

void add_grey_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("grey", "how linear grey levels are at the lamps, and which unit they need");
    verb->footer(
        "Example: stagectl grey --rise-us 0.2 --fall-us 0.1 --unit-ticks 200\n"
        "The board's light is linear to the tick. A lamp that is slower to rise than to fall, or to come on than to "
        "go\n"
        "off, loses the same light in each pulse, and levels differ in how many pulses they have.");
    verb->add_option("--stage", options->stage,
                     "stage.toml, whose [lamps] says on_delay_us, off_delay_us, rise_us, fall_us");
    verb->add_option("--on-delay-us", options->on_delay_us, "instead of the stage's")->check(CLI::Range(0.0, 1000.0));
    verb->add_option("--off-delay-us", options->off_delay_us, "instead of the stage's")->check(CLI::Range(0.0, 1000.0));
    verb->add_option("--rise-us", options->rise_us, "instead of the stage's")->check(CLI::Range(0.0, 1000.0));
    verb->add_option("--fall-us", options->fall_us, "instead of the stage's")->check(CLI::Range(0.0, 1000.0));
    verb->add_option("--planes", options->timing.planes, "bits of a level")
        ->check(CLI::Range(2, OLS_PLANES_MAX))
        ->capture_default_str();
    verb->add_option("--unit-ticks", options->timing.unit_ticks, "light of level 1, in ticks of 8 ns")
        ->check(CLI::Range(8, 1'000'000))
        ->capture_default_str();
    verb->add_option("--shift-ticks", options->timing.shift_ticks, "to send a pattern, as the board's hello says")
        ->check(CLI::Range(1, 1'000'000))
        ->capture_default_str();
    verb->add_flag("--json", options->json, "print as JSON, with every level");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
