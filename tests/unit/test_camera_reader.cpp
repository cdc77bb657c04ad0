// SPDX-License-Identifier: MIT
// What a reader holds, and whom it blames for what it could not: a camera under the test's control, and a sink that lets nothing go.
// links: ols_record
#include "record/camera_reader.hpp"

#include <gtest/gtest.h>

#include "device/fake_camera.hpp"

using namespace ols;

namespace {

constexpr size_t room = 4, frames_max = 3;

// A camera that tells how many it dropped only with the frame behind them, as GigE Vision's and V4L2's drivers do.
class LateTelling : public FakeCamera {
  public:
    using FakeCamera::FakeCamera;
    std::optional<Frame> read(int timeout_ms) override {
        auto frame = FakeCamera::read(timeout_ms);
        if (!frame) return frame;
        if (frame->stamp.frame_id > last_id_ + 1) told_ += frame->stamp.frame_id - last_id_ - 1;
        last_id_ = frame->stamp.frame_id;
        return frame;
    }
    CameraCounts counts() const override {
        CameraCounts counts = FakeCamera::counts();
        counts.dropped = told_;
        return counts;
    }

  private:
    uint64_t last_id_ = 0;
    std::atomic<uint64_t> told_ = 0;
};

template <typename Device>
class ReadingFrom : public testing::Test {
  protected:
    void begin() {
        config_.width = 16, config_.height = 8;
        ASSERT_TRUE(camera_.set_up(config_).ok());
        ASSERT_TRUE(camera_.start().ok());
        FrameRoom::Options options;
        options.frames_max = frames_max, options.frame_bytes = 16 * 8 * 2;
        const auto frames = *FrameRoom::create(options);
        monitor_.add_camera(0, frames);
        const auto waits_for_disk = [this] { return ++looks_, disk_is_late_.load(); };
        reader_.emplace(camera_, config_, CameraReaderOptions{std::nullopt, frames, waits_for_disk}, queue_, monitor_,
                        0);
    }
    // The next frame; pauses before it are left out.
    FrameNews next_frame() { return next<FrameNews>(); }
    template <typename News>
    News next() {
        for (;;) {
            RecordEvent event = *queue_.pop();
            if (auto* news = std::get_if<News>(&event)) return std::move(*news);
        }
    }
    void expose(int count) {
        for (int n = 0; n < count; ++n) camera_.trigger();
    }
    // Until the reader, which looks while it has no room, has told of so many.
    void wait_for_drops(uint64_t count) const {
        for (uint64_t drops = 0; drops < count; std::this_thread::yield()) {
            const CameraProgress camera = monitor_.progress().cameras[0];
            drops = camera.host_drops + camera.disk_drops;
        }
    }

    static FakeOptions options() {
        FakeOptions options;
        options.room = room;
        return options;
    }

    CameraConfig config_;
    Device camera_{options()};
    std::atomic<bool> disk_is_late_ = false;
    std::atomic<int> looks_ = 0;  // for whether it is
    RecordMonitor monitor_;
    RecordQueue queue_{SIZE_MAX};
    std::optional<CameraReader> reader_;
};

using Reading = ReadingFrom<FakeCamera>;

class ReadingLateTelling : public ReadingFrom<LateTelling> {
  protected:
    void drop_by_the_disk(bool waits);
};

}  // namespace

