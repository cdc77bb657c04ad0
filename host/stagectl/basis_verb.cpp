// SPDX-License-Identifier: MIT
// stagectl basis: what is done with lighting bases without a board.
#include "stagectl/verbs.hpp"

namespace ols {

void add_basis_verb(CLI::App& app, int& exit_code) {
    CLI::App* verb = app.add_subcommand("basis", "lighting bases: what they are good for, and better ones");
    verb->require_subcommand(1);
    add_basis_design_verb(*verb, exit_code);
}

}  // namespace ols
