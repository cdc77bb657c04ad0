// SPDX-License-Identifier: MIT
// Both camera drivers against the conformance suite, and what is particular to each.
// links: ols_device
#include <fstream>

#include "camera_conformance.hpp"
#include "device/delivery_count.hpp"
#include "device/fake_camera.hpp"
#include "device/ring_camera.hpp"
#include "ring_rig.hpp"

namespace ols::test {
namespace {

// The fake camera is its own device.
class FakeRig : public CameraRig {
  public:
    std::unique_ptr<Camera> open() override {
        auto camera = std::make_unique<FakeCamera>(FakeOptions{});
        camera_ = camera.get();
        return camera;
    }
    CameraSetup fitting_setup() override {
        CameraSetup setup;
        setup.width = 16;
        setup.height = 8;
        return setup;
    }
    void expose(int count) override {
        for (int n = 0; n < count; ++n) camera_->trigger();
    }
    void lose_one() override { camera_->trigger(FakeFault::lose); }
    void end() override { camera_->trigger(FakeFault::end); }
    void die() override { camera_->trigger(FakeFault::die); }

  private:
    FakeCamera* camera_ = nullptr;
};

INSTANTIATE_TEST_SUITE_P(Drivers, CameraConformance,
                         testing::Values(CameraKind{"ring", [] { return std::make_unique<RingRig>(); }},
                                         CameraKind{"fake", [] { return std::make_unique<FakeRig>(); }}),
                         [](const auto& kind) { return std::string(kind.param.name); });

std::string error_of(const Result<std::unique_ptr<Camera>>& opened) {
    return opened.ok() ? "" : opened.error().message;
}

}  // namespace

TEST(OpenCamera, an_unknown_scheme_is_answered_with_those_there_are) {
    const std::string message = error_of(open_camera("usb3:0"));
    for (const char* kind : {"v4l2:/dev/video0", "ring:PATH"})
        EXPECT_NE(message.find(kind), std::string::npos) << message;
    EXPECT_NE(message.find("fake:RATE"), std::string::npos) << message;
}

TEST(OpenCamera, frames_carry_the_number_of_the_camera_that_was_asked_for) {
    RingRig rig;
    auto camera = open_camera("ring:" + rig.path(), 3);
    ASSERT_TRUE(camera.ok() && (*camera)->start().ok());
    rig.expose(1);
    EXPECT_EQ((*camera)->read(surely_ms)->camera, 3u);
}

TEST(CheckSetup, names_every_key_that_differs_and_those_that_a_camera_does_not_have) {
    CameraSetup wanted, accepted;
    EXPECT_TRUE(check_setup("c", wanted, accepted).ok());
    wanted.exposure_us = 5;
    EXPECT_TRUE(check_setup("c", wanted, accepted).ok()) << "of no account while the trigger's width rules";
    wanted.bits = 10;
    wanted.cfa = Cfa::none;
    wanted.exposure_mode = ExposureMode::timed;
    const Status refused = check_setup("camera X", wanted, accepted, {"exposure_mode"});
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(
        refused.error().message,
        "camera X is not as the stage's [[camera]] says: cfa is rggb and not none; bits is 12 and not 10; it has no "
        "exposure_mode, leave it out");
}

TEST(CheckSetup, names_controls_that_differ_and_those_that_a_camera_does_not_have) {
    CameraSetup wanted, accepted;
    wanted.controls = {{"Gain", "12"}, {"Gamma", "1"}, {"Trigger Mode", "1"}};
    accepted.controls = {{"Gain", "10"}, {"Gamma", "1"}};
    EXPECT_EQ(
        check_setup("camera X", wanted, accepted).error().message,
        "camera X is not as the stage's [[camera]] says: control \"Gain\" is \"10\" and not \"12\"; it has no control "
        "\"Trigger Mode\"");
    FakeCamera fake(FakeOptions{});
    EXPECT_NE(fake.set_up(wanted).error().message.find("it has no control \"Gain\""), std::string::npos);
}

TEST(DeliveryCount, a_gap_counts_its_ids_and_late_frames_and_duplicates_are_none_of_them) {
    DeliveryCount count;
    count.start(1000);
    const auto take = [&](uint64_t id) { return count.take({id, id * 1000}); };
    for (const uint64_t id : {5, 6, 10}) EXPECT_TRUE(take(id));
    EXPECT_EQ(count.counts().missing_ids, 3u) << "7, 8 and 9";
    take(8);
    EXPECT_EQ(count.counts().missing_ids, 2u);
    take(8);
    take(10);
    EXPECT_EQ(count.counts().missing_ids, 2u) << "duplicates";
    take(9), take(7);
    EXPECT_EQ(count.counts().missing_ids, 0u);
}

TEST(DeliveryCount, a_count_that_begins_anew_is_no_gap_and_gaps_are_counted_from_there) {
    DeliveryCount count;
    count.start(0);
    for (const uint64_t id : {100, 101}) count.take({id, id});
    for (const uint64_t id : {1, 2, 4}) count.take({id, 1000 + id});
    EXPECT_EQ(count.counts().missing_ids, 1u);
}

TEST(DeliveryCount, frames_from_before_the_start_are_stale_until_one_of_after_it_has_come) {
    DeliveryCount count;
    count.start(1000);
    EXPECT_FALSE(count.take({7, 998}));
    EXPECT_FALSE(count.take({8, 999}));
    EXPECT_TRUE(count.take({9, 1000}));
    EXPECT_TRUE(count.take({1, 5})) << "its clock was set anew";
    EXPECT_EQ(count.counts().stale, 2u);
    EXPECT_EQ(count.counts().missing_ids, 0u);
}

// A ring in this process, whose program says that the camera's time at the start was 5000.
class RingOfStaleFrames : public testing::Test {
  protected:
    void SetUp() override {
        const std::string path = testing::TempDir() + "stale" + std::to_string(getpid()) + ".ring";
        auto writer = RingWriter::create(path, 4, ring_content_of(RingRig().fitting_setup()));
        auto camera = open_ring_camera(path, 0);
        ASSERT_TRUE(writer.ok() && camera.ok());
        writer_.emplace(std::move(*writer));
        camera_ = std::move(*camera);
        std::thread program([&] {
            while (!writer_->start_asked()) std::this_thread::yield();
            writer_->confirm_start(*writer_->start_asked(), 5000);
        });
        EXPECT_EQ(camera_->start().value(), 5000u);
        program.join();
        std::filesystem::remove(path);
    }
    RingWriter::Outcome write(uint64_t time_ns, const std::atomic<bool>& cancelled) {
        Frame frame;
        frame.width = 16, frame.height = 8, frame.pitch_bytes = 32, frame.samples.resize(256);
        frame.stamp = {time_ns, time_ns};
        return writer_->write(frame, true, cancelled);
    }

