// SPDX-License-Identifier: MIT
// The capture PC's own lines: looked at, not taken, so that none changes its level.
#include <fmt/format.h>

#include "device/gpio.hpp"
#include "doctor/check_up.hpp"

namespace ols {

namespace {

Finding check_line(const std::string& chip, const std::string& use, const GpioLineSetup& setup) {
    Finding finding{Check::gpio_lines,
                    use,
                    CheckVerdict::ok,
                    "",
                    fmt::format("line '{}' of '{}', used by nobody else", setup.line, chip),
                    {}};
    const auto look = look_at_line(chip, setup.line);
    if (!look.ok()) {
        finding.verdict = CheckVerdict::fail;
        finding.found = look.error().message;
        finding.commands = {"gpioinfo    # chips and lines; package gpiod"};
        return finding;
    }
    finding.found = fmt::format("offset {} of {}", look->offset, look->chip);
    if (!look->is_used) return finding;
    finding.verdict = CheckVerdict::fail;
    finding.found += fmt::format(", used by '{}'", look->consumer.empty() ? "the kernel" : look->consumer);
    finding.commands = {"gpioinfo    # who has it: end that program, unload that driver, or choose another line"};
    return finding;
}

}  // namespace

Findings check_gpio(const CheckUp& up) {
    const GpioSetup& gpio = up.stage.gpio;
    if (!gpio.has_lines()) return {skipped(Check::gpio_lines, "the stage has no [gpio]")};
    Findings findings;
    if (gpio.arm) findings.push_back(check_line(gpio.chip, "arm", *gpio.arm));
    if (gpio.emergency_stop) findings.push_back(check_line(gpio.chip, "emergency stop", *gpio.emergency_stop));
    if (gpio.genlock) findings.push_back(check_line(gpio.chip, "genlock", *gpio.genlock));
    if (gpio.tally) findings.push_back(check_line(gpio.chip, "tally", *gpio.tally));
    return findings;
}

}  // namespace ols
