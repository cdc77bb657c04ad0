// SPDX-License-Identifier: MIT
// stagectl: the light stage's control program.
#include <malloc.h>

#include "stagectl/verbs.hpp"

int main(int argc, char** argv) {
    // A target's planes are let go of and made anew, target after target: memory that went back to the kernel in between would
    // be cleared each time, which takes as long as the inversion.
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
    CLI::App app{"Controls a light stage: sequences, takes, calibration, and photographs from elsewhere."};
    app.name("stagectl");
    app.footer("Exit codes: 0 done; 1 an error, named; 2 a take that is not complete; else wrong arguments.");
    app.require_subcommand(1);
    int exit_code = 0;
    ols::add_run_verb(app, exit_code);
    ols::add_play_verb(app, exit_code);
    ols::add_status_verb(app, exit_code);
    ols::add_sequence_verb(app, exit_code);
    ols::add_basis_verb(app, exit_code);
    ols::add_grey_verb(app, exit_code);
    ols::add_calibrate_verb(app, exit_code);
    ols::add_ingest_verb(app, exit_code);
    ols::add_flash_verb(app, exit_code);
    CLI11_PARSE(app, argc, argv);
    return exit_code;
}
