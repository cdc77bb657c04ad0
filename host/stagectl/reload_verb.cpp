// SPDX-License-Identifier: MIT
// stagectl reload: has the daemon read its configuration anew.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

void add_reload_verb(CLI::App& app, int& exit_code) {
    struct Options {
        DaemonLink link;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("reload", "have the daemon read its configuration anew");
    verb->footer(
        "Example: stagectl reload\nWhat is wrong with it is said with file and line, and the one before stays in "
        "force.");
    options->link.add_to(*verb);
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] {
        exit_code = report_errors([&] {
            return call_and_print(options->link, "reload", nlohmann::json::object(), [&](const nlohmann::json& result) {
                if (options->json) return print_json(result);
                fmt::print("{} is in force\n", result["configuration"].get<std::string>());
            });
        });
    });
}

}  // namespace ols
