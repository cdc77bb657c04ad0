// SPDX-License-Identifier: MIT
// stagectl reload: has the daemon read its configuration anew.
#include <fmt/format.h>

#include "stagectl/daemon_options.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

void add_reload_verb(CLI::App& app, int& exit_code) {
    add_call_verb(app, exit_code,
                  {"reload", "have the daemon read its configuration anew",
                   "Example: stagectl reload\n"
                   "What is wrong with it is said with file and line, and the one before stays in force.",
                   [](const nlohmann::json& result) {
                       fmt::print("{} is in force\n", result["configuration"].get<std::string>());
                   }});
}

}  // namespace ols
