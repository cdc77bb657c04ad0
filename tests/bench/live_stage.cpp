// SPDX-License-Identifier: MIT
// Pictures made once; heads and stamps that go on.
#include "live_stage.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <random>

#include "steady_clock.hpp"

namespace ols {

namespace {

constexpr int coarse = 8;  // light varies slowly: a value for so many pixels a side
constexpr uint64_t camera_begin_ns = 5'000'000'000;

[[noreturn]] void give_up(const std::string& why) {
    std::fprintf(stderr, "bench_live: %s\n", why.c_str());
    std::exit(1);
}

// Counts a microsecond that a lamp gives, at a place from 0 to 1 in x and y.
double light_of(size_t lamp, double x, double y) {
    if (lamp >= 156) return y < 0.2 ? 0.4 : 0;     // the matte board's edge
    const double angle = double(lamp) * 2.399963;  // the golden angle: as the lamps' sides are spread
    const double side = std::sin(angle) * (x - 0.5) + std::cos(angle) * (y - 0.5);
    return lamp % 5 == 4 ? 0.01 : 0.12 * std::max(0.0, 0.6 + 2 * side);
}

RingWriter make_ring(const std::string& path, const Sequence& sequence, const CameraConfig& camera) {
    RingContent content;
    content.width = uint32_t(camera.width), content.height = uint32_t(camera.height);
    content.cfa = camera.cfa;
    content.bits = uint32_t(camera.bits);
    auto writer = RingWriter::create(path, uint32_t(sequence.slots.size()), content);
    if (!writer.ok()) give_up(writer.error().message);
    return std::move(*writer);
}

}  // namespace

std::vector<Frame> expose_cycle(const Sequence& sequence, const CameraConfig& camera) {
    const int width = camera.width, height = camera.height;
    const int columns = (width + coarse - 1) / coarse, rows = (height + coarse - 1) / coarse;
    std::mt19937 random(1);
    std::normal_distribution<float> gauss;
    std::vector<float> noise(1 << 16);
    for (float& one : noise) one = gauss(random);
    std::vector<Frame> cycle;
    for (size_t s = 0; s < sequence.slots.size(); ++s) {
        const Slot& slot = sequence.slots[s];
        std::vector<float> light(size_t(columns) * size_t(rows));
        for (size_t lamp = 0; lamp < slot.lit.size(); ++lamp)
            for (int c = 0; slot.lit[lamp] && c < columns * rows; ++c)
                light[size_t(c)] += float(light_of(lamp, double(c % columns) / columns, double(c / columns) / rows) *
                                          slot.exposure_ticks / double(ticks_per_us));
        Frame& frame = cycle.emplace_back();
        frame.width = uint32_t(width), frame.height = uint32_t(height);
        frame.cfa = camera.cfa;
        frame.black = float(camera.black), frame.white = float(camera.white);
        frame.pitch_bytes = frame.width * 2;
        frame.samples.resize(size_t(frame.pitch_bytes) * frame.height);
        auto* samples = reinterpret_cast<uint16_t*>(frame.samples.data());
        const double sway = 3 * std::sin(2 * std::numbers::pi * double(s) / double(sequence.slots.size()));
        for (int y = 0; y < height; ++y) {
            size_t at = random();
            for (int x = 0; x < width; ++x) {
                const double texture = 0.7 + 0.2 * std::sin((x + sway) * 0.31) + 0.1 * std::sin(0.23 * y + 0.11 * x);
                const double mean = texture * light[size_t(y / coarse * columns + x / coarse)];
                const double sigma = camera.noise.read_counts + camera.noise.shot * std::sqrt(mean);
                const double counts = camera.black + mean + sigma * noise[at++ % noise.size()];
                *samples++ = uint16_t(std::clamp(counts + 0.5, 0.0, camera.white));
            }
        }
    }
    return cycle;
}

LiveStage::LiveStage(const Sequence& sequence, const StageConfig& stage, const std::vector<Frame>& cycle, Pace pace)
    : cycle_(cycle),
      triggers_(sequence.trigger_count()),
      period_ticks_(sequence.slots.front().period_ticks),
      pace_(pace),
      path_(fmt::format("/dev/shm/bench_live{}.ring", getpid())),
      writer_(make_ring(path_, sequence, stage.cameras[0])),
      played_([this] { return ticks(); }, uint32_t(period_ticks_)) {
    const int fd = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
    bytes_ = std::filesystem::file_size(path_);
    void* const memory = mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd, 0);
    ::close(fd);
    if (memory == MAP_FAILED) give_up("the ring cannot be mapped");
    memory_ = static_cast<std::byte*>(memory);
    const RingLayout layout = reinterpret_cast<const RingHeader*>(memory_)->layout;
    for (size_t n = 0; n < cycle.size(); ++n) {
        const Frame& frame = cycle[n];
        const RingFrame head{0, frame.width, frame.height, frame.format,         frame.cfa, frame.pitch_bytes, 0,
                             0, frame.black, frame.white,  frame.samples.size(), 0};
        std::byte* const record = memory_ + sizeof(RingHeader) + n * layout.stride;
        std::memcpy(record, &head, sizeof head);
        std::memcpy(record + sizeof head, frame.samples.data(), frame.samples.size());
    }
    auto board = Board::connect(played_.connect());
    if (!board.ok()) give_up(board.error().message);
    board_.emplace(std::move(*board));
    auto camera = open_camera("ring:" + path_);
    if (!camera.ok()) give_up(camera.error().message);
    camera_ = std::move(*camera);
    thread_ = std::thread([this] { feed(); });
}

