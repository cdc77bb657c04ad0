// SPDX-License-Identifier: MIT
// The capture PC's own wires, as configured (`[gpio]` of stage.toml): arm button, emergency stop, genlock present, tally light.
#pragma once

#include <optional>
#include <string>

namespace ols {

class TomlSection;

enum class GpioBias { as_is, none, pull_up, pull_down };

struct GpioLineSetup {
    std::string line;  // its name on the chip, or its offset in digits
    bool active_low = false;
    GpioBias bias = GpioBias::as_is;
    int debounce_ms = 0;  // for which a level must hold before it counts; the emergency stop has none
};

enum class GenlockAbsence { stops, warns };

// A line that is not there is not used.
struct GpioSetup {
    std::string chip;                             // its name, label, path or number
    std::optional<GpioLineSetup> arm;             // active: the button is pressed
    std::optional<GpioLineSetup> emergency_stop;  // active: stop
    std::optional<GpioLineSetup> genlock;         // active: the signal is there
    GenlockAbsence genlock_absence = GenlockAbsence::stops;
    std::optional<GpioLineSetup> tally;  // output, active: lit

    bool has_lines() const { return arm || emergency_stop || genlock || tally; }
};

GpioSetup read_gpio(TomlSection gpio);

}  // namespace ols
