// SPDX-License-Identifier: MIT
// stagectl basis: what is done with lighting bases without a board.
#include <fmt/format.h>

#include "stage/basis.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

void print_kinds() {
    for (const auto& kind : basis_kinds()) fmt::print("{:26} {}\n", kind.name, kind.meaning);
}

}  // namespace

void add_basis_verb(CLI::App& app, int& exit_code) {
    CLI::App* verb = app.add_subcommand("basis", "lighting bases: which there are, and what they are good for");
    verb->require_subcommand(1);
    CLI::App* list = verb->add_subcommand("list", "the bases there are");
    list->footer("Example: stagectl basis list");
    list->callback(print_kinds);
    add_basis_report_verb(*verb, exit_code);
    add_basis_export_verb(*verb, exit_code);
    add_basis_design_verb(*verb, exit_code);
}

}  // namespace ols
