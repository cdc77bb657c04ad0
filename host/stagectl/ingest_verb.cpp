// SPDX-License-Identifier: MIT
// stagectl ingest: becomes stagectl-ingest, which lies beside this program.
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "stagectl/verbs.hpp"

namespace ols {

namespace {

// Returns only if it fails.
void become(const std::string& program, std::vector<std::string> arguments) {
    std::vector<char*> words{const_cast<char*>(program.c_str())};
    for (auto& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    execv(program.c_str(), words.data());
    fmt::print(stderr, "stagectl ingest: cannot run '{}' ({}): install it beside stagectl\n", program,
               std::strerror(errno));
}

}  // namespace

void add_ingest_verb(CLI::App& app, int& exit_code) {
    CLI::App* verb = app.add_subcommand(
        "ingest", "make an archive from photographs and an .lp file, or from a recording in a camera's own memory");
    verb->set_help_flag();
    verb->prefix_command();
    verb->callback([verb, &exit_code] {
        std::error_code error;
        const auto self = std::filesystem::read_symlink("/proc/self/exe", error);
        exit_code = 1;
        if (error) {
            fmt::print(stderr, "stagectl ingest: cannot find the folder of stagectl ({}): mount /proc\n",
                       error.message());
            return;
        }
        become((self.parent_path() / "stagectl-ingest").string(), verb->remaining());
    });
}

}  // namespace ols
