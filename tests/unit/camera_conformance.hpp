// SPDX-License-Identifier: MIT
// What every camera driver must do (host/device/camera.hpp), whatever is behind it. A driver's test gives a CameraRig, the
// device's end under the test's control, and instantiates the suite with it: see test_camera.cpp.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <thread>

#include "camera_rig.hpp"

namespace ols::test {

struct CameraKind {
    const char* name;
    std::function<std::unique_ptr<CameraRig>()> make;
};

class CameraConformance : public testing::TestWithParam<CameraKind> {
  protected:
    void SetUp() override {
        rig_ = GetParam().make();
        camera_ = rig_->open();
        ASSERT_NE(camera_, nullptr);
    }
    uint64_t start() {
        const Status fits = camera_->set_up(rig_->fitting_setup());
        EXPECT_TRUE(fits.ok()) << (fits.ok() ? "" : fits.error().message);
        const auto started_ns = camera_->start();
        EXPECT_TRUE(started_ns.ok()) << (started_ns.ok() ? "" : started_ns.error().message);
        return started_ns.ok() ? *started_ns : 0;
    }
    std::vector<Frame> read(size_t count) {
        std::vector<Frame> frames;
        while (frames.size() < count) {
            auto frame = camera_->read(surely_ms);
            if (!frame) break;
            frames.push_back(std::move(*frame));
        }
        EXPECT_EQ(frames.size(), count);
        return frames;
    }
    // By when the camera says so: a device's end and failure are seen some time after.
    CameraState state_after_all() {
        for (int waited_ms = 0; waited_ms < surely_ms; waited_ms += 10) {
            if (camera_->state().kind != CameraState::live) break;
            (void)camera_->read(10);
        }
        return camera_->state();
    }
    // The error of a set-up that differs from a fitting one; "" when it is taken.
    std::string refusal(const std::function<void(CameraSetup&)>& change) {
        CameraSetup setup = rig_->fitting_setup();
        change(setup);
        const Status taken = camera_->set_up(setup);
        return taken.ok() ? "" : taken.error().message;
    }

