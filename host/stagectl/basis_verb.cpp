// SPDX-License-Identifier: MIT
// stagectl basis: what is done with lighting bases without a board.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "program.hpp"
#include "stage/basis.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

void print_kinds(bool as_json) {
    if (!as_json) {
        for (const auto& kind : basis_kinds()) fmt::print("{:26} {}\n", kind.name, kind.meaning);
        return;
    }
    auto bases = nlohmann::json::array();
    for (const auto& kind : basis_kinds()) bases.push_back({{"name", kind.name}, {"meaning", kind.meaning}});
    print_json({{"bases", bases}});
}

}  // namespace

void add_basis_verb(CLI::App& app, int& exit_code) {
    CLI::App* verb = app.add_subcommand("basis", "lighting bases: which there are, and what they are good for");
    verb->footer("Example: stagectl basis report s159");
    verb->require_subcommand(1);
    CLI::App* list = verb->add_subcommand("list", "the bases there are");
    list->footer("Example: stagectl basis list");
    auto as_json = std::make_shared<bool>(false);
    list->add_flag("--json", *as_json, "print as JSON");
    list->callback([as_json] { print_kinds(*as_json); });
    add_basis_report_verb(*verb, exit_code);
    add_basis_export_verb(*verb, exit_code);
    add_basis_design_verb(*verb, exit_code);
}

}  // namespace ols
