// SPDX-License-Identifier: MIT
// The verbs of rf. Each adds its subcommand; its callback does the work and returns through `exit_code`: 0 done,
// 1 an error that was printed.
#pragma once

#include <CLI/CLI.hpp>

namespace ols {

void add_info_verb(CLI::App& app, int& exit_code);
void add_verify_verb(CLI::App& app, int& exit_code);
void add_export_verb(CLI::App& app, int& exit_code);
void add_relight_verb(CLI::App& app, int& exit_code);
void add_weights_verb(CLI::App& app, int& exit_code);
void add_furnace_verb(CLI::App& app, int& exit_code);
void add_compare_verb(CLI::App& app, int& exit_code);

}  // namespace ols
