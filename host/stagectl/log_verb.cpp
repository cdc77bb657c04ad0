// SPDX-License-Identifier: MIT
// stagectl log: what happened to the daemon's stage.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    DaemonLink link;
    int lines = 50;
    uint64_t after = 0;
    bool follow = false, json = false;
};

void print_event(const nlohmann::json& event, bool json) {
    if (json)
        print_json(event, on_one_line);
    else
        fmt::print("{}\n", event_line(event));
    std::fflush(stdout);
}

Result<int> run(const Options& options) {
    auto client = options.link.connect();
    if (!client.ok()) return client.error();
    // Subscribed first, so that nothing falls between the past and what comes.
    if (options.follow)
        if (const auto begun = client->call("subscribe"); !begun.ok()) return begun.error();
    const auto past = client->call("log", {{"limit", options.lines}, {"after", options.after}});
    if (!past.ok()) return past.error();
    uint64_t last = 0;
    for (const auto& event : (*past)["events"]) {
        print_event(event, options.json);
        last = event["number"];
    }
    const StopRequest& stop = stop_on_signal();
    while (options.follow && !stop.wanted) {
        const auto event = client->next_event(std::chrono::milliseconds(200));
        if (!event.ok()) return event.error();
        if (*event && (**event)["number"] > last && (**event)["level"] != "debug") print_event(**event, options.json);
    }
    return 0;
}

}  // namespace

void add_log_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("log", "what happened to the daemon's stage, by time, level, code and words");
    verb->footer("Example: stagectl log -n 100 --follow\nWhat each code means: docs/operating.md.");
    options->link.add_to(*verb);
    verb->add_option("-n,--lines", options->lines, "how many events")
        ->check(CLI::Range(1, 2000))
        ->capture_default_str();
    verb->add_option("--after", options->after, "only those with a higher number");
    verb->add_flag("-f,--follow", options->follow, "go on with what comes, until Ctrl-C");
    verb->add_flag("--json", options->json, "print a JSON line for each");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
