// SPDX-License-Identifier: MIT
// Witness: how surely a target's own samples tell of a slot that is not what it should be.
// links: ols_bench ols_bench_motion
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <numeric>
#include <random>

#include "align_takes.hpp"
#include "bench.hpp"

using namespace ols;

namespace {

enum class Kind { none, swapped_neighbours, swapped_far, copied, lamp_out, lamp_on };

struct Case {
    Kind kind;
    double share;  // of the frame's height, from a random line on
    std::string name;
};

struct Score {
    int trials = 0, found = 0, named = 0, sure = 0, wrong = 0;
};

uint16_t* line_of(Frame& frame, uint32_t y) {
    return reinterpret_cast<uint16_t*>(frame.samples.data() + size_t(y) * frame.pitch_bytes);
}

// A subject, and its target with faults.
class Trials {
  public:
    // Errors end the program: a benchmark without its scene has nothing to say.
    Trials(const RecordingPlan& plan, const std::string& folder, std::string quality)
        : quality_(*motion_quality(quality)) {
        auto recording = record(plan, folder);
        auto lamps = recording ? true_lamps(*recording, plan, folder) : recording.error();
        if (!lamps) {
            fmt::print(stderr, "bench_witness: {}\n", lamps.error().message);
            std::exit(1);
        }
        recording_ = std::make_unique<Recording>(std::move(*recording));
        lamps_ = std::move(*lamps);
        seen_ = seen_of(lamps_);
        if (quality_.compensates) path_ = *developer(0).find_path(recording_->targets[0]);
    }

    MotionDeveloper developer(int step) const {
        DevelopOptions options{Estimate::clipped, recording_->stage.lamps, 1, step};
        return developer_of(*recording_, quality_, options);
    }

    // With one developer a step, as in a take.
    void develop(int step) {
        auto& made = developers_[step];
        if (!made) made.reset(new MotionDeveloper(developer(step)));
        (void)made->develop(recording_->targets[0]);
    }

    Score run(const Case& one, int step, int trials) const {
        Score score;
        for (int trial = 0; trial < trials; ++trial) {
            std::mt19937 random(uint32_t(trial + 1));
            const Fault fault = strike(one, random);
            const nlohmann::json json = account(fault.frames, step);
            ++score.trials;
            if (!json.contains("suspect")) continue;
            ++score.found;
            const auto& slots = json["suspect"]["slots"];
            const bool is_lamp = one.kind == Kind::lamp_out || one.kind == Kind::lamp_on;
            const bool right_lamp =
                !is_lamp || json["suspect"].value("lamp", "") == recording_->stage.lamps[size_t(fault.lamp)].name;
            const bool is_among = std::ranges::any_of(slots, [&](const auto& own) {
                return std::ranges::all_of(own.template get<std::vector<int>>(), [&](int slot) {
                    return std::ranges::find(fault.slots, slot) != fault.slots.end();
                });
            });
            score.named += is_among && right_lamp;
            score.sure += is_among && right_lamp && slots.size() == 1;
            score.wrong += !is_among && slots.size() == 1;
        }
        return score;
    }

  private:
    struct Fault {
        TargetFrames frames;
        std::vector<int> slots;
        int lamp = -1;
    };

    nlohmann::json account(const TargetFrames& frames, int step) const {
        auto target = developer(step).develop(frames, quality_.compensates ? &path_ : nullptr);
        if (!target) {
            fmt::print(stderr, "bench_witness: {}\n", target.error().message);
            std::exit(1);
        }
        return target->provenance.contains("witness_account") ? target->provenance["witness_account"]
                                                              : nlohmann::json();
    }

