// SPDX-License-Identifier: MIT
// What stagectl, rf and stagesim do around their verbs: --version, the exit code, and nothing that was printed is lost.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace CLI {
class App;
}

namespace ols {

// Parses the command line, which runs a verb that sets `exit_code`, and returns what main returns. Adds --version. What
// was printed and did not arrive (a full disk behind `>`, a closed standard output) is said on standard error and makes an exit
// code of 0 a 1. A write beyond a limit of file sizes (ulimit -f) becomes an error of its file instead of ending the program.
// An exception that comes this far is printed with the verb and what it was given, and makes an exit code of 1. A word that is no
// verb is an error with --help and --version, too.
int run_program(CLI::App& app, int argc, char** argv, const int& exit_code);

// "stagectl 0.1.0 (commit)", as --version says it.
std::string program_version(const std::string& program);

// Prints JSON and a new line to standard output, from any thread. Bytes that are not UTF-8 (names of files can have them) are
// replaced. A failure shows at the end, in run_program().
void print_json(const nlohmann::json& json, int indent = 1);
inline constexpr int on_one_line = -1;  // an indent

}  // namespace ols
