// SPDX-License-Identifier: MIT
// The verbs of stagectl. Each adds its subcommand; its callback does the work and returns through `exit_code`: 0 done,
// 1 an error that was printed, 2 a take that was recorded and is not complete, or a warning of doctor.
#pragma once

#include <CLI/CLI.hpp>

namespace ols {

void add_run_verb(CLI::App& app, int& exit_code);
void add_serve_verb(CLI::App& app, int& exit_code);
void add_arm_verb(CLI::App& app, int& exit_code);
void add_record_verb(CLI::App& app, int& exit_code);
void add_stop_verb(CLI::App& app, int& exit_code);
void add_takes_verb(CLI::App& app, int& exit_code);
void add_preview_verb(CLI::App& app, int& exit_code);
void add_log_verb(CLI::App& app, int& exit_code);
void add_reload_verb(CLI::App& app, int& exit_code);
void add_play_verb(CLI::App& app, int& exit_code);
void add_status_verb(CLI::App& app, int& exit_code);
void add_sequence_verb(CLI::App& app, int& exit_code);
void add_basis_verb(CLI::App& app, int& exit_code);
void add_basis_design_verb(CLI::App& basis, int& exit_code);
void add_basis_export_verb(CLI::App& basis, int& exit_code);
void add_basis_report_verb(CLI::App& basis, int& exit_code);
void add_calibrate_verb(CLI::App& app, int& exit_code);
void add_grey_verb(CLI::App& app, int& exit_code);
void add_ingest_verb(CLI::App& app, int& exit_code);
void add_swap_verb(CLI::App& app, int& exit_code);
void add_doctor_verb(CLI::App& app, int& exit_code);
void add_flash_verb(CLI::App& app, int& exit_code);

}  // namespace ols
