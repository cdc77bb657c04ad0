// SPDX-License-Identifier: MIT
// stagectl serve: the daemon.
#include <nlohmann/json.hpp>

#include "daemon/daemon.hpp"
#include "program.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    DaemonOptions daemon;
    bool check = false, json = false;
};

Result<int> run(const Options& options) {
    if (options.json && !options.check) return fail("--json is of --check: the daemon's log is on standard error");
    const Status done = options.check ? check_configuration(options.daemon.config_path) : run_daemon(options.daemon);
    if (options.json)
        print_json({{"configuration", options.daemon.config_path}, {"problem", done.ok() ? "" : done.error().message}});
    if (!done.ok()) return done.error();
    return 0;
}

}  // namespace

void add_serve_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    options->daemon.config_path = "/etc/stagectl/stage.toml";
    CLI::App* verb = app.add_subcommand("serve", "run the daemon that holds the stage and records its takes");
    verb->footer(
        "Example: stagectl serve --config /etc/stagectl/stage.toml\n"
        "It listens at [daemon] socket for the other verbs: status, arm, record, stop, takes, preview, log, swap, "
        "calibrate, reload.\n"
        "SIGTERM ends the light, finishes what was recorded, and ends; SIGHUP reads the configuration anew.\n"
        "Flashing light can trigger seizures: see `stagectl sequence`.");
    verb->add_option("--config", options->daemon.config_path, "the stage, with a table [daemon]")
        ->capture_default_str();
    verb->add_flag(
        "--check", options->check,
        "check the configuration, and end; as root or as the daemon's user, for it looks at its folders, too");
    verb->add_flag("--json", options->json, "print what --check found as JSON");
    verb->callback([options, &exit_code] {
        options->daemon.program_version = program_version("stagectl");
        exit_code = report_errors([&] { return run(*options); });
    });
}

}  // namespace ols
