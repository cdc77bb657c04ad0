// SPDX-License-Identifier: MIT
// Standard output is buffered: whether all of it arrived is known when it is flushed, at the end.
#include "program.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>

#include "exceptions.hpp"
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

// The program or verb that the command line had come to.
const CLI::App& deepest_verb(const CLI::App& app) {
    const auto below = app.get_subcommands();
    return below.empty() ? app : deepest_verb(*below.front());
}

// "rf relight 'take.rfa'": what was running, and what it was given.
std::string account_of(const CLI::App& app) {
    std::string account = app.get_name();
    for (const CLI::App* verb = &app; !verb->get_subcommands().empty();) {
        verb = verb->get_subcommands().front();
        account += " " + verb->get_name();
    }
    for (const CLI::Option* option : deepest_verb(app).get_options())
        if (option->get_positional())
            for (const auto& word : option->results()) account += " '" + word + "'";
    return account;
}

// The word that stands where a verb should; empty where none does. CLI11 answers --help before it looks for a verb.
std::string wrong_verb(const CLI::App& app) {
    const CLI::App& verb = deepest_verb(app);
    const bool has_verbs = !verb.get_subcommands([](const CLI::App*) { return true; }).empty();
    const auto left_over = verb.remaining();
    return has_verbs && !left_over.empty() ? left_over.front() : "";
}

int answer(const CLI::App& app, const CLI::ParseError& e) {
    const std::string wrong = dynamic_cast<const CLI::Success*>(&e) != nullptr ? wrong_verb(app) : "";
    if (wrong.empty()) return app.exit(e);  // help and version, too
    const std::string account = account_of(app);
    std::fprintf(stderr, "'%s' is no verb of %s: `%s --help` lists them\n", wrong.c_str(), account.c_str(),
                 account.c_str());
    return int(CLI::ExitCodes::ExtrasError);
}

// Where exceptions end that no wrapper of a library has met: memory that ran out, a print that could not be written.
int parse(CLI::App& app, int argc, char** argv, const int& exit_code) {
    try {
        app.parse(argc, argv);
        return exit_code;
    } catch (const CLI::ParseError& e) {
        return answer(app, e);
    } catch (const std::exception& e) {
        std::fprintf(stderr, "%s: %s\n", account_of(app).c_str(), words_of(e).c_str());
    } catch (...) {
        std::fprintf(stderr, "%s: a library gave up without a reason\n", account_of(app).c_str());
    }
    return 1;
}

// Flushes what was printed, and says what did not arrive: the exit code.
int finish_printing(const CLI::App& app, int code) {
    errno = 0;  // std::cout, which CLI11 prints help to, keeps nothing back from stdout
    const bool flushed = std::fflush(stdout) == 0;
    const int error = errno;
    if (flushed && !std::ferror(stdout)) return code;
    std::fprintf(stderr, "%s: what was printed did not all arrive%s%s: check where standard output leads\n",
                 app.get_name().c_str(), flushed ? "" : ": ", flushed ? "" : std::strerror(error));
    return code == 0 ? 1 : code;
}

// OpenBLAS, which OpenCV brings along, starts threads when it is loaded. One that finds no memory for its buffer tries for ever,
// and exit() would wait for it.
bool may_have_threads_that_never_end() {
    rlimit limit{};
    return getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
}

}  // namespace

int run_program(CLI::App& app, int argc, char** argv, const int& exit_code) {
    occupy_standard_descriptors();
    std::signal(SIGXFSZ, SIG_IGN);
    app.set_version_flag("--version", program_version(app.get_name()), "say which version this is");
    int code = 1;
    try {
        code = parse(app, argc, argv, exit_code);
    } catch (const std::exception&) {  // not even memory for the message
        std::fputs("memory ran out: close other programs, or raise the limit (ulimit -v)\n", stderr);
    }
    code = finish_printing(app, code);
    if (may_have_threads_that_never_end()) _exit(code);
    return code;
}

std::string program_version(const std::string& program) {
    return fmt::format("{} {}", program, version);
}

void print_json(const nlohmann::json& json, int indent) {
    const std::string text = json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
    std::fwrite(text.data(), 1, text.size(), stdout);
}

}  // namespace ols
