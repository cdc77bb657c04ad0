// SPDX-License-Identifier: MIT
// Options into parameters of calls.
#include "stagectl/daemon_options.hpp"

#include <fmt/format.h>

#include "develop/motion_quality.hpp"
#include "program.hpp"
#include "stagectl/session.hpp"

namespace ols {

void DaemonLink::add_to(CLI::App& verb) {
    verb.add_option("--socket", socket, "where the daemon listens; otherwise $STAGECTL_SOCKET")->capture_default_str();
}

void TakeParams::add_to(CLI::App& verb, bool with_slate) {
    verb.add_option("--seconds", seconds, "length of the take; otherwise as configured")->check(CLI::PositiveNumber);
    verb.add_option("--fps", fps, "a performance: targets a second; 0: one target a cycle; otherwise as configured")
        ->check(CLI::NonNegativeNumber);
    verb.add_option("--quality", quality, "motion compensation of a performance; otherwise as configured")
        ->check(CLI::IsMember(motion_quality_names()));
    verb.add_option("--also", also,
                    "a performance in another quality, too, as SLATE_NUMBER-QUALITY; may be given several times")
        ->check(CLI::IsMember(motion_quality_names()));
    verb.add_flag("--memory-only", memory_only, "spill no frames to a disk, whatever is configured");
    if (!with_slate) return;
    verb.add_option("--slate", slate, "the take is SLATE_NUMBER; otherwise as configured");
    verb.add_option("--take", number, "its number; otherwise one above the slate's highest")
        ->check(CLI::PositiveNumber);
    verb.add_option("--notes", notes, "kept with the take");
}

nlohmann::json TakeParams::to_json() const {
    auto params = nlohmann::json::object();
    if (seconds) params["seconds"] = *seconds;
    if (fps) params["fps"] = *fps;
    if (!quality.empty()) params["quality"] = quality;
    if (!also.empty()) params["also"] = also;
    if (memory_only) params["memory_only"] = true;
    if (!slate.empty()) params["slate"] = slate;
    if (number) params["number"] = *number;
    if (!notes.empty()) params["notes"] = notes;
    return params;
}

void add_call_verb(CLI::App& app, int& exit_code, const CallVerb& call) {
    struct Options {
        DaemonLink link;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* verb = app.add_subcommand(call.name, call.purpose);
    verb->footer(call.footer);
    options->link.add_to(*verb);
    verb->add_flag("--json", options->json, "print as JSON");
    verb->callback([options, call, &exit_code] {
        exit_code = report_errors([&] {
            return call_and_print(
                options->link, call.name, nlohmann::json::object(),
                [&](const nlohmann::json& result) { options->json ? print_json(result) : call.print(result); });
        });
    });
}

std::string event_line(const nlohmann::json& event) {
    const std::string time = event.value("time", "");
    return fmt::format("{} {} {} {}: {}", time.size() > 19 ? time.substr(11, 12) : time, event.value("level", ""),
                       event.value("code", 0), event.value("event", ""), event.value("text", ""));
}

std::string take_line(const nlohmann::json& progress) {
    uint64_t frames = 0, missing = 0;
    for (const auto& camera : progress["cameras"]) {
        frames += camera["frames_received"].get<uint64_t>();
        for (const auto& [cause, count] : camera["slots_missing"].items()) missing += count.get<uint64_t>();
    }
    return fmt::format("{}: {} of {} triggers, {} frames, {} slots missing{}", progress["take"].get<std::string>(),
                       progress["triggers_fired"].get<uint64_t>(), progress["triggers_planned"].get<uint64_t>(), frames,
                       missing, progress["dark"].get<bool>() ? ", dark" : "");
}

}  // namespace ols
