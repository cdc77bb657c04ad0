// SPDX-License-Identifier: MIT
// Rendering by slot numbers, and a file of fixed-size records each for frames and lamps.
#include "motion_recording.hpp"

#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "develop/frame_store.hpp"
#include "image/whole_file.hpp"
#include "run/inputs.hpp"
#include "run/slot_frames.hpp"

namespace ols {

namespace {

constexpr int format_version = 2;  // of the files; another one when something that makes the frames changes

// FNV-1a of what decides the pictures: a changed scene is rendered anew.
uint64_t hash_of(const std::string& text) {
    uint64_t hash = 14695981039346656037u;
    for (const char c : text) hash = (hash ^ uint8_t(c)) * 1099511628211u;
    return hash;
}

std::string path_of(const RecordingPlan& plan, const std::string& folder, const std::string& what) {
    std::ifstream file(plan.scene);
    std::stringstream text;
    text << file.rdbuf() << format_version << ' ' << plan.cycle << ' ' << plan.targets;
    return fmt::format("{}/{}-{}-{}x{}-{:016x}", folder, std::filesystem::path(plan.scene).stem().string(), what,
                       plan.width, plan.height, hash_of(text.str()));
}

// Records of one size each; false where the file is not there or has another size.
template <typename Read>
bool read_records(const std::string& path, size_t count, size_t bytes, const Read& read) {
    std::error_code error;
    if (std::filesystem::file_size(path, error) != count * bytes || error) return false;
    std::ifstream file(path, std::ios::binary);
    for (size_t i = 0; i < count; ++i)
        if (!file.read(read(i), std::streamsize(bytes))) return false;
    return true;
}

template <typename Write>
Status write_records(const std::string& path, size_t count, size_t bytes, const Write& write) {
    std::error_code error;
    std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
    return write_whole_file(path, [&](const std::string& temporary) -> Status {
        std::ofstream file(temporary, std::ios::binary);
        for (size_t i = 0; i < count; ++i) file.write(write(i), std::streamsize(bytes));
        file.close();
        if (!file) return fail("cannot write '" + path + "': check the folder and the space left");
        return Done{};
    });
}

// The slot numbers that the targets need: a cycle on either side, or where nothing moves and nothing is aligned, the half that is
// nearest.
struct Range {
    uint64_t first_target, first, last;
    uint64_t half;  // a cycle
};

Range range_of(const RecordingPlan& plan, const Sequence& sequence) {
    const uint64_t length = sequence.slots.size();
    uint64_t middle = length / 2;
    while (sequence.slots[middle].kind != SlotKind::tracking) --middle;
    uint64_t half = length / 2;
    const uint64_t target = plan.cycle * length + middle;
    while (sequence.slots[(target + half) % length].kind != SlotKind::tracking) ++half;
    const uint64_t before = plan.is_frozen ? middle : length, after = plan.is_frozen ? length - middle : length;
    return {target, target - before, target + uint64_t(plan.targets - 1) * half + after, half};
}

bool is_needed(const Sequence& sequence, uint64_t number) {
    const SlotKind kind = sequence.slots[number % sequence.slots.size()].kind;
    return kind == SlotKind::basis || kind == SlotKind::tracking;
}

Setup setup_of(const Recording& recording) {
    return {recording.scene, recording.stage, recording.camera(), true};
}

double time_us(const Recording& recording, uint64_t number) {
    const uint64_t length = recording.sequence.slots.size();
    return slot_time_us(recording.sequence, recording.camera(), uint32_t(number / length), number % length);
}

// In the order of their numbers; a file holds their samples.
using Frames = std::vector<std::shared_ptr<const Frame>>;

Result<Frames> render(const Recording& recording, const std::vector<uint64_t>& numbers, std::optional<double> frozen_us,
                      const std::string& label) {
    const Setup setup = setup_of(recording);
    const uint64_t length = recording.sequence.slots.size();
    Renderer renderer(setup, {});
    Frames frames;
    for (const uint64_t number : numbers) {
        auto frame =
            render_slot(renderer, setup, recording.sequence, uint32_t(number / length), number % length, frozen_us);
        if (!frame) return frame.error();
        frames.push_back(std::move(*frame));
        show_progress(label.c_str(), double(frames.size()) / double(numbers.size()));
    }
    return frames;
}

// What a frame is beside its samples, from its place in the sequence alone.
Frame blank(const Recording& recording, uint64_t number) {
    const uint64_t length = recording.sequence.slots.size();
    const CameraConfig& camera = recording.camera();
    Frame frame;
    frame.width = uint32_t(camera.width), frame.height = uint32_t(camera.height);
    frame.cfa = camera.cfa;
    frame.pitch_bytes = uint32_t(camera.width) * sizeof(uint16_t);
    frame.black = float(camera.black), frame.white = float(camera.white);
    frame.identified = true;
    frame.cycle = uint32_t(number / length), frame.slot = uint32_t(number % length);
    frame.tick = number * recording.sequence.slots.front().period_ticks;
    frame.exposure_ticks = recording.sequence.slots[number % length].exposure_ticks;
    frame.samples.resize(size_t(frame.height) * frame.pitch_bytes);
    return frame;
}

Result<Frames> read_or_render(const Recording& recording, const RecordingPlan& plan,
                              const std::vector<uint64_t>& numbers, std::optional<double> frozen_us,
                              const std::string& folder) {
    const std::string what = plan.basis + (frozen_us ? "-frozen" : "");
    const std::string path = path_of(plan, folder, what) + ".u16";
    const size_t bytes = size_t(plan.width) * size_t(plan.height) * sizeof(uint16_t);
    std::vector<Frame> kept;
    for (const uint64_t number : numbers) kept.push_back(blank(recording, number));
    if (!folder.empty() &&
        read_records(path, kept.size(), bytes, [&](size_t i) { return (char*)kept[i].samples.data(); })) {
        Frames frames;
        for (Frame& frame : kept) frames.push_back(std::make_shared<const Frame>(std::move(frame)));
        return frames;
    }
    auto frames = render(recording, numbers, frozen_us, std::filesystem::path(plan.scene).stem().string() + " " + what);
    if (!frames || folder.empty()) return frames;
    const Status written =
        write_records(path, frames->size(), bytes, [&](size_t i) { return (const char*)(*frames)[i]->samples.data(); });
    if (!written) return written.error();
    return frames;
}

}  // namespace

double Recording::target_us(size_t target) const {
    return time_us(*this, targets[target].basis.target);
}

Result<Recording> record(const RecordingPlan& plan, const std::string& folder) {
    auto scene = read_scene(plan.scene);
    if (!scene) return scene.error();
    Recording recording{std::move(*scene), default_stage(), {}, {}, {}};
    recording.stage.cameras[0].width = plan.width, recording.stage.cameras[0].height = plan.height;
    SequenceConfig config;
    config.basis = plan.basis;
    config.cycles = int(plan.cycle) + plan.targets + 2;
    auto sequence = compile_sequence(config, recording.stage);
    if (!sequence) return sequence.error();
    recording.sequence = std::move(*sequence);
    recording.calibration = nominal_calibration(recording.stage).cameras[0];

    const Range range = range_of(plan, recording.sequence);
    std::vector<uint64_t> numbers;
    for (uint64_t number = range.first; number <= range.last; ++number)
        if (is_needed(recording.sequence, number)) numbers.push_back(number);
    std::optional<double> frozen_us;
    if (plan.is_frozen) frozen_us = time_us(recording, range.first_target);
    auto frames = read_or_render(recording, plan, numbers, frozen_us, folder);
    if (!frames) return frames.error();
    FrameStore store(recording.sequence);
    for (auto& frame : *frames) store.add(std::move(frame));
    for (int i = 0; i < plan.targets; ++i)
        recording.targets.push_back(store.around(uint32_t(i), range.first_target + uint64_t(i) * range.half));
    return recording;
}

MotionDeveloper developer_of(const Recording& recording, const MotionQuality& quality, DevelopOptions options) {
    const auto is_tracking = [](const Slot& slot) { return slot.kind == SlotKind::tracking; };
    const auto every = int(std::ranges::count_if(recording.sequence.slots, is_tracking)) / 2;
    return {recording.sequence, recording.calibration, recording.camera().noise, std::move(options), quality,
            std::max(every, 1)};
}

Result<std::vector<std::vector<float>>> true_lamps(const Recording& recording, const RecordingPlan& plan,
                                                   const std::string& folder) {
    const size_t pixels = size_t(plan.width) * size_t(plan.height), count = recording.stage.lamps.size();
    const std::string path = path_of(plan, folder, "lamps") + ".f32";
    std::vector<std::vector<float>> lamps(count, std::vector<float>(pixels));
    const auto read = [&](size_t i) { return (char*)lamps[i].data(); };
    if (!folder.empty() && read_records(path, count, pixels * sizeof(float), read)) return lamps;
    const auto counts = render_lamps(setup_of(recording), 1.0, recording.target_us(0));
    for (size_t lamp = 0; lamp < count; ++lamp)
        for (size_t p = 0; p < pixels; ++p) lamps[lamp][p] = counts[lamp].data[p] / recording.calibration.flat.data[p];
    if (folder.empty()) return lamps;
    const Status written =
        write_records(path, count, pixels * sizeof(float), [&](size_t i) { return (const char*)lamps[i].data(); });
    if (!written) return written.error();
    return lamps;
}

}  // namespace ols
