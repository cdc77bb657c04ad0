// SPDX-License-Identifier: MIT
// stagesim: the virtual stage.
#include "program.hpp"
#include "verbs.hpp"

int main(int argc, char** argv) {
    CLI::App app{"stagesim: a light stage without the stage: what its cameras see of a scene under its lamps."};
    app.name("stagesim");
    app.require_subcommand(1);
    app.footer(
        "Example: stagesim plan tools/stagesim/scenes/head.toml\nExit codes: 0 done, 1 an error (printed), 105 and "
        "above a wrong command line.");
    int exit_code = 0;
    ols::add_flow_verb(app, exit_code);
    ols::add_plan_verb(app, exit_code);
    ols::add_render_verb(app, exit_code);
    ols::add_run_verb(app, exit_code);
    return ols::run_program(app, argc, argv, exit_code);
}
