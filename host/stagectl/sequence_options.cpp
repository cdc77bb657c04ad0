// SPDX-License-Identifier: MIT
// Options over file over defaults.
#include "stagectl/sequence_options.hpp"

namespace ols {

void SequenceOptions::add_to(CLI::App& verb, const std::string& path_option) {
    verb.add_option(path_option, path, "sequence.toml; not needed with --basis");
    verb.add_option("--basis", basis,
                    "lighting basis, of `stagectl basis list` or a FILE.csv, instead of the sequence's");
    verb.add_option("--exposure-us", exposure_us,
                    "of the basis slots; else the sequence's, or as long as a white card stays below saturation")
        ->check(CLI::Range(1.0, 1e6));
}

Result<SequenceConfig> open_sequence(const SequenceOptions& options) {
    if (options.path.empty() && options.basis.empty()) return fail("which sequence? give a sequence.toml, or --basis");
    SequenceConfig config;
    if (!options.path.empty()) {
        auto read = read_sequence(options.path);
        if (!read.ok()) return read;
        config = std::move(*read);
    }
    if (!options.basis.empty()) {
        if (const Status status = check_basis_name(options.basis); !status.ok()) return status.error();
        config.basis = options.basis;
        config.basis_exposure_us = 0;
        config.listed_slots.clear();
    }
    if (options.exposure_us > 0) config.basis_exposure_us = options.exposure_us;
    return config;
}

Result<Sequence> open_compiled(const SequenceOptions& options, int cycles, const StageConfig& stage) {
    auto config = open_sequence(options);
    if (!config.ok()) return config.error();
    if (cycles >= 0) config->cycles = cycles;
    return compile_sequence(*config, stage);
}

}  // namespace ols