LiveStage::~LiveStage() {
    end_ = true;
    thread_.join();
    camera_.reset();
    munmap(memory_, bytes_);
    std::filesystem::remove(path_);
}

uint64_t LiveStage::ticks() const {
    if (pace_ == Pace::stage) return steady_ns() / 8;
    return put_ == 0 ? 0 : test::PlayedBoard::first_rise_ticks + (put_ - 1) * period_ticks_ + period_ticks_ / 2;
}

void LiveStage::feed() {
    const RingHeader& header = *reinterpret_cast<const RingHeader*>(memory_);
    constexpr std::chrono::microseconds pause(200);
    while (!end_ && !played_.started_ticks()) {
        if (const auto start = writer_.start_asked()) writer_.confirm_start(*start, camera_begin_ns);
        std::this_thread::sleep_for(pause);
    }
    for (uint64_t n = 0; n < triggers_ && !end_;) {
        // A frame is there when its slot is over.
        const uint64_t due = pace_ == Pace::host ? triggers_ : std::max<uint64_t>(played_.triggers_fired(), 1) - 1;
        for (; n < due && (pace_ == Pace::stage || head_ - header.tail.load() < depth); ++n) put(n);
        writer_.set_watermark(camera_begin_ns + (test::PlayedBoard::first_rise_ticks + n * period_ticks_) * 8 - 1);
        if (pace_ == Pace::stage && played_.triggers_fired() == triggers_ && n + 1 == triggers_) put(n++);
        std::this_thread::sleep_for(pause);
    }
    ++put_;
    writer_.set_watermark(camera_begin_ns +
                          (test::PlayedBoard::first_rise_ticks + (triggers_ + 1) * period_ticks_) * 8);
}

void LiveStage::put(uint64_t trigger) {
    RingHeader& header = *reinterpret_cast<RingHeader*>(memory_);
    ++put_;
    if (head_ - header.tail.load(std::memory_order_acquire) >= depth) {
        header.dropped.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    const uint64_t place = head_ % header.layout.slots, cycle = trigger / header.layout.slots;
    std::byte* const record = memory_ + sizeof(RingHeader) + place * header.layout.stride;
    auto& frame = *reinterpret_cast<RingFrame*>(record);
    // Records go by the head: once frames were dropped, the next ones lie at others' places.
    if (head_ != trigger) {
        const SampleBuffer& picture = cycle_[trigger % header.layout.slots].samples;
        std::memcpy(record + sizeof frame, picture.data(), picture.size());
    }
    frame.frame_id = trigger + 1;
    frame.timestamp_ns = camera_begin_ns + (test::PlayedBoard::first_rise_ticks + trigger * period_ticks_) * 8;
    frame.dropped_before = header.dropped.load(std::memory_order_relaxed);
    // No exposure has the bits of another.
    reinterpret_cast<uint16_t*>(record + sizeof frame)[1000 + cycle % 1000] ^= 1;
    header.head.store(++head_, std::memory_order_release);
    writer_.set_watermark(camera_begin_ns + (test::PlayedBoard::first_rise_ticks + trigger * period_ticks_) * 8);
}

}  // namespace ols
