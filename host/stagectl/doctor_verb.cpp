// SPDX-License-Identifier: MIT
// stagectl doctor: is this machine ready for a shoot, and what to type where it is not.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "daemon/disk_forecast.hpp"
#include "daemon/take_plan.hpp"
#include "doctor/check_up.hpp"
#include "program.hpp"
#include "stagectl/doctor_table.hpp"
#include "stagectl/sequence_options.hpp"
#include "stagectl/session.hpp"
#include "stagectl/verbs.hpp"
#include "take/frame_rooms.hpp"

namespace ols {

namespace {

struct Options {
    LinkOptions links;
    SequenceOptions sequence;
    std::string takes, spill;
    std::optional<double> take_s, target_rate_hz;
    bool list = false, json = false, quick = false;
};

int list_checks(bool as_json) {
    auto json = nlohmann::json::array();
    for (const CheckName& name : check_names) {
        if (as_json)
            json.push_back({{"id", name.id}, {"what", name.what}});
        else
            fmt::print("{:<26}{}\n", name.id, name.what);
    }
    if (as_json) print_json({{"checks", json}});
    return 0;
}

// Of the stage's cameras, in their order.
Result<std::vector<std::string>> sources_of(const Options& options, const StageConfig& stage) {
    std::vector<std::string> sources = options.links.cameras;
    if (sources.empty())
        for (const CameraConfig& camera : stage.cameras) sources.push_back(camera.source);
    if (sources.size() == stage.cameras.size()) return sources;
    return fail(
        fmt::format("--camera is given {} times, and the stage has {} [[camera]]: give one source for each, in "
                    "their order",
                    sources.size(), stage.cameras.size()));
}

// The sequence decides how often cameras fire.
Result<Sequence> sequence_of(const Options& options, const StageConfig& stage) {
    SequenceOptions wanted = options.sequence;
    const bool is_asked_for = !wanted.path.empty() || !wanted.basis.empty();
    if (!is_asked_for && stage.daemon.is_there) {
        const auto config = find_sequence(stage.daemon.sequence, stage.daemon);
        if (!config.ok()) return config.error();
        return compile_sequence(*config, stage);
    }
    if (!is_asked_for) wanted.basis = SequenceConfig{}.basis;
    return open_compiled(wanted, -1, stage);
}

// What is not said is as the daemon's configuration says.
void take_defaults(const DaemonSetup& daemon, Options& options) {
    if (!daemon.is_there) return;
    if (options.takes.empty()) options.takes = daemon.takes;
    if (options.spill.empty()) options.spill = daemon.spill;
    if (!options.take_s) options.take_s = daemon.seconds;
    if (!options.target_rate_hz) options.target_rate_hz = daemon.fps;
}

Result<StageNeeds> needs_of(const Options& options, const StageConfig& stage) {
    const auto sequence = sequence_of(options, stage);
    if (!sequence.ok()) return sequence.error();
    TakeTargets targets;
    const double target_rate_hz = options.target_rate_hz.value_or(0);
    targets.every = target_rate_hz > 0 ? 1 : 0;  // of a performance, which has more beside its lamps
    std::vector<uint64_t> target_bytes;
    if (sequence->is_capture())
        for (size_t camera = 0; camera < stage.cameras.size(); ++camera)
            target_bytes.push_back(target_bytes_max(*sequence, stage, camera, targets, false));
    StageNeeds needs = needs_of(stage, *sequence, options.take_s.value_or(10), target_rate_hz, target_bytes);
    TakeDescription take{*sequence, stage, {}, {}};
    take.sequence.config.cycles = 4;  // none of its targets needs frames of more
    take.masks.fill_from_neighbours = stage.daemon.fill == "neighbours";
    take.memory.spill_folder = options.spill;
    needs.frames_held = frames_held(take, {{std::shared_ptr<TargetSink>(), targets}});
    return needs;
}

bool is_coloured() {
    return isatty(STDOUT_FILENO) && !std::getenv("NO_COLOR");
}

Result<int> run(Options options) {
    if (options.list) return list_checks(options.json);
    const auto stage = open_stage(options.links);
    if (!stage.ok()) return stage.error();
    take_defaults(stage->daemon, options);
    const auto sources = sources_of(options, *stage);
    if (!sources.ok()) return sources.error();
    const auto needs = needs_of(options, *stage);
    if (!needs.ok()) return needs.error();
    const bool has_aravis =
        std::ranges::any_of(*sources, [](const std::string& source) { return source.starts_with("aravis:"); });
    const Machine machine;
    CheckUp up{.machine = machine,
               .stage = *stage,
               .needs = *needs,
               .board_link = options.links.board.empty() ? stage->board : options.links.board,
               .cameras = place_cameras(*sources, has_aravis ? list_aravis_cameras() : std::vector<AravisListing>()),
               .takes_folder = options.takes,
               .spill_folder = options.spill,
               .is_quick = options.quick,
               .open_board = [&] { return open_board(options.links, *stage); },
               .progress = show_progress};
    const Findings findings = check_all(up);
    if (options.json)
        print_json(doctor_json(findings));
    else
        fmt::print(
            "{}{}", doctor_table(findings, is_coloured()),
            options.links.stage_path.empty() ? "what belongs to your stage is checked with --stage stage.toml\n" : "");
    return exit_code_of(findings);
}

}  // namespace

void add_doctor_verb(CLI::App& app, int& exit_code) {
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand("doctor", "check this machine for a shoot, and say what to type");
    verb->footer(
        "Example: stagectl doctor --stage stage.toml --sequence examples/sequence_s159.toml --takes /srv/takes\n"
        "Changes nothing on the machine; cameras are opened and set up, disks are measured for some seconds with a "
        "file "
        "that is gone afterwards. Not while a take is recorded. Rights are judged for who runs it: for the daemon\n"
        "`sudo -u stagectl stagectl doctor --stage /etc/stagectl/stage.toml`, while that does not run.\n"
        "Exit codes: 0 all is well; 2 warnings; 1 failures, or an error, named. What each check means: "
        "docs/checking_the_machine.md");
    options->links.add_to(*verb, true);
    options->sequence.add_to(*verb, "--sequence");
    verb->add_option("--takes", options->takes, "the folder of takes: its disk's room and speed");
    verb->add_option("--spill", options->spill, "the folder that frames are spilled to when memory is full");
    verb->add_option("--seconds", options->take_s, "how long a take is to be")
        ->check(CLI::Range(0.1, 86'400.0))
        ->capture_default_str();
    verb->add_option("--fps", options->target_rate_hz, "targets a second, as of run --fps; otherwise one a cycle")
        ->check(CLI::Range(0.1, 1000.0));
    verb->add_flag("--quick", options->quick, "measure no disk");
    verb->add_flag("--list", options->list, "list the checks there are, and make none");
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, &exit_code] { exit_code = report_errors([&] { return run(*options); }); });
}

}  // namespace ols
