// SPDX-License-Identifier: MIT
// The V4L2 driver over a model of the kernel (v4l2_model.hpp): the conformance suite, stamps, losses, and what becomes of a device
// that fails. The kernel itself: tests/guest/test_v4l2.py.
// links: ols_device
#include <thread>

#include "camera_conformance.hpp"
#include "v4l2_fixture.hpp"

namespace ols::test {
namespace {

class V4l2Rig : public CameraRig {
  public:
    explicit V4l2Rig(uint32_t stamp_flags) { model_->buffer_flags = stamp_flags; }
    std::unique_ptr<Camera> open() override {
        auto camera = make_v4l2_camera(model_, "/dev/video7", 0);
        EXPECT_TRUE(camera.ok()) << (camera.ok() ? "" : camera.error().message);
        return camera.ok() ? std::move(*camera) : nullptr;
    }
    CameraSetup fitting_setup() override { return setup_of(Cfa::rggb, 12); }
    void expose(int count) override {
        for (int n = 0; n < count; ++n) model_->expose();
    }
    void lose_one() override { model_->lose(); }
    void end() override { model_->finish(); }
    void die() override { model_->unplug(); }

  private:
    std::shared_ptr<V4l2Model> model_ = std::make_shared<V4l2Model>();
};

std::unique_ptr<CameraRig> rig_with(uint32_t stamp_flags) {
    return std::make_unique<V4l2Rig>(stamp_flags);
}

INSTANTIATE_TEST_SUITE_P(
    Drivers, CameraConformance,
    testing::Values(CameraKind{"v4l2", [] { return rig_with(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC); }},
                    CameraKind{
                        "v4l2_stamped_at_the_begin",
                        [] { return rig_with(V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE); }},
                    CameraKind{"v4l2_of_unsaid_clock", [] { return rig_with(V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN); }}),
    [](const auto& kind) { return std::string(kind.param.name); });

}  // namespace

TEST_F(V4l2CameraTest, another_program_that_streams_is_named_wherever_the_driver_says_so) {
    for (const unsigned long request : {VIDIOC_S_FMT, VIDIOC_REQBUFS}) {
        model_->refusals = {{request, EBUSY}};
        EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "another program streams from it"));
    }
    model_->refusals = {{VIDIOC_STREAMON, EBUSY}};
    ASSERT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
    EXPECT_TRUE(has(error_of(camera_->start()), "another program streams from it"));
    model_->refusals.clear();
    EXPECT_TRUE(camera_->start().ok()) << "and starts when it is free again";
}

TEST_F(V4l2CameraTest, no_start_without_a_set_up) {
    open();
    EXPECT_TRUE(has(error_of(camera_->start()), "not set up"));
}

TEST_F(V4l2CameraTest, nodes_that_are_no_cameras_are_named_for_what_they_are) {
    const auto refusal = [&](uint32_t caps) {
        model_->device_caps = caps;
        return error_of(make_v4l2_camera(model_, "/dev/video7", 0));
    };
    EXPECT_TRUE(has(refusal(V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING), "what is known about pictures"));
    EXPECT_TRUE(has(refusal(V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING), "several planes"));
    EXPECT_TRUE(has(refusal(V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_READWRITE), "cannot stream"));
    EXPECT_TRUE(has(refusal(V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING), "captures no pictures"));
    model_->refusals = {{VIDIOC_QUERYCAP, ENOTTY}};
    EXPECT_TRUE(has(refusal(V4L2_CAP_VIDEO_CAPTURE), "is no V4L2 device"));
    EXPECT_TRUE(has(error_of(open_camera("v4l2:/dev/null")), "is no V4L2 device"));
    EXPECT_TRUE(has(error_of(open_camera("v4l2:/dev/no_such_video")), "cannot open the camera '/dev/no_such_video'"));
    EXPECT_TRUE(has(error_of(open_camera("v4l2:987")), "'/dev/video987'"));
    for (const char* source : {"v4l2:", "v4l2:first", "v4l2:-1", "v4l2:12345"})
        EXPECT_TRUE(has(error_of(open_camera(source)), "names no device")) << source;
}

