// SPDX-License-Identifier: MIT
// stagectl arm: makes the daemon's stage ready, so that light comes at once.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

void add_arm_verb(CLI::App& app, int& exit_code) {
    struct Options {
        DaemonLink link;
        TakeParams take;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("arm", "make the daemon's stage ready: sequence, cameras, room on the disk");
    verb->footer("Example: stagectl arm --seconds 20\n`stagectl stop` takes it back.");
    options->link.add_to(*verb);
    options->take.add_to(*verb, false);
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] {
        exit_code = report_errors([&] {
            return call_and_print(options->link, "arm", options->take.to_json(), [&](const nlohmann::json& plan) {
                if (options->json) return print_json(plan);
                fmt::print("armed with {}: {} cycles of {} slots, {:.1f} s; {:.1f} GB at most of {:.1f} GB free\n",
                           plan["sequence"].get<std::string>(), plan["cycles"].get<int>(), plan["slots"].get<int>(),
                           plan["seconds"].get<double>(), plan["disk_bytes_needed"].get<double>() * 1e-9,
                           plan["disk_bytes_free"].get<double>() * 1e-9);
            });
        });
    });
}

}  // namespace ols
