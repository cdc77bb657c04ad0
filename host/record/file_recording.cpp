// SPDX-License-Identifier: MIT
// One thread places frames, others read ahead.
#include "record/file_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "exceptions.hpp"
#include "record/frame_bits.hpp"
#include "record/frame_look.hpp"
#include "record/read_ahead.hpp"
#include "record/recording_placer.hpp"
#include "worker_threads.hpp"

namespace ols {

namespace {

constexpr int threads_max = 4;  // more than a disk has use for

// A frame and what identification is told of it.
struct ReadFrame {
    std::shared_ptr<Frame> frame;  // none where it cannot be read
    FrameSummary summary;
    FrameBits bits;
    Reason why;  // it cannot be read
};

double period_ns(const Sequence& sequence) {
    return 1e9 * sequence.slots.front().period_ticks / double(tick_hz);
}

class FrameReader {
  public:
    FrameReader(const RecordedFrames& frames, const CameraConfig& camera, std::optional<double> black_counts,
                std::vector<CameraStamp> stamps)
        : frames_(frames),
          camera_(camera),
          black_counts_(black_counts),
          bits_(camera),
          stamps_(std::move(stamps)),
          ahead_(stamps_.size(), std::min(thread_count(0), threads_max),
                 [this](uint64_t index) { return read(index); }) {}

    const CameraStamp& stamp(uint64_t index) const { return stamps_[index]; }
    uint64_t count() const { return stamps_.size(); }
    ReadFrame next() { return ahead_.take(); }

  private:
    ReadFrame read(uint64_t index) const {
        ReadFrame read;
        const Status done = guarded("cannot read a frame", [&]() -> Status {
            auto frame = frames_.read(index);
            if (!frame.ok()) return frame.error();
            frame->stamp = stamps_[index];
            if (!frames_.facts().black) frame->black = float(camera_.black);
            if (!frames_.facts().white) frame->white = float(camera_.white);
            FrameLook look;
            look.complete(*frame);
            read.summary = look.sums().summary(black_counts_.value_or(frame->black), camera_.noise);
            read.bits = bits_.read(*frame, look.hash());
            read.frame = std::make_shared<Frame>(std::move(*frame));
            return Done{};
        });
        if (!done.ok()) read.why = {Cause::link_lost_it, done.error().message};
        return read;
    }

    const RecordedFrames& frames_;
    const CameraConfig& camera_;
    const std::optional<double> black_counts_;
    const BitsReader bits_;
    const std::vector<CameraStamp> stamps_;
    ReadAhead<ReadFrame> ahead_;
};

FrameWitness witness_of(const ReadFrame& read, const CameraStamp& stamp, uint64_t index) {
    FrameWitness witness;
    witness.arrival = index;
    witness.stamp = stamp;
    witness.unfit = read.why;
    witness.summary = read.summary;
    return witness;
}

Status check_times(const RecordingFacts& facts, const std::vector<CameraStamp>& stamps, const Sequence& sequence) {
    const uint64_t first = stamps.front().timestamp_ns, last = stamps.back().timestamp_ns;
    if (last < first) return fail("the frames' times fall from first to last: the file is damaged; copy it again");
    const uint64_t cycle = sequence.slots.size();
    const double triggers = double(last - first) / period_ns(sequence);
    if (triggers <= double(2 * stamps.size() + 10 * cycle)) return Done{};
    // Where to cut: behind the widest gap.
    size_t widest = 1;
    for (size_t i = 2; i < stamps.size(); ++i)
        if (int64_t(stamps[i].timestamp_ns - stamps[i - 1].timestamp_ns) >
            int64_t(stamps[widest].timestamp_ns - stamps[widest - 1].timestamp_ns))
            widest = i;
    return fail(fmt::format(
        "{} frames lie over {:.0f} triggers of the sequence, more than half of which are missing: is this the "
        "sequence, and its "
        "frame rate ({:.6g} Hz)? The widest gap is between frames {} and {}; take one recording at a time with --range",
        stamps.size(), triggers, 1e9 / period_ns(sequence), facts.numbers[widest - 1], facts.numbers[widest]));
}

// What the frames look like, for the error of a code that does not lock.
struct Look {
    uint64_t tried = 0, dark = 0, unread = 0;
    float brightest = -1e30f;

