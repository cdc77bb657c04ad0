// SPDX-License-Identifier: MIT
// stagectl basis export: a basis as a table, with its order of play and its classes of loss.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "image/outputs.hpp"
#include "image/whole_file.hpp"
#include "stage/basis_file.hpp"
#include "stage/row_losses.hpp"
#include "stagectl/lost_slots.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    SequenceOptions sequence;
    std::string stage, output;
    bool json = false;
};

Result<Sequence> compile(const Options& options) {
    const auto stage = options.stage.empty() ? Result<StageConfig>(default_stage()) : read_stage(options.stage);
    if (!stage.ok()) return stage.error();
    const auto config = open_sequence(options.sequence);
    if (!config.ok()) return config.error();
    auto sequence = compile_sequence(*config, *stage);
    if (sequence.ok() && !sequence->is_capture())
        return fail(sequence->basis.name + " is played, not inverted: choose a capture basis");
    return sequence;
}

std::string to_csv(const Sequence& sequence) {
    return basis_text(
        sequence.basis,
        fmt::format(
            "basis {}: a row a line, in the rows' own order; a level a lamp\norder_of_play = {}\nloss_class = {}",
            sequence.basis.name, fmt::join(sequence.order_of_play(), ","),
            fmt::join(RowLosses(sequence.basis).classes(), ",")));
}

nlohmann::json to_json(const Sequence& sequence) {
    const Basis& basis = sequence.basis;
    auto levels = nlohmann::json::array(), inverse = nlohmann::json::array();
    for (int row = 0; row < basis.rows; ++row) {
        auto row_levels = nlohmann::json::array(), row_inverse = nlohmann::json::array();
        for (int lamp = 0; lamp < basis.lamps; ++lamp) row_levels.push_back(basis.level(row, lamp));
        for (int image = 0; image < basis.images(); ++image) row_inverse.push_back(basis.inverse(row, image));
        levels.push_back(std::move(row_levels));
        inverse.push_back(std::move(row_inverse));
    }
    return {{"basis", basis.name},
            {"rows", basis.rows},
            {"lamps", basis.lamps},
            {"level_max", basis.level_max},
            {"levels", levels},
            {"image_lamps", basis.image_lamps},
            {"inverse", inverse},
            {"is_estimate", basis.is_estimate},
            {"order_of_play", sequence.order_of_play()},
            {"loss_class", RowLosses(basis).classes()},
            {"lost_slots", lost_slots_json(sequence)}};
}

Result<int> run(const Options& options) {
    const Status writable = check_outputs(
        {.inputs = {options.sequence.path, options.sequence.basis, options.stage}, .files = {options.output}});
    if (!writable.ok()) return writable.error();
    const auto sequence = compile(options);
    if (!sequence.ok()) return sequence.error();
    // Names of files may not be UTF-8; that is replaced, not thrown at.
    const auto replaced = nlohmann::json::error_handler_t::replace;
    const std::string text =
        options.json ? to_json(*sequence).dump(-1, ' ', false, replaced) + "\n" : to_csv(*sequence);
    if (options.output.empty()) {
        fmt::print("{}", text);
        return 0;
    }
    if (const Status status = write_whole_file(options.output, text); !status.ok()) return status.error();
    return 0;
}

}  // namespace

void add_basis_export_verb(CLI::App& basis, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb =
        basis.add_subcommand("export", "a basis's levels, order of play and classes of loss, as CSV or JSON");
    verb->footer(
        "Example: stagectl basis export s159 -o s159.csv\n"
        "         stagectl basis export s159 --json -o s159.json\n"
        "The CSV is a basis file: `--basis s159.csv` plays it, and numpy.loadtxt(\"s159.csv\", delimiter=\",\") reads "
        "it.\n"
        "Of two lost rows of one class the others do not make up for, of two of different classes they do; -1: not "
        "even "
        "for that row alone. See docs/bases.md.");
    verb->add_option("basis", options->sequence.basis, "of `stagectl basis list`, or a FILE.csv")->required();
    verb->add_option("--sequence", options->sequence.path, "sequence.toml, whose groups the order of play depends on");
    verb->add_option("--stage", options->stage, "stage.toml; without it, the default stage");
    verb->add_flag("--json", options->json, "as JSON, with the inversion and what bursts of lost slots cost");
    verb->add_option("-o,--output", options->output, "file to write; without it, standard output");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