TEST_F(Reading, no_more_frames_are_held_than_may_be_and_what_is_dropped_meanwhile_is_ours) {
    begin();
    expose(frames_max);
    std::vector<FrameNews> held;
    for (size_t n = 0; n < frames_max; ++n) held.push_back(next_frame());
    EXPECT_EQ(held.back().witness.host_drops, 0u);
    expose(room + 5);  // nothing is read any more: the camera keeps four and drops five
    wait_for_drops(5);
    EXPECT_EQ(reader_->arrivals(), frames_max);
    CameraProgress live = monitor_.progress().cameras[0];
    EXPECT_EQ(live.frames_received, frames_max);
    EXPECT_EQ(live.room.frames_in_memory, frames_max);
    EXPECT_EQ(live.room.bytes_in_memory, frames_max * 16 * 8 * 2);
    EXPECT_EQ(live.host_drops, 5u);
    disk_is_late_ = true;
    expose(2);
    wait_for_drops(7);
    live = monitor_.progress().cameras[0];
    EXPECT_EQ(live.host_drops, 5u);
    EXPECT_EQ(live.disk_drops, 2u);
    held.clear();
    for (size_t n = 0; n < room; ++n) {
        const FrameNews news = next_frame();
        EXPECT_EQ(news.witness.stamp.frame_id, frames_max + n + 1);
        EXPECT_EQ(news.witness.host_drops, 5u);
        EXPECT_EQ(news.witness.disk_drops, 2u);
    }
    expose(1);
    const FrameNews after = next_frame();
    EXPECT_EQ(after.witness.stamp.frame_id, frames_max + room + 8);
    EXPECT_EQ(camera_.counts().missing_ids, 7u);
}

// The disk holds the room, the camera drops five, the disk goes on, and only then is there a frame that tells of them. `waits`: whether
// the reader found the camera empty before that frame.
void ReadingLateTelling::drop_by_the_disk(bool waits) {
    disk_is_late_ = true;
    begin();
    expose(frames_max);
    std::vector<FrameNews> held;
    for (size_t n = 0; n < frames_max; ++n) held.push_back(next_frame());
    expose(room + 5);
    while (looks_ == 0) std::this_thread::yield();
    disk_is_late_ = false;
    held.clear();
    for (size_t n = 0; n < room; ++n) EXPECT_EQ(next_frame().witness.disk_drops, 0u);
    if (waits) (void)next<CameraPause>();
    expose(1);
    const FrameNews after = next_frame();
    EXPECT_EQ(after.witness.disk_drops, 5u);
    EXPECT_EQ(after.witness.host_drops, 0u);
}

TEST_F(ReadingLateTelling, what_the_disk_held_up_is_the_disks_although_it_is_told_when_the_disk_has_long_gone_on) {
    drop_by_the_disk(false);
}

TEST_F(ReadingLateTelling, also_when_nothing_came_for_a_while_before_it_was_told) {
    drop_by_the_disk(true);
}

TEST_F(ReadingLateTelling, what_is_dropped_behind_the_frame_that_told_is_the_hosts_again) {
    drop_by_the_disk(true);
    std::vector<FrameNews> held;
    expose(frames_max);
    for (size_t n = 0; n < frames_max; ++n) held.push_back(next_frame());
    expose(room + 2);
    held.clear();
    for (size_t n = 0; n < room; ++n) (void)next_frame();
    expose(1);
    const FrameNews after = next_frame();
    EXPECT_EQ(after.witness.disk_drops, 5u);
    EXPECT_EQ(after.witness.host_drops, 2u);
}

// Neither a UVC camera nor most of GigE Vision tell where they saturate or where black is.
TEST_F(Reading, the_levels_of_a_camera_that_states_none_are_the_stages) {
    config_.black = 71, config_.white = 3900;
    begin();
    expose(1);
    const FrameNews news = next_frame();
    EXPECT_EQ(news.frame->black, 71.f);
    EXPECT_EQ(news.frame->white, 3900.f);
}

TEST_F(Reading, what_is_still_dropped_at_the_end_is_told_with_the_pause) {
    begin();
    expose(frames_max);
    std::vector<FrameNews> held;
    for (size_t n = 0; n < frames_max; ++n) held.push_back(next_frame());
    expose(room + 3);
    wait_for_drops(3);
    held.clear();
    for (size_t n = 0; n < room; ++n) next_frame();
    for (;;) {
        const RecordEvent event = *queue_.pop();
        if (const auto* pause = std::get_if<CameraPause>(&event)) {
            EXPECT_EQ(pause->host_drops, 3u);
            EXPECT_EQ(pause->disk_drops, 0u);
            break;
        }
    }
}