    void add(const ReadFrame& read) {
        ++tried;
        if (!read.frame) {
            ++unread;
            return;
        }
        dark += is_dark(read.summary);
        brightest = std::max(brightest, std::ranges::max(read.summary.blocks));
    }
};

Error no_place(const Look& look, const RecordingFacts& facts, const std::vector<CameraStamp>& stamps,
               const Sequence& sequence, const std::string& unread) {
    const size_t cycle = sequence.slots.size();
    std::string why = fmt::format(
        "the optical code does not say where in the cycle the recording is: {} frames were tried against all {} places "
        "of the "
        "sequence's cycle of {} slots at {:.6g} Hz, and ",
        look.tried, cycle, cycle, 1e9 / period_ns(sequence));
    if (look.unread == look.tried) return fail(why + "not one of them can be read: " + unread);
    if (look.tried < cycle)
        return fail(why + "a whole cycle is needed: record longer, or check that this is the recording's sequence");
    if (look.dark + look.unread == look.tried)
        return fail(
            why +
            fmt::format("all of them are dark (the brightest eighth is {:.1f} counts above black): check lens cap, "
                        "lamps and black level, or --full-scale of pictures that were scaled",
                        look.brightest));
    if (facts.has_times) {
        std::vector<uint64_t> apart;
        for (size_t i = 1; i < stamps.size(); ++i) apart.push_back(stamps[i].timestamp_ns - stamps[i - 1].timestamp_ns);
        std::ranges::nth_element(apart, apart.begin() + ptrdiff_t(apart.size() / 2));
        const double found = double(apart[apart.size() / 2]), ratio = found / period_ns(sequence);
        if (std::abs(ratio - 1) > TriggerGrid::tolerance_periods)
            return fail(
                why +
                fmt::format("the frames are {:.3f} us apart, the sequence's triggers {:.3f}: give the sequence that "
                            "was played; the camera must expose at the board's triggers",
                            found / 1e3, period_ns(sequence) / 1e3));
    }
    if (look.dark == 0)
        return fail(
            why +
            "not one is dark, as the sequence's dark slots are: check the black level (stage, or --calibration), "
            "other light, and that this is the sequence that was played");
    return fail(
        why +
        fmt::format("none fits ({} of them are dark): is this the sequence that was played? Frames from before or "
                    "after it are left out with --range",
                    look.dark));
}

}  // namespace

std::vector<CameraStamp> stamps_of(const RecordingFacts& facts, const Sequence& sequence) {
    std::vector<CameraStamp> stamps;
    const double period = period_ns(sequence);
    for (size_t i = 0; i < facts.numbers.size(); ++i) {
        const uint64_t id = uint64_t(facts.numbers[i]) - uint64_t(facts.numbers.front());
        stamps.push_back({id, facts.has_times ? facts.times_ns[i] : uint64_t(std::llround(double(id) * period))});
    }
    return stamps;
}

Result<RecordingPlace> find_place(const RecordedFrames& frames, const Sequence& sequence, const CameraConfig& camera,
                                  std::optional<double> black_counts, const std::atomic<bool>& stop) {
    const RecordingFacts& facts = frames.facts();
    const std::vector<CameraStamp> stamps = stamps_of(facts, sequence);
    if (const Status fits = check_times(facts, stamps, sequence); !fits.ok()) return fits.error();
    const uint64_t cycle = sequence.slots.size();
    FrameReader reader(frames, camera, black_counts, stamps);
    RecordingPlacer placer(sequence, facts.has_times);
    Look look;
    std::string unread;
    std::optional<Placement> first;
    const auto take = [&] {
        for (const Placement& placement : placer.take_placements())
            if (placement.accepted && !first) first = placement;
    };
    for (uint64_t i = 0; i < reader.count() && !first && !stop; ++i) {
        const ReadFrame read = reader.next();
        look.add(read);
        if (unread.empty()) unread = read.why.text;
        placer.add(witness_of(read, reader.stamp(i), i));
        take();
    }
    if (stop) return fail("stopped before the recording's place in the cycle was found");
    if (!first) placer.end(), take();
    if (!first) return no_place(look, facts, stamps, sequence, unread);

    // The grid from there to the last frame.
    uint64_t trigger = *first->counter;
    TriggerGrid grid(period_ns(sequence), stamps[*first->arrival].timestamp_ns, cycle);
    for (size_t i = *first->arrival + 1; i < stamps.size(); ++i)
        if (const auto steps = grid.steps_to(stamps[i].timestamp_ns)) {
            grid.advance(*steps, stamps[i].timestamp_ns);
            trigger += *steps;
        }
    RecordingPlace place;
    const double passed = double(stamps[*first->arrival].timestamp_ns - stamps.front().timestamp_ns);
    const uint64_t before = uint64_t(std::llround(passed / period_ns(sequence)));
    place.first_slot = (*first->counter % cycle + cycle - before % cycle) % cycle;
    place.first_trigger = (*first->counter + cycle - 1) / cycle * cycle;
    const uint64_t end = trigger + 1;
    if (end < place.first_trigger + cycle)
        return fail(
            fmt::format("the recording holds no whole cycle: its {} frames begin in slot {} of {}; record at least {}",
                        stamps.size(), place.first_slot, cycle, 2 * cycle));
    const uint64_t cycles = (end - place.first_trigger) / cycle;
    place.cycles = uint32_t(std::min<uint64_t>(cycles, 1'000'000));
    return place;
}

namespace {

// Placements into slots, group by group.
class FileRecording {
  public:
    FileRecording(const RecordingPlace& place, const Sequence& sequence, bool has_times, const RecordSink& sink)
        : sequence_(sequence),
          group_(uint64_t(sequence.config.group_slots)),
          begin_(place.first_trigger),
          end_(place.first_trigger + sequence.trigger_count()),
          has_times_(has_times),
          sink_(sink),
          placer_(sequence, has_times),
          decided_(begin_) {}

