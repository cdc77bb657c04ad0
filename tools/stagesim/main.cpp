// SPDX-License-Identifier: MIT
// stagesim: the virtual stage.
#include "verbs.hpp"

int main(int argc, char** argv) {
    CLI::App app{"stagesim: a light stage without the stage: what its cameras see of a scene under its lamps."};
    app.require_subcommand(1);
    app.footer("Exit codes: 0 done, 1 an error (printed), 105 and above a wrong command line.");
    int exit_code = 0;
    ols::add_flow_verb(app, exit_code);
    ols::add_plan_verb(app, exit_code);
    ols::add_render_verb(app, exit_code);
    ols::add_run_verb(app, exit_code);
    CLI11_PARSE(app, argc, argv);
    return exit_code;
}
