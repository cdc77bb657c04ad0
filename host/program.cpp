// SPDX-License-Identifier: MIT
// Standard output is buffered: whether all of it arrived is known when it is flushed, at the end.
#include "program.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>
#include <system_error>

#include "version.hpp"

namespace ols {

namespace {

// A closed descriptor would be given to the next file that is opened, and prints would land in it.
void occupy_standard_descriptors() {
    // Output for reading alone, so that what is printed still fails.
    if (fcntl(STDIN_FILENO, F_GETFD) < 0) ::open("/dev/null", O_RDONLY);
    if (fcntl(STDOUT_FILENO, F_GETFD) < 0) ::open("/dev/null", O_RDONLY);
    if (fcntl(STDERR_FILENO, F_GETFD) < 0) ::open("/dev/null", O_WRONLY);
}

int parse(CLI::App& app, int argc, char** argv, const int& exit_code) {
    try {
        app.parse(argc, argv);
        return exit_code;
    } catch (const CLI::ParseError& e) {
        return app.exit(e);  // help and version, too
    } catch (const std::system_error& e) {
        // fmt::print throws where it cannot write.
        std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), e.what());
        return 1;
    }
}

}  // namespace

int run_program(CLI::App& app, int argc, char** argv, const int& exit_code) {
    occupy_standard_descriptors();
    std::signal(SIGXFSZ, SIG_IGN);
    app.set_version_flag("--version", fmt::format("{} {}", app.get_name(), version), "say which version this is");
    const int code = parse(app, argc, argv, exit_code);
    errno = 0;  // std::cout, which CLI11 prints help to, keeps nothing back from stdout
    const bool flushed = std::fflush(stdout) == 0;
    const int error = errno;
    if (flushed && !std::ferror(stdout)) return code;
    std::fprintf(stderr, "%s: what was printed did not all arrive%s%s: check where standard output leads\n",
                 app.get_name().c_str(), flushed ? "" : ": ", flushed ? "" : std::strerror(error));
    return code == 0 ? 1 : code;
}

void print_json(const nlohmann::json& json, int indent) {
    const std::string text = json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
    std::fwrite(text.data(), 1, text.size(), stdout);
}

}  // namespace ols
