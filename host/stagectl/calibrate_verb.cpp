// SPDX-License-Identifier: MIT
// stagectl calibrate: black level and flat field from a white card.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "program.hpp"
#include "stagectl/daemon_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/take_follower.hpp"
#include "stagectl/verbs.hpp"
#include "take/card.hpp"

namespace ols {

namespace {

struct Options {
    DaemonLink daemon;
    LinkOptions links;
    CardOptions card;
    std::string output;
    bool json = false;
};

// Into the folder that the daemon's stage names.
Result<int> calibrate_by_daemon(const Options& options) {
    if (!options.output.empty())
        return fail("-o: the daemon writes to the folder that its stage names: leave it out, or give --stage");
    auto client = options.daemon.connect();
    if (!client.ok()) return client.error();
    nlohmann::json params = {
        {"card", options.card.reflectance}, {"number", options.card.camera}, {"cycles", options.card.cycles}};
    if (options.card.exposure_us > 0) params["exposure_us"] = options.card.exposure_us;
    const StopRequest& stop = stop_on_signal();
    TakeFollower follower(options.daemon, *client, options.json);
    if (const auto begun = follower.begin("calibrate", params, stop); !begun.ok()) return begun.error();
    return follower.follow(stop);
}

Result<int> run(const Options& options) {
    if (options.links.names_nothing()) return calibrate_by_daemon(options);
    if (options.output.empty()) return fail("-o FOLDER: say where the calibration goes");
    auto session = open_session(options.links, options.card.camera);
    if (!session.ok()) return session.error();
    StopRequest& stop = stop_on_signal();
    auto watch = StageWatch::open(session->stage, stop);
    if (!watch.ok()) return watch.error();
    if (const Status ready = watch->begin_take(); !ready.ok()) return ready.error();
    const auto card =
        calibrate_with_card(*session->board, *session->cameras[0], session->stage, options.card, stop,
                            [](uint64_t decided, uint64_t total) { show_progress("calibrating", decided, total); });
    say(watch->end_take());
    if (!card.ok()) return because_of(stop, card.error());
    if (Status s = write_calibration(options.output, options.card.camera, card->calibration, card->record); !s.ok())
        return s.error();
    if (options.json)
        print_json(card->to_json(options.output));
    else
        fmt::print("{}: {}\n", options.output, card->to_text());
    return 0;
}

}  // namespace

void add_calibrate_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb =
        app.add_subcommand("calibrate", "measure black level and flat field with a white card that fills the view");
    verb->footer(
        "Example: stagectl calibrate --stage examples/stage.toml --board socket:run/board.sock \\\n"
        "           --camera ring:run/cam0.ring --card 0.985 -o cal\n"
        "         stagectl calibrate --card 0.985               the daemon's stage\n"
        "         stagectl calibrate --number 1 ... -o cal     the second camera's, into the same folder\n"
        "The card stands at the stage's centre and faces the camera. All lamps flash; nothing is written when a sample "
        "saturates,\nthe card is too dark or does not fill the view.");
    options->links.add_to(*verb, true);
    options->daemon.add_to(*verb);
    verb->add_option("--card", options->card.reflectance, "reflectance of the card")->check(CLI::Range(0.01, 1.0));
    verb->add_option("--number", options->card.camera,
                     "which of the stage's cameras, from 0: each has the card face it in its turn, and its own part of "
                     "the folder")
        ->capture_default_str();
    verb->add_option("--exposure-us", options->card.exposure_us, "exposure; otherwise chosen from the camera's gain")
        ->check(CLI::Range(0.1, 400.0));
    verb->add_option("--cycles", options->card.cycles, "times 8 frames are averaged")->check(CLI::Range(1, 10'000));
    verb->add_option("-o,--output", options->output,
                     "folder to write; the daemon writes to the one that its stage names");
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