TEST_F(V4l2CameraTest, a_device_without_any_format_is_told_to_be_fed_first) {
    model_->formats.clear();
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "start that one first"));
}

// Stamps and losses.

TEST_F(V4l2CameraTest, frames_that_the_driver_marks_or_cuts_short_are_not_handed_on_and_counted) {
    start();
    model_->expose();
    model_->expose({.flags = V4L2_BUF_FLAG_ERROR});
    model_->expose({.bytes_short = model_->row_bytes_in_force()});
    model_->expose();
    EXPECT_EQ(read_ids(2), (Ids{0, 3}));
    EXPECT_EQ(camera_->counts().underrun, 2u);
    EXPECT_EQ(camera_->counts().missing_ids, 2u) << "and the same two";
    EXPECT_EQ(camera_->counts().dropped, 0u);
}

TEST_F(V4l2CameraTest, the_room_behind_the_last_row_need_not_be_filled) {
    start();
    model_->expose({.bytes_short = model_->row_bytes_in_force() - width * 2});
    EXPECT_EQ(read_ids(1), Ids{0});
}

TEST_F(V4l2CameraTest, a_count_of_32_bits_goes_on_beyond_them_and_one_that_begins_anew_is_no_gap) {
    model_->first_sequence = 0xffff'fffe;
    start();
    for (int n = 0; n < 4; ++n) model_->expose();
    EXPECT_EQ(read_ids(4), (Ids{0xffff'fffe, 0xffff'ffff, 0x1'0000'0000, 0x1'0000'0001}));
    model_->lose();
    model_->expose();
    EXPECT_EQ(read_ids(1), Ids{0x1'0000'0003});
    EXPECT_EQ(camera_->counts().missing_ids, 1u);
    model_->set_sequence(0);
    model_->expose();
    model_->expose();
    EXPECT_EQ(read_ids(2).size(), 2u);
    EXPECT_EQ(camera_->counts().missing_ids, 1u);
    camera_->stop();
    model_->first_sequence = 7;
    start();
    model_->expose();
    EXPECT_EQ(read_ids(1), Ids{7}) << "begun anew by STREAMON";
    EXPECT_EQ(camera_->counts().missing_ids, 1u);
}

TEST_F(V4l2CameraTest, stamps_of_another_clock_end_the_camera_by_the_name_of_the_right_one) {
    start();
    model_->expose({.clock_offset_ns = 1'700'000'000'000'000'000});
    EXPECT_FALSE(camera_->read(surely_ms));
    EXPECT_EQ(camera_->state().kind, CameraState::gone);
    EXPECT_TRUE(has(camera_->state().why, "not of CLOCK_MONOTONIC")) << camera_->state().why;
}

TEST_F(V4l2CameraTest, stamps_that_are_copies_are_refused_by_their_name) {
    model_->buffer_flags = V4L2_BUF_FLAG_TIMESTAMP_COPY;
    start();
    model_->expose();
    EXPECT_FALSE(camera_->read(surely_ms));
    EXPECT_TRUE(has(camera_->state().why, "V4L2_BUF_FLAG_TIMESTAMP_COPY")) << camera_->state().why;
}

