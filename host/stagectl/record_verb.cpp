// SPDX-License-Identifier: MIT
// stagectl record: a take by the daemon, followed to its end.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/take_follower.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    DaemonLink link;
    TakeParams take;
    bool no_wait = false, json = false;
};

// Returns when the take has begun.
Result<int> begin(const Options& options, DaemonClient& client) {
    const auto begun = client.call("record", options.take.to_json());
    if (!begun.ok()) return begun.error();
    if (options.json)
        print_json(*begun);
    else
        fmt::print("{}\n", (*begun)["take"].get<std::string>());
    return 0;
}

Result<int> run(const Options& options) {
    auto client = options.link.connect();
    if (!client.ok()) return client.error();
    if (options.no_wait) return begin(options, *client);
    const StopRequest& stop = stop_on_signal();
    TakeFollower follower(options.link, *client, options.json);
    const auto begun = follower.begin("record", options.take.to_json(), stop);
    if (!begun.ok()) return begun.error();
    if (begun->contains("waits_for")) say({"waiting for " + (*begun)["waits_for"].get<std::string>()});
    return follower.follow(stop);
}

}  // namespace

void add_record_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("record", "record a take with the daemon");
    verb->footer(
        "Example: stagectl record --seconds 5 --slate 12A --notes \"blinks\"\n"
        "Ctrl-C ends the light; what was recorded is finished. With --no-wait it returns when light comes.\n"
        "Exit codes: 0 every slot and target is there; 1 an error; 2 the archive is finished, and slots or targets are "
        "missing.\nFlashing light can trigger seizures: see `stagectl sequence`.");
    options->link.add_to(*verb);
    options->take.add_to(*verb, true);
    verb->add_flag("--no-wait", options->no_wait, "return when the take has begun");
    verb->add_flag("--json", options->json, "print the report as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