    void add(ReadFrame read, const CameraStamp& stamp, uint64_t index) {
        ++report_.frames;
        FrameWitness witness = witness_of(read, stamp, index);
        if (read.frame) look_at_bits(read.bits, witness);
        if (!read.why.empty()) {
            ++unread_;
            if (report_.end.empty()) report_.end = read.why;
        }
        frames_[index] = std::move(read.frame);
        placer_.add(std::move(witness));
        settle(placer_.lowest_open());
    }

    CameraReport finish(bool stopped) {
        placer_.end();
        stopped_ = stopped;
        settle(end_);
        if (unread_ > 1) report_.end.text += fmt::format(" ({} frames in all)", unread_);
        report_.restarts = placer_.restarts();
        report_.clock = clock_.relation();
        return report_;
    }

  private:
    struct Outcome {
        std::shared_ptr<Frame> frame;  // accepted
        Reason why;                    // it was not
        Sight optical = Sight::silent;
    };

    // As a live take does (recorder.cpp): of two frames with the same bits the later is the old buffer.
    void look_at_bits(const FrameBits& bits, FrameWitness& witness) {
        report_.frames_without_noise += !bits.tells;
        const auto first = bits_seen_.add(bits, {witness.arrival, witness.stamp});
        if (!first) return;
        ++report_.stale_buffers;
        witness.unfit = {Cause::stale, fmt::format("stale: it has, bit for bit, the samples of the frame {} before",
                                                   witness.arrival - first->arrival)};
    }

