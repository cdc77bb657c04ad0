// SPDX-License-Identifier: MIT
// stagectl preview: a look at the latest target, relit.
#include <fmt/format.h>

#include "image/base64.hpp"
#include "image/outputs.hpp"
#include "image/whole_file.hpp"
#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"

namespace ols {

namespace {

struct Options {
    DaemonLink link;
    std::string take, output = "preview.png";
    double exposure_ev = 0;
    bool json = false;
};

Result<int> run(const Options& options) {
    if (const Status writable = check_outputs({.png = {options.output}}); !writable.ok()) return writable.error();
    auto client = options.link.connect();
    if (!client.ok()) return client.error();
    nlohmann::json params = {{"exposure", options.exposure_ev}};
    if (!options.take.empty()) params["take"] = options.take;
    auto result = client->call("preview", params);
    if (!result.ok()) return result.error();
    const auto png = bytes_of_base64((*result)["png_base64"].get<std::string>());
    if (!png.ok()) return png.error();
    if (const Status written = write_whole_file(options.output, *png); !written.ok()) return written.error();
    result->erase("png_base64");
    (*result)["output"] = options.output;
    if (options.json)
        print_json(*result);
    else
        fmt::print("{}: target {} of camera {} of {}, {} of {} pixels masked\n", options.output,
                   (*result)["target"].get<int>(), (*result)["camera"].get<int>(),
                   (*result)["archive"].get<std::string>(), (*result)["masked_pixels"].get<int>(),
                   (*result)["width"].get<int>() * (*result)["height"].get<int>());
    return 0;
}

}  // namespace

void add_preview_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("preview", "the latest target of the daemon's takes, relit, as a PNG");
    verb->footer(
        "Example: stagectl preview -o look.png\n"
        "Lit by a key light from the upper left and some light from everywhere; for other light: rf relight.");
    options->link.add_to(*verb);
    verb->add_option("take", options->take, "the take, as `stagectl takes` names it; otherwise the latest");
    verb->add_option("-o,--output", options->output, "PNG to write")->capture_default_str();
    verb->add_option("--exposure", options->exposure_ev, "stops brighter")->check(CLI::Range(-20.0, 20.0));
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
