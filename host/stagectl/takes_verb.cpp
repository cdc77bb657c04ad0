// SPDX-License-Identifier: MIT
// stagectl takes: what the daemon has recorded.
#include <fmt/format.h>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

void print_takes(const nlohmann::json& result) {
    fmt::print("{}\n", result["folder"].get<std::string>());
    for (const auto& take : result["takes"]) {
        const std::string name = take["take"], state = take["state"];
        if (!take.contains("bytes")) {
            fmt::print("{:24} {}\n", name, state);
            continue;
        }
        fmt::print("{:24} {:14} {:6} targets, {} missing, {:8.2f} GB  {}\n", name, state,
                   take["targets_written"].get<int>(), take["targets_missing"].get<int>(),
                   take["bytes"].get<double>() * 1e-9, take["notes"].get<std::string>());
    }
}

}  // namespace

void add_takes_verb(CLI::App& app, int& exit_code) {
    struct Options {
        DaemonLink link;
        int limit = 50;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("takes", "list the daemon's takes, the latest first");
    verb->footer("Example: stagectl takes --limit 10");
    options->link.add_to(*verb);
    verb->add_option("--limit", options->limit, "how many at most")->check(CLI::Range(1, 1000))->capture_default_str();
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] {
        exit_code = report_errors([&] {
            return call_and_print(options->link, "takes", {{"limit", options->limit}},
                                  [&](const nlohmann::json& takes) {
                                      if (options->json) return print_json(takes);
                                      print_takes(takes);
                                  });
        });
    });
}

}  // namespace ols
