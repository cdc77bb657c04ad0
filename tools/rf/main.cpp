// SPDX-License-Identifier: MIT
// rf: what is done with reflectance functions after the take.
#include "program.hpp"
#include "verbs.hpp"

int main(int argc, char** argv) {
    CLI::App app{"Reads, checks, exports and relights archives of reflectance functions (take.rfa)."};
    app.name("rf");
    app.footer("Example: rf info take.rfa\nExit codes: 0 done; 1 an error or a problem, named; else wrong arguments.");
    app.require_subcommand(1);
    int exit_code = 0;
    ols::add_info_verb(app, exit_code);
    ols::add_verify_verb(app, exit_code);
    ols::add_export_verb(app, exit_code);
    ols::add_relight_verb(app, exit_code);
    ols::add_weights_verb(app, exit_code);
    ols::add_furnace_verb(app, exit_code);
    ols::add_compare_verb(app, exit_code);
    return ols::run_program(app, argc, argv, exit_code);
}
