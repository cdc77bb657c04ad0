// SPDX-License-Identifier: MIT
// What a person in the room is told.
#include "stagectl/flicker_warning.hpp"

#include <fmt/format.h>

namespace ols {

std::string flicker_warning(const Flicker& flicker) {
    if (flicker.whole.modulation > photosensitive_modulation)
        return fmt::format(
            "WARNING: the light as a whole flickers by more than {:.0f} % at a rate that can trigger seizures. Warn "
            "everyone in the room.",
            photosensitive_modulation * 100);
    if (flicker.worst_lamp.modulation > photosensitive_modulation)
        return "WARNING: whoever looks straight at a lamp sees it flicker at a rate that can trigger seizures. Warn "
               "everyone in the room.";
    return "";
}

void warn_of_flicker(const Sequence& sequence) {
    if (const std::string warning = flicker_warning(measure_flicker(sequence)); !warning.empty())
        fmt::print(stderr, "stagectl: {}\n", warning);
}

}  // namespace ols