    std::unique_ptr<CameraRig> rig_;
    std::unique_ptr<Camera> camera_;
};

TEST_P(CameraConformance, says_what_it_is_and_how_it_is_set_up) {
    const CameraSetup wanted = rig_->fitting_setup();
    ASSERT_TRUE(camera_->set_up(wanted).ok());
    const CameraInfo info = camera_->info();
    EXPECT_NE(info.name, "");
    EXPECT_NE(info.link, "");
    EXPECT_GE(info.clock_step_ns, 1u);
    EXPECT_EQ(info.setup.width, wanted.width);
    EXPECT_EQ(info.setup.height, wanted.height);
    EXPECT_EQ(info.setup.bits, wanted.bits);
    EXPECT_EQ(info.setup.cfa, wanted.cfa);
}

TEST_P(CameraConformance, refuses_a_set_up_that_it_cannot_take_by_the_names_of_its_keys) {
    EXPECT_NE(refusal([](CameraSetup& setup) { setup.width = 16000; }).find("width"), std::string::npos);
    EXPECT_NE(refusal([](CameraSetup& setup) { setup.trigger_source = "no such line"; }).find("trigger_source"),
              std::string::npos);
    const std::string both = refusal([](CameraSetup& setup) { setup.height = 16001, setup.width = 16000; });
    EXPECT_NE(both.find("width"), std::string::npos) << both;
    EXPECT_NE(both.find("height"), std::string::npos) << both;
    EXPECT_EQ(refusal([](CameraSetup&) {}), "") << "and takes one that fits after that";
}

TEST_P(CameraConformance, delivers_whole_frames_in_order_with_ids_and_times_that_rise) {
    const uint64_t started_ns = start();
    rig_->expose(5);
    const CameraSetup setup = camera_->info().setup;
    CameraStamp last;
    for (const Frame& frame : read(5)) {
        EXPECT_EQ(frame.width, uint32_t(setup.width));
        EXPECT_EQ(frame.height, uint32_t(setup.height));
        EXPECT_EQ(frame.cfa, setup.cfa);
        EXPECT_EQ(frame.samples.size(), size_t(frame.pitch_bytes) * frame.height);
        EXPECT_FALSE(frame.identified);
        EXPECT_GE(frame.stamp.timestamp_ns, started_ns);
        if (last.frame_id) {
            EXPECT_EQ(frame.stamp.frame_id, last.frame_id + 1);
            EXPECT_GT(frame.stamp.timestamp_ns, last.timestamp_ns);
        }
        last = frame.stamp;
    }
    const CameraCounts counts = camera_->counts();
    EXPECT_EQ(counts.missing_ids + counts.dropped + counts.underrun + counts.stale, 0u);
}

TEST_P(CameraConformance, a_read_without_frames_ends_with_its_time_out_and_the_camera_lives) {
    start();
    EXPECT_FALSE(camera_->read(0).has_value());
    EXPECT_FALSE(camera_->read(soon_ms).has_value());
    EXPECT_EQ(camera_->state().kind, CameraState::live);
}

TEST_P(CameraConformance, every_frame_from_before_the_watermark_has_been_delivered) {
    start();
    for (int n = 0; n < 3; ++n) {
        rig_->expose(2);
        const uint64_t watermark_ns = camera_->watermark_ns();
        while (camera_->read(0)) {
        }
        rig_->expose(1);
        for (const Frame& frame : read(1)) EXPECT_GE(frame.stamp.timestamp_ns, watermark_ns);
    }
    const uint64_t last_ns = camera_->watermark_ns();
    rig_->expose(1);
    EXPECT_GT(camera_->watermark_ns(), last_ns) << "it goes on";
}

TEST_P(CameraConformance, frames_of_before_the_start_are_nobodys_and_not_lost) {
    rig_->expose(3);
    const uint64_t started_ns = start();
    rig_->expose(2);
    for (const Frame& frame : read(2)) EXPECT_GE(frame.stamp.timestamp_ns, started_ns);
    EXPECT_FALSE(camera_->read(soon_ms).has_value());
    EXPECT_EQ(camera_->counts().missing_ids, 0u);
}

TEST_P(CameraConformance, starts_again_after_a_stop_without_what_came_before) {
    start();
    rig_->expose(3);
    read(1);
    camera_->stop();
    EXPECT_FALSE(camera_->read(soon_ms).has_value());
    rig_->expose(2);
    const uint64_t started_ns = start();
    EXPECT_FALSE(camera_->read(soon_ms).has_value());
    rig_->expose(2);
    for (const Frame& frame : read(2)) EXPECT_GE(frame.stamp.timestamp_ns, started_ns);
    EXPECT_EQ(camera_->counts().missing_ids, 0u) << "what nobody wanted is not lost";
}

TEST_P(CameraConformance, a_read_that_waits_ends_when_another_thread_stops_the_camera) {
    start();
    std::thread reader([&] { EXPECT_FALSE(camera_->read(100).has_value()); });
    camera_->stop();
    reader.join();
    start();
    rig_->expose(1);
    read(1);
}

TEST_P(CameraConformance, a_frame_that_never_came_is_counted_when_the_next_one_comes) {
    start();
    rig_->expose(2);
    rig_->lose_one();
    rig_->expose(1);
    const auto frames = read(3);
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(frames[2].stamp.frame_id, frames[1].stamp.frame_id + 2);
    EXPECT_EQ(camera_->counts().missing_ids, 1u);
}

TEST_P(CameraConformance, what_was_exposed_before_the_end_is_read_and_then_it_has_ended) {
    start();
    rig_->expose(2);
    rig_->end();
    EXPECT_EQ(camera_->state().kind, CameraState::live) << "frames are to be read";
    read(2);
    const CameraState state = state_after_all();
    EXPECT_EQ(state.kind, CameraState::ended);
    EXPECT_NE(state.why, "");
    EXPECT_FALSE(camera_->read(0).has_value());
}

TEST_P(CameraConformance, a_device_that_fails_is_gone_and_says_so_and_does_not_start) {
    start();
    rig_->die();
    const CameraState state = state_after_all();
    EXPECT_EQ(state.kind, CameraState::gone);
    EXPECT_NE(state.why.find("gone"), std::string::npos) << state.why;
    EXPECT_FALSE(camera_->read(0).has_value());
    camera_->stop();
    const auto again = camera_->start();
    ASSERT_FALSE(again.ok());
    EXPECT_NE(again.error().message.find("gone"), std::string::npos) << again.error().message;
}

TEST_P(CameraConformance, a_device_that_fails_while_nobody_reads_is_found_gone_by_a_look) {
    EXPECT_EQ(camera_->look().kind, CameraState::live);
    rig_->die();
    CameraState state = camera_->look();
    for (int waited_ms = 0; waited_ms < surely_ms && state.kind == CameraState::live; waited_ms += 10) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        state = camera_->look();
    }
    EXPECT_EQ(state.kind, CameraState::gone);
    EXPECT_NE(state.why.find("gone"), std::string::npos) << state.why;
}

TEST_P(CameraConformance, two_cameras_share_nothing) {
    const auto other_rig = GetParam().make();
    const auto other = other_rig->open();
    ASSERT_TRUE(other->set_up(other_rig->fitting_setup()).ok());
    ASSERT_TRUE(other->start().ok());
    start();
    rig_->expose(2);
    other_rig->expose(1);
    camera_->stop();
    EXPECT_TRUE(other->read(surely_ms).has_value());
    EXPECT_FALSE(other->read(soon_ms).has_value());
    EXPECT_EQ(other->state().kind, CameraState::live);
}

}  // namespace ols::test
