// SPDX-License-Identifier: MIT
// Frames of slots rendered directly, against those of the virtual camera that hears the board.
// links: ols_stagesim
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "run/slot_frames.hpp"
#include "sim_scenes.hpp"
#include "started_camera.hpp"

using namespace ols;

namespace {

Slot slot_of(std::vector<uint8_t> lit, uint32_t exposure_ticks, int32_t offset_ticks = 0) {
    Slot slot;
    slot.kind = SlotKind::basis;
    slot.lit = std::move(lit);
    slot.exposure_ticks = exposure_ticks;
    slot.period_ticks = 57870;
    slot.trigger_offset_ticks = offset_ticks;
    return slot;
}

// A ball that moves fast before a stage of three lamps; the second slot triggers another camera.
class Slots : public testing::Test {
  protected:
    Slots() : stage_(small_stage({{0, 0, 1}, {0.8, 0, 0.6}, {-0.8, 0, 0.6}}, 32, 24)) {
        add_sphere(scene_, {}, 0.1, matte(0.7f));
        scene_.objects[0].motion = {{0, {-0.05, 0, 0}, {1, 0, 0, 0}}, {4000, {0.05, 0, 0}, {1, 0, 0, 0}}};
        sequence_.slots = {slot_of({1, 0, 0}, 50000), slot_of({0, 1, 0}, 50000), slot_of({0, 1, 1}, 20000, 500),
                           slot_of({0, 0, 0}, 30000)};
        sequence_.slots[1].trigger_mask = 2;
    }

    std::vector<std::shared_ptr<const Frame>> render(uint32_t cycle) {
        const ols::Setup setup{scene_, stage_, stage_.cameras[0], true};
        Renderer renderer(setup, {});
        return *render_slots(renderer, setup, sequence_, cycle);
    }

    // The board's messages of so many cycles, through VirtualCamera and its ring.
    std::vector<Frame> record(uint32_t cycles) {
        const ols::Setup setup{scene_, stage_, stage_.cameras[0], true};
        const auto folder = std::filesystem::temp_directory_path() / ("slots" + std::to_string(getpid()));
        std::filesystem::create_directories(folder);
        std::atomic<bool> cancelled = false;
        auto ring = RingWriter::create(folder / "cam0.ring", 32, ring_content(setup, {}));
        auto reader = RingReader::open(folder / "cam0.ring");
        VirtualCamera camera(setup, {}, 0, std::move(*ring), folder / "cam0.frames.jsonl", {}, true, cancelled);
        start_camera(*reader, camera);
        uint64_t light = 1'000'000;
        for (uint32_t c = 0; c < cycles; ++c)
            for (const Slot& slot : sequence_.slots) {
                const uint64_t rise = light + uint64_t(slot.trigger_offset_ticks);
                ExposureMessage message;
                message.rise = rise, message.fall = rise + slot.exposure_ticks;
                message.segments = {{light, light + slot.exposure_ticks, slot.lit}};
                if (slot.trigger_mask & 1) camera.expose(message);
                light += slot.period_ticks;
            }
        camera.finish();
        std::vector<Frame> frames;
        while (reader->writer() == RingReader::Writer::live)
            if (auto frame = reader->read(10)) frames.push_back(std::move(*frame));
        std::filesystem::remove_all(folder);
        return frames;
    }

    Scene scene_;
    StageConfig stage_;
    Sequence sequence_;
};

}  // namespace

TEST_F(Slots, are_to_the_bit_the_frames_that_the_virtual_camera_delivers) {
    const std::vector<Frame> recorded = record(2);
    ASSERT_EQ(recorded.size(), 6u);
    for (uint32_t cycle = 0; cycle < 2; ++cycle) {
        const auto frames = render(cycle);
        ASSERT_EQ(frames.size(), 4u);
        EXPECT_EQ(frames[1], nullptr);
        const size_t slots[] = {0, 2, 3};
        for (size_t i = 0; i < 3; ++i) {
            const Frame &made = *frames[slots[i]], &delivered = recorded[cycle * 3 + i];
            EXPECT_EQ(made.samples, delivered.samples) << "cycle " << cycle << " slot " << slots[i];
            EXPECT_EQ(made.stamp.frame_id, delivered.stamp.frame_id);
            EXPECT_EQ(made.black, delivered.black);
            EXPECT_EQ(made.slot, slots[i]);
        }
    }
}

TEST_F(Slots, lie_in_time_where_their_exposures_have_their_middle) {
    const CameraConfig& camera = stage_.cameras[0];
    EXPECT_DOUBLE_EQ(slot_time_us(sequence_, camera, 0, 0), 25000 * 0.008);
    EXPECT_DOUBLE_EQ(slot_time_us(sequence_, camera, 0, 2), (2 * 57870 + 500 + 10000) * 0.008);
    EXPECT_DOUBLE_EQ(slot_time_us(sequence_, camera, 3, 0), (12 * 57870 + 25000) * 0.008);
}

TEST_F(Slots, do_not_depend_on_threads_or_on_what_was_rendered_before) {
    const auto fresh = render(1);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const ols::Setup setup{scene_, stage_, stage_.cameras[0], true};
    Renderer renderer(setup, {});
    ASSERT_TRUE(render_slots(renderer, setup, sequence_, 7));
    const auto later = render_slots(renderer, setup, sequence_, 1);
    for (const size_t s : {0, 2, 3}) EXPECT_EQ(fresh[s]->samples, (*later)[s]->samples);
}

// The third slot lights lamps 1 and 2 for the 156 us that its light and its late trigger share.
TEST_F(Slots, without_noise_count_the_sum_of_their_lamps_frozen_at_their_time) {
    stage_.cameras[0].vignetting = 0.25;
    const ols::Setup setup{scene_, stage_, stage_.cameras[0], true};
    Renderer renderer(setup, {"noise"});
    const auto frames = render_slots(renderer, setup, sequence_, 1);
    const auto lamps = render_lamps(setup, 19500 * 0.008, slot_time_us(sequence_, setup.camera, 1, 2));
    const auto moved = render_lamps(setup, 19500 * 0.008, slot_time_us(sequence_, setup.camera, 0, 2));
    ASSERT_EQ(lamps.size(), 3u);
    const Frame& frame = *(*frames)[2];
    const auto* counts = reinterpret_cast<const uint16_t*>(frame.samples.data());
    int subject = 0, differing = 0;
    for (size_t i = 0; i < lamps[0].data.size(); ++i) {
        const float sum = lamps[1].data[i] + lamps[2].data[i];
        ASSERT_NEAR(counts[i] - frame.black, sum, 0.51) << i;
        subject += sum > 20;
        differing += std::abs(moved[1].data[i] + moved[2].data[i] - sum) > 2;
    }
    EXPECT_GT(subject, 30);
    EXPECT_GT(differing, 10);
}

TEST_F(Slots, of_grey_levels_are_an_error_that_names_the_slot) {
    sequence_.slots[2].planes = 8;
    const ols::Setup setup{scene_, stage_, stage_.cameras[0], true};
    Renderer renderer(setup, {});
    const auto frames = render_slots(renderer, setup, sequence_, 0);
    ASSERT_FALSE(frames);
    EXPECT_NE(frames.error().message.find("slot 2"), std::string::npos);
}