TEST_F(V4l2CameraTest, a_timed_exposure_is_taken_off_a_stamp_of_the_end_and_not_of_one_of_the_begin) {
    model_->controls = {
        {V4L2_CID_EXPOSURE_AUTO,
         "Exposure, Auto",
         V4L2_CTRL_TYPE_MENU,
         0,
         3,
         1,
         3,
         0,
         {"Auto Mode", "Manual Mode", "", "Aperture Priority Mode"}},
        {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", V4L2_CTRL_TYPE_INTEGER, 1, 5000, 1, 156}};
    CameraSetup timed = setup_of(Cfa::rggb, 12);
    timed.exposure_mode = ExposureMode::timed;
    timed.exposure_us = 40'000;
    const uint32_t ends = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, begins = ends | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    for (const uint32_t flags : {ends, begins}) {
        model_->buffer_flags = flags;
        const uint64_t started_ns = start(timed), exposure_ns = flags == ends ? 40'000'000 : 0;
        EXPECT_EQ(model_->control(V4L2_CID_EXPOSURE_AUTO).value, V4L2_EXPOSURE_MANUAL);
        EXPECT_EQ(model_->control(V4L2_CID_EXPOSURE_ABSOLUTE).value, 400);
        EXPECT_TRUE(has(camera_->info().link, flags == ends ? "end of the frame" : "begin of the exposure"));
        model_->expose({.clock_offset_ns = 30'000'000});  // begun before the start, if this is its end
        model_->expose({.clock_offset_ns = 100'000'000});
        const uint64_t due_ns = model_->now_ns() + 100'000'000 - exposure_ns;
        if (flags == begins) {
            EXPECT_GE(camera_->read(surely_ms)->stamp.timestamp_ns, started_ns + 30'000'000);
        }
        const auto frame = camera_->read(surely_ms);
        EXPECT_EQ(frame->stamp.frame_id, 1u);
        EXPECT_LE(frame->stamp.timestamp_ns, due_ns);
        EXPECT_GE(frame->stamp.timestamp_ns, started_ns + 100'000'000 - exposure_ns);
        EXPECT_EQ(camera_->counts().stale, 1u);
    }
}

TEST_F(V4l2CameraTest, the_watermark_stays_behind_by_what_a_frame_takes_to_come) {
    start();
    const uint64_t before_ns = model_->now_ns(), watermark_ns = camera_->watermark_ns(), after_ns = model_->now_ns();
    EXPECT_GE(watermark_ns + 1'500'000'000, before_ns);
    EXPECT_LE(watermark_ns + 1'500'000'000, after_ns) << "an exposure of a second, and half a second on the way";
}

TEST_F(V4l2CameraTest, all_buffers_out_freezes_nothing_and_what_there_was_no_buffer_for_was_dropped) {
    start();
    for (int n = 0; n < 40; ++n) model_->expose();
    EXPECT_EQ(read_ids(8), (Ids{0, 1, 2, 3, 4, 5, 6, 7}));
    for (int n = 0; n < 3; ++n) model_->expose();
    EXPECT_EQ(read_ids(3), (Ids{40, 41, 42}));
    EXPECT_EQ(camera_->counts().missing_ids, 32u);
    EXPECT_EQ(camera_->counts().dropped, 32u) << "we were late";
}

TEST_F(V4l2CameraTest, what_was_lost_while_there_were_buffers_was_not_dropped_by_us) {
    start();
    for (int n = 0; n < 20; ++n) {
        model_->expose();
        read_ids(1);
    }
    for (int n = 0; n < 5; ++n) model_->lose();
    model_->expose();
    EXPECT_EQ(read_ids(1), Ids{25});
    EXPECT_EQ(camera_->counts().missing_ids, 5u);
    EXPECT_EQ(camera_->counts().dropped, 0u);
}

TEST_F(V4l2CameraTest, of_v4l2loopback_what_its_writer_has_gone_round_into_is_not_handed_on) {
    model_->driver = "v4l2 loopback";
    start();
    for (int n = 0; n < 3; ++n) model_->expose();
    EXPECT_EQ(read_ids(1), Ids{0});
    model_->overwrite(0, 8);  // of eight buffers: frame 9 goes where frame 1 is
    EXPECT_EQ(read_ids(1), Ids{2});
    EXPECT_EQ(camera_->counts().dropped, 1u);
    EXPECT_EQ(camera_->counts().missing_ids, 1u);
    model_->lose();
    model_->expose();
    EXPECT_EQ(read_ids(1), Ids{4});
    EXPECT_EQ(camera_->counts().dropped, 2u) << "it leaves frames out for readers that are late";
}

// Failures.

TEST_F(V4l2CameraTest, unplugged_while_idle_it_is_gone_at_the_set_up) {
    open();
    model_->unplug();
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "gone: it was unplugged"));
    EXPECT_EQ(camera_->state().kind, CameraState::gone);
}

TEST_F(V4l2CameraTest, unplugged_while_armed_a_read_that_waits_ends_and_says_why) {
    start();
    std::thread other([&] { model_->unplug(); });
    while (camera_->state().kind == CameraState::live) EXPECT_FALSE(camera_->read(100));
    other.join();
    EXPECT_TRUE(has(camera_->state().why, "gone: it was unplugged")) << camera_->state().why;
}

TEST_F(V4l2CameraTest, a_queue_that_breaks_down_is_gone_with_the_drivers_word) {
    start();
    model_->expose();
    read_ids(1);
    model_->break_down();
    EXPECT_FALSE(camera_->read(surely_ms));
    EXPECT_TRUE(has(camera_->state().why, "its driver gave up (Input/output error)")) << camera_->state().why;
}

TEST_F(V4l2CameraTest, a_driver_that_hangs_in_a_start_is_given_up_and_gone) {
    open(50);
    ASSERT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
    model_->hang_in(VIDIOC_STREAMON);
    EXPECT_TRUE(has(error_of(camera_->start()), "gone: it gave no answer to VIDIOC_STREAMON"));
    EXPECT_EQ(camera_->state().kind, CameraState::gone);
    EXPECT_TRUE(has(error_of(camera_->start()), "gone"));
    camera_.reset();  // returns, too
    model_->hang_no_more();
}

TEST_F(V4l2CameraTest, a_start_that_waits_fails_when_another_thread_stops_the_camera) {
    ASSERT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
    model_->hang_in(VIDIOC_STREAMON);
    std::thread other([&] {
        while (!model_->is_called(VIDIOC_STREAMON)) std::this_thread::yield();
        std::thread release([&] {
            while (!has_failed_) std::this_thread::yield();
            model_->hang_no_more();
        });
        camera_->stop();
        release.join();
    });
    EXPECT_TRUE(has(error_of(camera_->start()), "was stopped while it started"));
    has_failed_ = true;
    other.join();
    EXPECT_FALSE(model_->is_streaming()) << "what had been asked for is undone, in order";
    EXPECT_EQ(camera_->state().kind, CameraState::live);
    EXPECT_TRUE(camera_->start().ok());
}

TEST_F(V4l2CameraTest, one_that_is_silent_for_long_is_asked_and_lives_if_it_answers) {
    open(20);
    ASSERT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
    ASSERT_TRUE(camera_->start().ok());
    for (int n = 0; n < 10; ++n) EXPECT_FALSE(camera_->read(10));
    EXPECT_EQ(camera_->state().kind, CameraState::live);
    model_->hang_in(VIDIOC_QUERYCAP);
    while (camera_->state().kind == CameraState::live) EXPECT_FALSE(camera_->read(10));
    EXPECT_TRUE(has(camera_->state().why, "no answer to VIDIOC_QUERYCAP")) << camera_->state().why;
    model_->hang_no_more();
}

TEST_F(V4l2CameraTest, one_that_hangs_is_found_by_a_look_also_behind_a_stop) {
    open(20);
    ASSERT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
    camera_->stop();
    model_->hang_in(VIDIOC_QUERYCAP);
    EXPECT_EQ(camera_->look().kind, CameraState::gone);
    EXPECT_TRUE(has(camera_->state().why, "no answer to VIDIOC_QUERYCAP")) << camera_->state().why;
    model_->hang_no_more();
}

}  // namespace ols::test