    Fault strike(const Case& one, std::mt19937& random) const {
        Fault fault{recording_->targets[0], {}, -1};
        if (one.kind == Kind::none) return fault;
        auto& frames = fault.frames.frames;
        // A row that lights every lamp has none to light in addition: another slot is struck.
        size_t first = 0;
        std::vector<int> lamps;
        while (lamps.empty()) {
            first = random() % (frames.size() - 1);
            lamps = lamps_that(one.kind != Kind::lamp_on, frames[first]->slot);
        }
        fault.lamp = lamps[random() % lamps.size()];
        size_t second = first + 1;
        if (one.kind == Kind::swapped_far)
            second = (first + frames.size() / 4 + random() % (frames.size() / 2)) % frames.size();
        auto a = std::make_shared<Frame>(*frames[first]), b = std::make_shared<Frame>(*frames[second]);
        const auto lines = uint32_t(one.share * a->height), from = uint32_t(random() % (a->height - lines + 1));
        const double exposure_us = double(a->exposure_ticks) / double(ticks_per_us);
        std::normal_distribution<double> normal;
        for (uint32_t y = from; y < from + lines; ++y) {
            uint16_t *own = line_of(*a, y), *other = line_of(*b, y);
            for (uint32_t x = 0; x < a->width; ++x) {
                const size_t p = size_t(y) * a->width + x;
                const double light = lamps_[size_t(fault.lamp)][p] * recording_->calibration.flat.data[p] * exposure_us;
                switch (one.kind) {
                    case Kind::swapped_neighbours:
                    case Kind::swapped_far: std::swap(own[x], other[x]); break;
                    // A fresh exposure: the same light, and noise of its own beside the other's.
                    case Kind::copied: {
                        const auto [read, shot] = recording_->camera().noise;
                        const double mean = std::max(0.0, other[x] - double(a->black));
                        own[x] = counted(other[x] + (read + shot * std::sqrt(mean)) * normal(random), *a);
                        break;
                    }
                    case Kind::lamp_out: own[x] = counted(own[x] - light, *a); break;
                    case Kind::lamp_on: own[x] = counted(own[x] + light, *a); break;
                    case Kind::none: break;
                }
            }
        }
        fault.slots = {int(a->slot)};
        frames[first] = a;
        if (one.kind == Kind::swapped_neighbours || one.kind == Kind::swapped_far) {
            fault.slots.push_back(int(b->slot));
            frames[second] = b;
        }
        return fault;
    }

    static uint16_t counted(double value, const Frame& frame) {
        return uint16_t(std::lround(std::clamp(value, 0.0, double(frame.white))));
    }

    // The lamps that a slot lights, or leaves dark, among those that the subject shows.
    std::vector<int> lamps_that(bool are_lit, size_t slot) const {
        const Basis& basis = recording_->sequence.basis;
        std::vector<int> lamps;
        for (const int lamp : seen_)
            if (basis.lit(recording_->sequence.slots[slot].row, lamp) == are_lit) lamps.push_back(lamp);
        return lamps;
    }

    // The lamps that the subject shows at least half as bright as the mean.
    static std::vector<int> seen_of(const std::vector<std::vector<float>>& lamps) {
        std::vector<double> sums;
        for (const auto& lamp : lamps) sums.push_back(std::accumulate(lamp.begin(), lamp.end(), 0.0));
        const double mean = std::accumulate(sums.begin(), sums.end(), 0.0) / double(sums.size());
        std::vector<int> seen;
        for (size_t lamp = 0; lamp < sums.size(); ++lamp)
            if (sums[lamp] >= 0.5 * mean) seen.push_back(int(lamp));
        return seen;
    }

    std::unique_ptr<Recording> recording_;
    std::vector<std::vector<float>> lamps_;
    std::vector<int> seen_;
    const MotionQuality quality_;
    MotionPath path_;
    std::map<int, std::unique_ptr<MotionDeveloper>> developers_;
};

std::vector<Case> cases() {
    std::vector<Case> all = {{Kind::none, 1, "no fault"}};
    for (const auto& [kind, name] :
         std::vector<std::pair<Kind, std::string>>{{Kind::swapped_neighbours, "swapped with the next"},
                                                   {Kind::swapped_far, "swapped, far apart"},
                                                   {Kind::copied, "another's picture"}})
        for (const double share : {1.0, 0.5, 0.25})
            all.push_back({kind, share, fmt::format("{}, {:.0f} %", name, 100 * share)});
    all.push_back({Kind::lamp_out, 1, "a lamp out"});
    all.push_back({Kind::lamp_on, 1, "a lamp on"});
    return all;
}

}  // namespace

