// SPDX-License-Identifier: MIT
// Which sequence: a file, a basis with the defaults of everything else, or a file with another basis.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "stage/sequence.hpp"

namespace ols {

struct SequenceOptions {
    std::string path, basis;
    double exposure_us = 0;

    // `path_option` is "--sequence" or, for an argument without a dash, "sequence".
    void add_to(CLI::App& verb, const std::string& path_option);
};

// A basis takes the place of the file's and of its basis exposure, which was for the file's own. Errors: neither file nor
// basis; those of read_sequence and check_basis_name.
Result<SequenceConfig> open_sequence(const SequenceOptions& options);

// Compiled for the stage, with `cycles` of its own unless they are -1.
Result<Sequence> open_compiled(const SequenceOptions& options, int cycles, const StageConfig& stage);

}  // namespace ols
