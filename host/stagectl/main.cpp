// SPDX-License-Identifier: MIT
// stagectl: the light stage's control program.
#include "image/freed_planes.hpp"
#include "program.hpp"
#include "stagectl/verbs.hpp"

int main(int argc, char** argv) {
    ols::keep_freed_planes();  // a take makes the same planes for target after target
    CLI::App app{"Controls a light stage: sequences, takes, calibration, and photographs from elsewhere."};
    app.name("stagectl");
    app.footer(
        "Example: stagectl sequence examples/sequence_s159.toml\nExit codes: 0 done; 1 an error, named; 2 a take that "
        "is not complete, or a warning of doctor; else wrong arguments.");
    app.require_subcommand(1);
    int exit_code = 0;
    ols::add_serve_verb(app, exit_code);
    ols::add_status_verb(app, exit_code);
    ols::add_arm_verb(app, exit_code);
    ols::add_record_verb(app, exit_code);
    ols::add_stop_verb(app, exit_code);
    ols::add_takes_verb(app, exit_code);
    ols::add_preview_verb(app, exit_code);
    ols::add_log_verb(app, exit_code);
    ols::add_reload_verb(app, exit_code);
    ols::add_run_verb(app, exit_code);
    ols::add_play_verb(app, exit_code);
    ols::add_swap_verb(app, exit_code);
    ols::add_sequence_verb(app, exit_code);
    ols::add_basis_verb(app, exit_code);
    ols::add_grey_verb(app, exit_code);
    ols::add_calibrate_verb(app, exit_code);
    ols::add_ingest_verb(app, exit_code);
    ols::add_doctor_verb(app, exit_code);
    ols::add_flash_verb(app, exit_code);
    return ols::run_program(app, argc, argv, exit_code);
}