int main(int argc, char** argv) {
    Bench bench(
        argc, argv,
        {.name = "witness",
         .truth = "The head of motion_still, motion_talk and motion_turn60 (docs/motion_scenes.md) under s159 "
                  "through a 12-bit "
                  "mosaic of 320 x 240 with the camera's noise, one target; the first stands still (inverted "
                  "as it is), the others "
                  "are aligned by `preview`. Faults are made in the frames of random slots before anything is "
                  "aligned: whole "
                  "frames and torn ones, of which so much of the height differs. Times are of the still target "
                  "at 640 x 480, inversion and all, which has four times as many samples at a step.",
         .advice =
             "The default finds whole pictures that changed places in five of six takes of a subject at rest or "
             "more, and costs a quarter to a half of its inversion on one core (30 to 55 ms); a subject that turns "
             "hides most swaps of slots far apart. A lamp that misses one slot needs all samples, and is less than "
             "noise in every image."});
    const std::string folder = bench.full() ? "out/bench/motion" : "";
    const int width = bench.full() ? 320 : 48, height = bench.full() ? 240 : 32, count = bench.full() ? 12 : 1;
    const std::vector<std::string> subjects = {"still", "talk", "turn60"};
    std::map<std::string, std::unique_ptr<Trials>> trials;
    const auto of = [&](const std::string& scene, int scale = 1) -> Trials& {
        auto& made = trials[fmt::format("{} {}", scene, scale)];
        if (!made) {
            const bool is_frozen = scene == "still";
            const std::string file = fmt::format("tools/stagesim/scenes/motion_{}.toml", bench.full() ? scene : "hair");
            made = std::make_unique<Trials>(RecordingPlan{file, "s159", scale * width, scale * height, 2, 1, is_frozen},
                                            folder, is_frozen ? "none" : "preview");
        }
        return *made;
    };
    const std::vector<int> steps = {11, 5, 3, 1};
    const auto setting_name = [](int step) { return fmt::format("step {}", step); };

    std::vector<Setting> timed = {{"none", [&] { of("still", 2).develop(0); }, [] { return 0.0; }}};
    for (const int step : steps)
        timed.push_back({setting_name(step), [&, step] { of("still", 2).develop(step); }, [] { return 0.0; }});
    bench.measure({.name = "witness step",
                   .set_by = "`stagectl run --witness-step`",
                   .error_unit = "",
                   .peer = "none",
                   .default_setting = "step 5",
                   .why_off_front =
                       "witnesses change no sample of a target that is not suspect: what they are for is in the tables",
                   .settings = timed});

    std::map<std::string, Score> scores;
    const auto score_of = [&](const std::string& scene, const Case& one, int step) -> const Score& {
        Score& score = scores[fmt::format("{} {} {}", scene, one.name, step)];
        if (score.trials == 0)
            score = of(scene).run(one, step, one.kind == Kind::none ? 1 : count);  // it is the same each time
        return score;
    };
    // What is left to be wished, so that less is better; of a target without a fault a finding is one.
    const auto lacking = [](int score, const Score& of, const Case& one) {
        return 100.0 * (one.kind == Kind::none ? of.found : of.trials - score) / of.trials;
    };
    struct Table {
        std::string title, note, unit;
        std::function<double(const Score&, const Case&)> share;
    };
    const std::vector<Table> tables = {
        {"missed, % of targets",
         "**How often a fault is not noticed.** Of `no fault`: how often there seems to be one, of one target a scene; "
         "false alarms by noise are in tests/unit/test_parity_witness.cpp.",
         "%", [&](const Score& score, const Case& one) { return lacking(score.found, score, one); }},
        {"not rightly named, % of targets",
         "**How often the slot, the pair or the lamp is not named**, alone or among others that fit as well.",
         "% not named", [&](const Score& score, const Case& one) { return lacking(score.named, score, one); }},
        {"not named alone, % of targets",
         "**How often it is not the only one**: only then its slots are taken as missing.", "% not alone",
         [&](const Score& score, const Case& one) { return lacking(score.sure, score, one); }},
        {"wrongly named alone, % of targets", "**How often another slot is the only one that is named.**", "% wrong",
         [](const Score& score, const Case&) { return 100.0 * score.wrong / score.trials; }}};
    for (const Table& table : tables)
        for (const std::string& scene : subjects)
            for (const Case& one : cases()) {
                std::vector<Setting> settings;
                for (const int step : steps)
                    settings.push_back({setting_name(step), [&, step] { (void)score_of(scene, one, step); },
                                        [&, step] { return table.share(score_of(scene, one, step), one); }});
                bench.measure({.name = fmt::format("{}, {}{}", scene, one.name,
                                                   table.unit == "%" ? "" : ", " + table.unit.substr(2)),
                               .set_by = "`stagectl run --witness-step`",
                               .error_unit = table.unit,
                               .peer = "step 5",
                               .default_setting = "step 5",
                               .settings = settings,
                               .table = table.title,
                               .table_note = table.note,
                               .most_rounds = 1});
            }
    return bench.finish();
}
