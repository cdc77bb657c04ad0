// SPDX-License-Identifier: MIT
// Live: how a take's processing keeps up with a stage that plays 12 cycles a second.
// links: ols_bench_live
#include <fmt/format.h>

#include <cmath>
#include <map>

#include "bench.hpp"
#include "device/row_copy.hpp"
#include "live_stage.hpp"
#include "record/frame_look.hpp"
#include "take/take.hpp"

using namespace ols;

namespace {

// Looks at every target and forgets it.
class LookedAt : public TargetSink {
  public:
    explicit LookedAt(uint64_t& lost) : lost_(lost) {}

    Status expect_targets(uint32_t, uint32_t) override { return Done{}; }
    Status take_place() override { return Done{}; }
    Status write_target(const Target& target) override {
        for (const Plane& lamp : target.lamps) lost_ += !std::isfinite(lamp[lamp.size() / 2]);
        return Done{};
    }
    Status note_missing_target(uint32_t, uint32_t, const std::string&, const nlohmann::json&) override {
        ++lost_;
        return Done{};
    }
    Status note_missing_targets(uint32_t, uint32_t first, uint32_t last, const std::string&) override {
        lost_ += last - first + 1;
        return Done{};
    }
    void add_to_manifest(const nlohmann::json&) override {}
    Status finish() override { return Done{}; }

  private:
    uint64_t& lost_;
};

struct Recording {
    StageConfig stage;
    Sequence sequence;
    std::vector<Frame> cycle;
};

class Live {
  public:
    explicit Live(bool is_full) : is_full_(is_full) {}

    // Made when it is first asked for.
    const Recording& recording(const std::string& basis, int cycles) {
        const auto [found, is_new] = recordings_.try_emplace({basis, cycles});
        Recording& made = found->second;
        if (!is_new) return made;
        made.stage = default_stage();
        CameraConfig& camera = made.stage.cameras[0];
        camera.width = is_full_ ? 640 : 64, camera.height = is_full_ ? 480 : 48;
        SequenceConfig config;
        config.basis = basis;
        config.cycles = cycles;
        config.basis_exposure_us = basis == "single" ? 412 : 80;
        made.sequence = *compile_sequence(config, made.stage);
        made.cycle = expose_cycle(made.sequence, camera);
        return made;
    }

    // A take at a pace; lost slots and targets go to `lost_`.
    void record(const Recording& recording, const TakeTargets& targets, Pace pace) {
        lost_ = 0;
        LiveStage stage(recording.sequence, recording.stage, recording.cycle, pace);
        const TakeDescription take{recording.sequence, recording.stage, nominal_calibration(recording.stage), {}};
        const TakeSinks sinks{
            {{std::make_shared<LookedAt>(lost_), targets}}, [](const Frame&) {}, [](uint64_t, uint64_t) {}};
        StopRequest stop;
        const auto report = run_take(take, {stage.board(), {&stage.camera()}}, sinks, stop);
        if (!report.ok()) {
            std::fprintf(stderr, "bench_live: %s\n", report.error().message.c_str());
            std::exit(1);
        }
        lost_ += report->record.missing().total();
        lost_ += uint64_t(report->outputs[0].suspicion.slots_left_out);
    }

    // What the recording itself takes.
    Setting stage_setting(const Recording& recording) {
        const double seconds = double(recording.sequence.trigger_count()) *
                               recording.sequence.slots.front().period_ticks / double(tick_hz);
        return {
            "the recording itself",
            [seconds, this] { std::this_thread::sleep_for(std::chrono::duration<double>(is_full_ ? seconds : 0.001)); },
            [] { return 0.0; }, 2};
    }
    Setting setting(const std::string& name, const std::string& basis, int cycles, const TakeTargets& targets,
                    Pace pace) {
        return {name, [=, this] { record(recording(basis, cycles), targets, pace); }, [this] { return double(lost_); },
                2};
    }
    bool is_full() const { return is_full_; }
    double lost() const { return double(lost_); }