    std::optional<RingWriter> writer_;
    std::unique_ptr<Camera> camera_;
};

TEST_F(RingOfStaleFrames, those_exposed_before_the_start_are_passed_over_and_not_counted_as_lost) {
    const std::atomic<bool> never{false};
    for (const uint64_t time_ns : {4998, 4999, 5000}) ASSERT_EQ(write(time_ns, never), RingWriter::Outcome::written);
    EXPECT_EQ(camera_->read(surely_ms)->stamp.timestamp_ns, 5000u);
    EXPECT_EQ(camera_->counts().stale, 2u);
    EXPECT_EQ(camera_->counts().missing_ids, 0u);
}

TEST_F(RingOfStaleFrames, a_flood_of_them_does_not_keep_a_read_from_its_time_out) {
    std::atomic<bool> done{false};
    std::thread program([&] {
        while (!done) write(4000, done);
    });
    EXPECT_FALSE(camera_->read(5).has_value());
    done = true;
    program.join();
    EXPECT_EQ(camera_->state().kind, CameraState::live);
}

TEST(RingCamera, a_program_that_gives_no_answer_is_given_up_at_the_start) {
    RingRig rig;
    auto reader = RingReader::open(rig.path());
    ASSERT_TRUE(reader.ok());
    kill(rig.process(), SIGSTOP);
    const auto started = reader->start(50);
    kill(rig.process(), SIGCONT);
    ASSERT_FALSE(started.ok());
    EXPECT_NE(started.error().message.find("gives no answer"), std::string::npos) << started.error().message;
}

TEST(FakeCamera, makes_frames_at_its_rate_and_loses_those_it_is_told_to) {
    auto camera = open_camera("fake:2000,lose@2,underrun@5,end@8");
    ASSERT_TRUE(camera.ok()) << camera.error().message;
    ASSERT_TRUE((*camera)->start().ok());
    std::vector<uint64_t> ids;
    while ((*camera)->state().kind == CameraState::live)
        if (const auto frame = (*camera)->read(surely_ms)) ids.push_back(frame->stamp.frame_id);
    EXPECT_EQ(ids, (std::vector<uint64_t>{1, 2, 4, 5, 7, 8}));
    EXPECT_EQ((*camera)->counts().missing_ids, 2u);
    EXPECT_EQ((*camera)->counts().underrun, 1u);
}

TEST(FakeCamera, drops_and_counts_what_nobody_has_room_for) {
    FakeOptions options;
    options.room = 4;
    FakeCamera camera(options);
    ASSERT_TRUE(camera.start().ok());
    for (int n = 0; n < 7; ++n) camera.trigger();
    EXPECT_EQ(camera.counts().dropped, 3u);
    for (int n = 0; n < 4; ++n) EXPECT_TRUE(camera.read(0).has_value());
    EXPECT_FALSE(camera.read(0).has_value());
}

TEST(FakeCamera, a_source_that_says_nothing_it_knows_is_quoted) {
    for (const char* source :
         {"fake:", "fake:fast", "fake:-1", "fake:100,break@3", "fake:100,lose", "fake:100,lose@1.5"})
        EXPECT_NE(error_of(open_camera(source)).find("neither frames a second nor a fault"), std::string::npos)
            << source;
}

}  // namespace ols::test