    void settle(uint64_t open) {
        for (Placement& placement : placer_.take_placements()) {
            auto frame = frames_.extract(*placement.arrival);
            if (!placement.accepted) ++report_.frames_discarded;
            if (!placement.counter || *placement.counter < begin_ || *placement.counter >= end_) continue;
            Outcome& outcome = outcomes_[*placement.counter];
            outcome = {placement.accepted ? std::move(frame.mapped()) : nullptr, std::move(placement.why),
                       placement.optical};
        }
        for (; decided_ < end_ && decided_ + group_ <= open; decided_ += group_) decide_group();
        sink_.progress(decided_ - begin_, end_ - begin_);
    }

    void decide_group() {
        std::optional<uint64_t> lost;
        for (uint64_t trigger = decided_; trigger < decided_ + group_ && !lost; ++trigger)
            if (!outcomes_.contains(trigger)) lost = trigger;
        for (uint64_t trigger = decided_; trigger < decided_ + group_; ++trigger) {
            auto node = outcomes_.extract(trigger);
            Outcome outcome = node ? std::move(node.mapped()) : Outcome{nullptr, why_lost(), Sight::silent};
            if (outcome.frame && lost) {
                outcome.frame.reset();
                ++report_.frames_discarded;
                outcome.why = {
                    Cause::not_proved,
                    fmt::format(
                        "the frame of trigger {}, of its group, was lost, and nothing but the camera's count says "
                        "that it is that one",
                        *lost - begin_)};
            }
            if (outcome.frame)
                hand_on(outcome.frame, trigger - begin_);
            else
                miss(outcome, trigger - begin_, bool(node));
        }
    }
    Reason why_lost() const {
        if (stopped_) return {Cause::stopped, "the ingest was stopped"};
        return {Cause::no_frame, "lost: no frame of the recording is of this trigger"};
    }
    void hand_on(const std::shared_ptr<Frame>& frame, uint64_t number) {
        frame->identified = true;
        frame->cycle = uint32_t(number / sequence_.slots.size());
        frame->slot = uint32_t(number % sequence_.slots.size());
        frame->tick = number * sequence_.slots.front().period_ticks;
        frame->exposure_ticks = sequence_.slots[frame->slot].exposure_ticks;
        if (has_times_) clock_.add(frame->tick, frame->stamp.timestamp_ns);
        sink_.frame(frame);
    }
    void miss(const Outcome& outcome, uint64_t number, bool had_frame) {
        report_.missing.add(outcome.why.cause);
        MissingSlot slot;
        slot.counter = number;
        slot.why = outcome.why;
        slot.camera = had_frame;
        slot.optical = outcome.optical;
        sink_.missing(slot);
    }

    const Sequence& sequence_;
    const uint64_t group_, begin_, end_;  // of triggers
    const bool has_times_;
    const RecordSink& sink_;
    RecordingPlacer placer_;
    std::unordered_map<uint64_t, std::shared_ptr<Frame>> frames_;  // by index, until they are placed
    std::map<uint64_t, Outcome> outcomes_;                         // by trigger, until their group is decided
    uint64_t decided_;
    BitsSeen bits_seen_;
    CameraReport report_;
    ClockFit clock_;
    uint64_t unread_ = 0;
    bool stopped_ = false;
};

}  // namespace

Result<RecordReport> record_files(const RecordedFrames& frames, const RecordingPlace& place, const Sequence& sequence,
                                  const CameraConfig& camera, std::optional<double> black_counts,
                                  const RecordSink& sink, const std::atomic<bool>& stop) {
    const RecordingFacts& facts = frames.facts();
    FrameReader reader(frames, camera, black_counts, stamps_of(facts, sequence));
    FileRecording recording(place, sequence, facts.has_times, sink);
    for (uint64_t i = 0; i < reader.count() && !stop; ++i) recording.add(reader.next(), reader.stamp(i), i);
    CameraReport report = recording.finish(stop);
    report.camera.name = facts.name;
    report.camera.link = facts.link;
    RecordReport record;
    record.slots_total = sequence.trigger_count();
    record.cameras.push_back(std::move(report));
    return record;
}

}  // namespace ols
