// SPDX-License-Identifier: MIT
// stagectl stop: light off, and the board's word that it is.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

void add_stop_verb(CLI::App& app, int& exit_code) {
    struct Options {
        DaemonLink link;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("stop", "light off at once; ends when the board has confirmed that it is dark");
    verb->footer(
        "Example: stagectl stop\nExit codes: 0 the board says that it is dark; 1 it does not: use the emergency stop.");
    options->link.add_to(*verb);
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] {
        exit_code = report_errors([&] {
            return call_and_print(options->link, "stop", nlohmann::json::object(), [&](const nlohmann::json& dark) {
                if (options->json) return print_json(dark);
                fmt::print("dark, as the board says, after {:.0f} ms\n", dark["after_ms"].get<double>());
            });
        });
    });
}

}  // namespace ols
