// SPDX-License-Identifier: MIT
// stagectl ingest of a recording: a .cine or numbered files, with the sequence that was played.
#pragma once

#include <CLI/CLI.hpp>

namespace ols {

// Whether the arguments say --sequence or --basis, which only recordings have.
bool is_recording(int argc, char** argv);

void add_recording_options(CLI::App& app, int& exit_code);

}  // namespace ols
