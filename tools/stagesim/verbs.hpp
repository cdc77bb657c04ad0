// SPDX-License-Identifier: MIT
// The verbs of stagesim. Each adds its subcommand; its callback does the work and returns through `exit_code`: 0 done,
// 1 an error that was printed.
#pragma once

#include <CLI/CLI.hpp>

namespace ols {

void add_flow_verb(CLI::App& app, int& exit_code);
void add_plan_verb(CLI::App& app, int& exit_code);
void add_render_verb(CLI::App& app, int& exit_code);
void add_run_verb(CLI::App& app, int& exit_code);

}  // namespace ols
