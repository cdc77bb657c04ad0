// SPDX-License-Identifier: MIT
// A take of a synthetic stage, to be spoiled and played to an Identifier. The truth, which trigger a frame's light came from, is kept
// beside the frames where the code under test cannot see it.
#pragma once

#include <cmath>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "record/identify.hpp"
#include "summarize_frame.hpp"

namespace ols::test {

constexpr int width = 32, height = 24;
constexpr double black = 64;
constexpr uint64_t clock_offset_ns = 77'000'000'000;
constexpr double clock_drift = 23e-6;

// A subject of 156 lamps: each lights a spot, every fourth stands behind it and lights nothing.
class SyntheticStage {
  public:
    SyntheticStage(const std::string& basis, int cycles) {
        SequenceConfig config;
        config.basis = basis;
        config.cycles = cycles;
        config.basis_exposure_us = basis == "single" ? 412 : 100;
        sequence = *compile_sequence(config, default_stage());
    }

    // The image of one slot, with fresh noise of the paper's camera.
    Frame expose(const Slot& slot) {
        std::vector<double> light(width * height, 0);
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp) {
            if (!slot.lit[lamp]) continue;
            const bool matte = lamp >= 156;
            if (!matte && lamp % 4 == 3) continue;
            const double x = matte ? 2 + 5.0 * double(lamp - 156) : double(lamp * 7 % width);
            const double y = matte ? 1 : double(lamp * 5 % height);
            for (int p = 0; p < width * height; ++p) {
                const double dx = p % width - x, dy = p / width - y;
                light[size_t(p)] += (matte ? 0.5 : 0.4) * std::exp(-(dx * dx + dy * dy) / 40);
            }
        }
        Frame frame;
        frame.width = width;
        frame.height = height;
        frame.pitch_bytes = width * 2;
        frame.samples.resize(width * height * 2);
        auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
        for (int p = 0; p < width * height; ++p) {
            const double mu = light[size_t(p)] * slot.exposure_ticks / 125.0;
            const double counts = black + mu + (2.68 + 0.492 * std::sqrt(mu)) * gauss_(random_);
            samples[p] = uint16_t(std::clamp(std::lround(counts), 0L, 4095L));
        }
        return frame;
    }

    Sequence sequence;

  private:
    std::mt19937 random_{1};
    std::normal_distribution<double> gauss_;
};

struct Delivery {
    FrameWitness witness;
    uint64_t lit_by;  // the trigger whose light is in the pixels
};

// A take as it would go without faults, to be spoiled by a test and then played to an Identifier.
struct Take {
    std::vector<Delivery> frames;  // frames[n] is trigger n's, in order of delivery
    std::vector<ols_trigger_log_entry> log;
    Reason log_end;     // why the log stopped early
    Reason frames_end;  // why frames did
    size_t triggers = 0;
};

inline Take record(SyntheticStage& stage) {
    Take take;
    const Sequence& sequence = stage.sequence;
    take.triggers = sequence.trigger_count();
    for (uint32_t n = 0; n < take.triggers; ++n) {
        const size_t slot = n % sequence.slots.size();
        const uint64_t rise_ticks = 1000 + uint64_t(n) * sequence.slots[0].period_ticks;
        take.log.push_back({rise_ticks & ~1ull, n, uint32_t(n / sequence.slots.size()), uint16_t(slot), 1, 0});
        FrameWitness witness;
        witness.stamp.frame_id = n + 1;
        witness.stamp.timestamp_ns = clock_offset_ns + uint64_t(double(rise_ticks) * 8 * (1 + clock_drift));
        witness.summary = summarize_frame(stage.expose(sequence.slots[slot]), black, NoiseModel{});
        take.frames.push_back({witness, n});
    }
    return take;
}

struct Outcome {
    std::set<uint64_t> missing;
    std::map<uint64_t, MissingSlot> notes;
    int mislabelled = 0, duplicates = 0;
    CauseCounts discarded;
    bool accounted = true;  // one verdict for each frame and each trigger
};

// Plays a take: the log is asked for every `poll` frames, `lag` triggers behind the camera.
inline Outcome play(const Take& take, const Sequence& sequence, size_t poll = 13, size_t lag = 0,
                    const IdentifyOptions& options = {}, bool board_is_ahead = false, uint64_t host_drops = 0) {
    Identifier identifier(sequence, options);
    Outcome outcome;
    std::set<uint64_t> frames_seen, triggers_seen;
    const auto collect = [&] {
        for (const Verdict& verdict : identifier.take_verdicts()) {
            if (verdict.kind != Verdict::missing) outcome.accounted &= frames_seen.insert(verdict.arrival).second;
            if (verdict.kind == Verdict::identified) {
                outcome.accounted &= triggers_seen.insert(verdict.entry.counter).second;
                outcome.mislabelled += take.frames[verdict.arrival].lit_by != verdict.entry.counter;
            } else if (verdict.kind == Verdict::missing) {
                outcome.accounted &= triggers_seen.insert(verdict.slot.counter).second;
                outcome.missing.insert(verdict.slot.counter);
                outcome.notes[verdict.slot.counter] = verdict.slot;
            } else {
                outcome.discarded.add(verdict.why.cause);
                outcome.duplicates += verdict.why.text.starts_with("duplicate");
            }
        }
    };
    size_t told = 0;
    uint64_t fired = 0;
    const auto tell_log = [&](uint64_t until, uint64_t arrivals) {
        std::vector<ols_trigger_log_entry> entries;
        for (; told < take.log.size() && take.log[told].counter < until; ++told) entries.push_back(take.log[told]);
        identifier.add_log(entries, std::max(until, fired), arrivals);
    };
    if (board_is_ahead) fired = take.triggers;
    for (size_t arrival = 0; arrival < take.frames.size(); ++arrival) {
        FrameWitness witness = take.frames[arrival].witness;
        witness.arrival = arrival;
        fired = std::max(fired, take.frames[arrival].lit_by + 1);
        identifier.add_frame(witness);
        if (arrival % poll == poll - 1) tell_log(fired > lag ? fired - lag : 0, arrival + 1);
        collect();
    }
    tell_log(take.triggers, take.frames.size());
    identifier.end_log(take.log_end);
    identifier.end_frames(take.frames_end, 0, host_drops);
    collect();
    outcome.accounted &= frames_seen.size() == take.frames.size() && triggers_seen.size() == take.triggers;
    return outcome;
}

// The counter of the k-th slot of a kind in a cycle.
inline uint64_t find_slot(const Sequence& sequence, SlotKind kind, int cycle, int k) {
    for (uint64_t s = 0; s < sequence.slots.size(); ++s)
        if (sequence.slots[s].kind == kind && k-- == 0) return uint64_t(cycle) * sequence.slots.size() + s;
    return UINT64_MAX;
}

}  // namespace ols::test