  private:
    const bool is_full_;
    std::map<std::pair<std::string, int>, Recording> recordings_;
    uint64_t lost_ = 0;
};

constexpr const char* lost_unit = "slots and targets lost";

void measure_capacity(Bench& bench, Live& live) {
    const int cycles = live.is_full() ? 36 : 2;
    std::vector<Setting> settings;
    if (bench.measures()) (void)live.recording("s159", cycles), (void)live.recording("single", cycles);
    Setting stage{"the recording itself", {}, {}, 2};
    if (bench.measures()) stage = live.stage_setting(live.recording("s159", cycles));
    settings.push_back(stage);
    for (const char* basis : {"single", "s159"}) settings.push_back(live.setting(basis, basis, cycles, {}, Pace::host));
    bench.measure({.name = "a target a cycle",
                   .set_by = "`stagectl run --basis`",
                   .error_unit = lost_unit,
                   .peer = stage.name,
                   .default_setting = "s159",
                   .why_off_front = "the recording is what it is held against, and its basis is chosen for its noise.",
                   .settings = settings,
                   .most_rounds = 5});
}

void measure_pace(Bench& bench, Live& live) {
    const int cycles = live.is_full() ? 36 : 2;
    Setting stage{"the recording itself", {}, {}, 2};
    if (bench.measures()) stage = live.stage_setting(live.recording("s159", cycles));
    std::vector<Setting> settings{stage};
    for (const char* basis : {"single", "s159"})
        settings.push_back(live.setting(basis, basis, cycles, {}, Pace::stage));
    bench.measure({.name = "at 12 cycles a second",
                   .set_by = "`stagectl run --basis`",
                   .error_unit = lost_unit,
                   .peer = stage.name,
                   .default_setting = "s159",
                   .why_off_front = "the recording is what it is held against; longer by its memory, made before, and "
                                    "by how far it was behind.",
                   .settings = settings,
                   .most_rounds = 3});
}

void measure_motion(Bench& bench, Live& live) {
    const int cycles = live.is_full() ? 6 : 3;
    Setting stage{"the recording itself", {}, {}, 2};
    if (bench.measures()) stage = live.stage_setting(live.recording("s159", cycles));
    std::vector<Setting> settings{stage};
    for (const std::string& quality : motion_quality_names())
        settings.push_back(
            {quality,
             [=, &live] {
                 const Recording& recording = live.recording("s159", cycles);
                 const TakeTargets targets{*tracking_frames_a_target(recording.sequence, 24), *motion_quality(quality)};
                 live.record(recording, targets, Pace::host);
             },
             [&live] { return live.lost(); }, 2});
    bench.measure({.name = "24 targets a second",
                   .set_by = "`stagectl run --fps 24 --quality`",
                   .error_unit = lost_unit,
                   .peer = stage.name,
                   .default_setting = "standard",
                   .why_off_front = "what motion compensation is worth is the subject of align; here is what it takes.",
                   .settings = settings,
                   .most_rounds = 3});
}

// Of one frame, or of a target by its frames: on one thread, each by itself.
void measure_shares(Bench& bench, Live& live) {
    const Recording* recording = bench.measures() ? &live.recording("s159", live.is_full() ? 12 : 2) : nullptr;
    const auto each = [&](auto work) {
        return [recording, work] {
            for (const Frame& frame : recording->cycle) work(*recording, frame);
        };
    };
    const auto exact = [] { return 0.0; };
    static Frame copy;
    static double sink = 0;
    const auto develop = [recording](int witness_step) {
        const Sequence& sequence = recording->sequence;
        static std::map<const Recording*, CycleFrames> made;
        CycleFrames& frames = made[recording];
        if (frames.slots.empty())
            for (size_t s = 0; s < recording->cycle.size(); ++s) {
                auto frame = std::make_shared<Frame>(recording->cycle[s]);
                frame->identified = true, frame->slot = uint32_t(s);
                frame->exposure_ticks = sequence.slots[s].exposure_ticks;
                frames.slots.push_back(std::move(frame));
            }
        const Calibration calibration = nominal_calibration(recording->stage);
        Developer developer(sequence, calibration.cameras[0], recording->stage.cameras[0].noise,
                            {Estimate::none, recording->stage.lamps, 1, witness_step});
        sink += developer.develop(frames)->lamps[0][0];
    };
    bench.measure(
        {.name = "share of a cycle",
         .set_by = "nothing: it is the work for each of its frames, and for its target",
         .error_unit = "of none",
         .peer = "memory: the C library's copy",
         .default_setting = "receive: copy, block means and hash",
         .why_off_front = "a copy alone is what it is held against; it looks at every sample besides.",
         .settings = {{"memory: the C library's copy", each([](const Recording&, const Frame& frame) {
                           copy.samples.assign(frame.samples.begin(), frame.samples.end());
                       }),
                       exact},
                      {"receive: copy, block means and hash", each([](const Recording& recording, const Frame& frame) {
                           static RowCopy rows;
                           static FrameLook look;
                           copy.width = frame.width, copy.height = frame.height, copy.cfa = frame.cfa;
                           copy.pitch_bytes = frame.pitch_bytes;
                           rows.copy(frame.samples.data(), copy, &look);
                           sink += look.sums().summary(64, recording.stage.cameras[0].noise).blocks[0];
                           sink += double(look.hash());
                       }),
                       exact},
                      {"develop: load, invert, variance, output", [=] { develop(0); }, exact},
                      {"develop, and check by its witnesses", [=] { develop(5); }, exact}}});
}

}  // namespace

int main(int argc, char** argv) {
    require_freed_planes("bench_live");
    Bench bench(
        argc, argv,
        {.name = "live",
         .truth = "Every slot of a recording and every target of it, which are counted. A ring gives 640 x 480 "
                  "frames of 12 bits at 2160 a second, from records that are filled beforehand; the board is a model "
                  "of the protocol's other end. Frames are received, identified and checked, targets inverted and "
                  "looked at; no archive is written. Developing is on all processors.",
         .advice = "`speed` is the share of real time at which targets are developed. Below 1 developing is behind: "
                   "give `--memory-mb` or `--spill` room for the share of the recording that speed leaves over."});
    Live live(bench.full());
    measure_capacity(bench, live);
    measure_pace(bench, live);
    measure_motion(bench, live);
    measure_shares(bench, live);
    return bench.finish();
}
