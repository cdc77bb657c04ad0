// SPDX-License-Identifier: MIT
// Reads a camera through its driver and says what came, a line of JSON each: for tests that look at a driver from outside.
//
// usage: read_camera STAGE.toml SOURCE FRAMES|@ID [SAVED [PAUSE]]
// Sets the camera up as the stage's first [[camera]] says, starts it, and ends after so many frames, or with that of the id. SAVED
// gets their samples. It waits for a line of standard input after PAUSE frames; of 0, before the set-up; "start" is before the start,
// "end" when no more frames are read.
#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "device/camera.hpp"
#include "stage/stage.hpp"

namespace ols {

namespace {

using Json = nlohmann::json;

void say(const Json& line) {
    std::cout << line.dump() << std::endl;
}

Json end_of(const Camera& camera) {
    const CameraCounts counts = camera.counts();
    const CameraState state = camera.state();
    const char* kinds[] = {"live", "ended", "gone"};
    return {{"missing_ids", counts.missing_ids}, {"dropped", counts.dropped},
            {"underrun", counts.underrun},       {"stale", counts.stale},
            {"state", kinds[state.kind]},        {"why", state.why}};
}

int refuse(const Error& error) {
    say({{"error", error.message}});
    return 1;
}

int read_camera(int argc, char** argv) {
    if (argc < 4) return refuse(fail("usage: read_camera STAGE.toml SOURCE FRAMES|@ID [SAVED [PAUSE]]"));
    const auto stage = read_stage(argv[1]);
    if (!stage.ok()) return refuse(stage.error());
    auto camera = open_camera(argv[2]);
    if (!camera.ok()) return refuse(camera.error());
    say({{"opened", (*camera)->info().name}});
    const std::string pause = argc > 5 ? argv[5] : "";
    const auto pause_at = [&](const std::string& point) {
        std::string line;
        if (pause == point) std::getline(std::cin, line);
    };
    pause_at("0");
    const CameraSetup& setup = stage->cameras.at(0);
    if (const Status fits = (*camera)->set_up(setup); !fits.ok()) return refuse(fits.error());
    pause_at("start");
    const auto started_ns = (*camera)->start();
    if (!started_ns.ok()) return refuse(started_ns.error());
    say({{"started_ns", *started_ns}, {"link", (*camera)->info().link}});
    std::ofstream saved(argc > 4 ? argv[4] : "/dev/null", std::ios::binary);
    const bool is_until_id = argv[3][0] == '@';
    const uint64_t wanted = std::strtoull(argv[3] + is_until_id, nullptr, 10);
    for (uint64_t n = 0, id = 0; (is_until_id ? id : n) < wanted && (*camera)->state().kind == CameraState::live;) {
        const auto frame = (*camera)->read(100);
        if (!frame) continue;
        saved.write(reinterpret_cast<const char*>(frame->samples.data()), std::streamsize(frame->samples.size()));
        const auto* const samples = reinterpret_cast<const uint16_t*>(frame->samples.data());
        say({{"id", frame->stamp.frame_id},
             {"time_ns", frame->stamp.timestamp_ns},
             {"first", samples[0]},
             {"last", samples[frame->samples.size() / 2 - 1]}});
        id = frame->stamp.frame_id;
        pause_at(std::to_string(++n));
    }
    pause_at("end");
    saved.flush();
    say(end_of(**camera));
    return saved.good() ? 0 : refuse(fail(fmt::format("cannot write '{}'", argv[4])));
}

}  // namespace

}  // namespace ols

int main(int argc, char** argv) {
    return ols::read_camera(argc, argv);
}
