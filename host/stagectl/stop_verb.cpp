// SPDX-License-Identifier: MIT
// stagectl stop: light off, and the board's word that it is.
#include <fmt/format.h>

#include "stagectl/daemon_options.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

void add_stop_verb(CLI::App& app, int& exit_code) {
    add_call_verb(app, exit_code,
                  {"stop", "light off at once; ends when the board has confirmed that it is dark",
                   "Example: stagectl stop\n"
                   "Exit codes: 0 the board says that it is dark; 1 it does not: use the emergency stop.",
                   [](const nlohmann::json& dark) {
                       fmt::print("dark, as the board says, after {:.0f} ms\n", dark["after_ms"].get<double>());
                   }});
}

}  // namespace ols
