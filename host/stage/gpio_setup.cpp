// SPDX-License-Identifier: MIT
// Reading [gpio] of stage.toml.
#include "stage/gpio_setup.hpp"

#include "stage/toml_section.hpp"

namespace ols {

namespace {

constexpr int button_debounce_ms = 20, signal_debounce_ms = 100;

bool same_line(const std::optional<GpioLineSetup>& a, const std::optional<GpioLineSetup>& b) {
    return a && b && a->line == b->line;
}

GpioLineSetup read_line(TomlSection& table) {
    GpioLineSetup setup;
    table.read("line", setup.line);
    if (setup.line.empty()) table.reject("line", "is missing: give the line's name, or its offset as in \"17\"");
    table.read("active_low", setup.active_low);
    return setup;
}

GpioLineSetup read_input(TomlSection& table, int debounce_ms) {
    GpioLineSetup setup = read_line(table);
    table.read_choice<GpioBias>("bias", setup.bias,
                                {{"as_is", GpioBias::as_is},
                                 {"none", GpioBias::none},
                                 {"pull_up", GpioBias::pull_up},
                                 {"pull_down", GpioBias::pull_down}});
    setup.debounce_ms = debounce_ms;
    if (debounce_ms > 0) table.read("debounce_ms", setup.debounce_ms, 0, 10'000);
    return setup;
}

}  // namespace

GpioSetup read_gpio(TomlSection gpio) {
    GpioSetup setup;
    gpio.read("chip", setup.chip);
    if (gpio.has("arm")) {
        TomlSection table = gpio.section("arm");
        setup.arm = read_input(table, button_debounce_ms);
    }
    if (gpio.has("emergency_stop")) {
        TomlSection table = gpio.section("emergency_stop");
        setup.emergency_stop = read_input(table, 0);
    }
    if (gpio.has("genlock")) {
        TomlSection table = gpio.section("genlock");
        setup.genlock = read_input(table, signal_debounce_ms);
        table.read_choice<GenlockAbsence>("when_absent", setup.genlock_absence,
                                          {{"stop", GenlockAbsence::stops}, {"warn", GenlockAbsence::warns}});
    }
    if (gpio.has("tally")) {
        TomlSection table = gpio.section("tally");
        setup.tally = read_line(table);
    }
    if (setup.has_lines() && setup.chip.empty())
        gpio.reject("chip", "is missing: give the chip's name or label, as gpioinfo(1) lists them");
    const std::optional<GpioLineSetup>* lines[] = {&setup.arm, &setup.emergency_stop, &setup.genlock, &setup.tally};
    for (size_t a = 0; a < std::size(lines); ++a)
        for (size_t b = 0; b < a; ++b)
            if (same_line(*lines[a], *lines[b]))
                gpio.reject("chip", "has line '" + (*lines[a])->line + "' in two uses");
    return setup;
}

}  // namespace ols
