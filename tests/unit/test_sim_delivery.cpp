// SPDX-License-Identifier: MIT
// From the board's lines to frames in the ring, with and without faults.
// links: ols_stagesim
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "sim_scenes.hpp"
#include "started_camera.hpp"

using namespace ols;

namespace {

Frame numbered(uint64_t id) {
    Frame frame;
    frame.stamp.frame_id = id;
    frame.width = 2, frame.height = 4, frame.pitch_bytes = 2;
    frame.samples.assign(8, std::byte(id));
    return frame;
}

// The ids that come out when frames 0 to `count` - 1 go in.
std::vector<uint64_t> delivered(const std::vector<Fault>& faults, uint64_t count = 6) {
    FaultyDelivery delivery(faults, 0);
    std::vector<uint64_t> ids;
    const auto take = [&](Frame frame) { ids.push_back(frame.stamp.frame_id); };
    for (uint64_t n = 0; n < count; ++n) delivery.send(numbered(n), n, take);
    delivery.finish(take);
    return ids;
}

using Ids = std::vector<uint64_t>;

// A white card under two lamps, seen by a camera of 8 x 6 pixels.
class CardStage : public testing::Test {
  protected:
    CardStage()
        : folder_(std::filesystem::temp_directory_path() / ("ring" + std::to_string(getpid()))),
          stage_(small_stage({{0, 0, 1}, {0.6, 0, 0.8}}, 8, 6)) {
        std::filesystem::create_directories(folder_);
        add_quad(scene_, {}, {0, 0, 1}, {0, 1, 0}, 2, matte(0.8f));
        scene_.clock = {1000, 2000};
    }
    ~CardStage() override { std::filesystem::remove_all(folder_); }

    // Plays triggers of 1000 ticks every 2000 with one lamp lit and returns what the host finds.
    std::vector<Frame> play(int triggers, const std::vector<Fault>& faults, bool camera_model = true) {
        const ols::Setup setup{scene_, stage_, stage_.cameras[0], camera_model};
        auto ring = RingWriter::create(folder_ / "cam0.ring", 32, ring_content(setup, {}));
        auto reader = RingReader::open(folder_ / "cam0.ring");
        VirtualCamera camera(setup, {}, 0, std::move(*ring), truth_path(), faults, true, cancelled_);
        start_camera(*reader, camera);
        for (int i = 0; i < triggers; ++i) camera.expose(exposure(10000 + uint64_t(i) * 2000));
        camera.set_now(10000 + uint64_t(triggers) * 2000);
        camera.finish();
        std::vector<Frame> frames;
        while (reader->writer() == RingReader::Writer::live)
            if (auto frame = reader->read(10)) frames.push_back(std::move(*frame));
        watermark_ns_ = reader->watermark_ns();
        return frames;
    }

    std::string truth_path() const { return folder_ / "cam0.frames.jsonl"; }

    static ExposureMessage exposure(uint64_t rise) {
        ExposureMessage message;
        message.rise = rise, message.fall = rise + 1000;
        message.segments = {{rise, rise + 1000, {1, 0, 0, 0}}};
        return message;
    }

    std::filesystem::path folder_;
    Scene scene_;
    StageConfig stage_;
    std::atomic<bool> cancelled_ = false;
    uint64_t watermark_ns_ = 0;
};

}  // namespace

TEST(BoardMessages, an_exposure_lights_lamps_for_the_time_of_its_segments_inside_the_window) {
    const auto message =
        parse_board_message(R"({"type":"exposure","n":4,"trigger":1,"rise":1000,"fall":2000,"segments":[)"
                            R"({"on":500,"off":1250,"bits":"8000"},{"on":1500,"off":1750,"bits":"c001"}]})");
    ASSERT_TRUE(message.ok());
    const auto& exposure = std::get<ExposureMessage>(*message);
    EXPECT_EQ(exposure.trigger, 1);
    StageConfig stage = small_stage({{0, 0, 1}, {0, 1, 0}, {1, 0, 0}});
    stage.chain_bit_of_lamp = {0, 1, 15};
    const auto lit_us = lit_microseconds(exposure, stage);
    // 8 ns a tick: bit 0 for 250 + 250 ticks, bits 1 and 15 for 250.
    EXPECT_EQ(lit_us, (std::vector<double>{4, 2, 2}));
}

TEST(BoardMessages, other_lines_are_told_apart_and_nonsense_is_an_error) {
    EXPECT_EQ(std::get<NowMessage>(*parse_board_message(R"({"type":"now","tick":7})")).tick, 7u);
    EXPECT_TRUE(std::get<UsbMessage>(*parse_board_message(R"({"type":"usb","connected":true})")).connected);
    EXPECT_EQ(std::get<OtherMessage>(*parse_board_message(R"({"type":"reset","cause":"watchdog"})")).type, "reset");
    for (const char* line :
         {"", "{", "[]", "{}", R"({"type":"now"})", R"({"type":"exposure","trigger":0})",
          R"({"type":"exposure","trigger":0,"rise":0,"fall":1,"segments":[{"on":0,"off":1,"bits":"xy"}]})"})
        EXPECT_FALSE(parse_board_message(line).ok()) << line;
}

TEST(CameraClock, runs_off_by_its_drift_and_loses_no_nanosecond_in_a_day) {
    const CameraClock clock{500, 10};
    EXPECT_EQ(camera_time_ns(clock, 0), 500u);
    EXPECT_EQ(camera_time_ns(clock, 125'000'000), 500u + 1'000'010'000u);
    const uint64_t day = 24ull * 3600 * 125'000'000;
    EXPECT_EQ(camera_time_ns(clock, day + 1) - camera_time_ns(clock, day), 8u);
}

TEST(Faults, none_delivers_every_frame_in_order) {
    EXPECT_EQ(delivered({}), (Ids{0, 1, 2, 3, 4, 5}));
}

TEST(Faults, lost_doubled_late_and_swapped_frames_come_out_as_named) {
    EXPECT_EQ(delivered({{FaultKind::drop_frame, 0, 2}}), (Ids{0, 1, 3, 4, 5}));
    EXPECT_EQ(delivered({{FaultKind::duplicate, 0, 2}}), (Ids{0, 1, 2, 2, 3, 4, 5}));
    EXPECT_EQ(delivered({{FaultKind::swap, 0, 2}}), (Ids{0, 1, 3, 2, 4, 5}));
    EXPECT_EQ(delivered({{FaultKind::late, 0, 1, 3}}), (Ids{0, 2, 3, 4, 1, 5}));
    EXPECT_EQ(delivered({{FaultKind::late, 0, 4, 3}}), (Ids{0, 1, 2, 3, 5, 4}));
    EXPECT_EQ(delivered({{FaultKind::drop_frame, 1, 2}}), (Ids{0, 1, 2, 3, 4, 5}));  // of another camera
}

TEST(Faults, a_frozen_frame_shows_the_one_before_and_a_short_one_lacks_two_rows) {
    FaultyDelivery delivery({{FaultKind::freeze, 0, 1}, {FaultKind::wrong_size, 0, 2}}, 0);
    std::vector<Frame> frames;
    for (uint64_t n = 0; n < 4; ++n) delivery.send(numbered(n), n, [&](Frame f) { frames.push_back(std::move(f)); });
    EXPECT_EQ(frames[1].samples, numbered(0).samples);
    EXPECT_EQ(frames[1].stamp.frame_id, 1u);
    EXPECT_EQ(frames[2].height, 2u);
    EXPECT_EQ(frames[2].samples.size(), 4u);
    EXPECT_EQ(frames[3].samples, numbered(3).samples);
}

TEST_F(CardStage, the_truth_of_each_frame_names_its_trigger_and_lamps) {
    play(2, {});
    std::ifstream file(truth_path());
    std::string first, second;
    std::getline(file, first);
    std::getline(file, second);
    // The clock adds 1000 ns and 2000 ppm to ticks of 8 ns: 80000 * 1.002 + 1000, 96000 * 1.002 + 1000.
    EXPECT_EQ(first, R"({"frame_id":1,"timestamp_ns":81160,"trigger":0,"tick":10000,"lit":[0]})");
    EXPECT_EQ(second, R"({"frame_id":2,"timestamp_ns":97192,"trigger":1,"tick":12000,"lit":[0]})");
}

TEST_F(CardStage, frames_arrive_with_ids_from_one_the_cameras_time_and_the_light_of_their_exposure) {
    const auto frames = play(3, {});
    ASSERT_EQ(frames.size(), 3u);
    for (uint64_t i = 0; i < 3; ++i) {
        EXPECT_EQ(frames[i].stamp.frame_id, i + 1);
        EXPECT_EQ(frames[i].stamp.timestamp_ns, 1000 + (10000 + i * 2000) * 8 * 1002 / 1000);
        EXPECT_EQ(frames[i].format, PixelFormat::u16);
        EXPECT_EQ(frames[i].cfa, Cfa::rggb);
        ASSERT_EQ(frames[i].samples.size(), 8u * 6 * 2);
        uint16_t samples[48];
        std::memcpy(samples, frames[i].samples.data(), sizeof samples);
        double mean = 0;
        for (const uint16_t v : samples) mean += v / 48.0;
        // 8 us at 2.52 counts a microsecond on 80 % white, over black 64; off the axis a little less; noise 5 a pixel.
        EXPECT_NEAR(mean, 64 + 8 * 2.52 * 0.8, 3.5);
    }
    EXPECT_EQ(watermark_ns_, 1000u + 16000 * 8 * 1002 / 1000);
}

TEST_F(CardStage, without_the_camera_model_frames_are_float_rgb_above_black_and_never_saturate) {
    const auto frames = play(1, {}, false);
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].format, PixelFormat::f32);
    EXPECT_EQ(frames[0].cfa, Cfa::rgb);
    EXPECT_EQ(frames[0].black, 0);
    std::vector<float> samples(8 * 6 * 3);
    ASSERT_EQ(frames[0].samples.size(), samples.size() * sizeof(float));
    std::memcpy(samples.data(), frames[0].samples.data(), frames[0].samples.size());
    for (const float v : samples) {
        EXPECT_LT(v, 8 * 2.52 * 0.8 + 1e-3);
        EXPECT_GT(v, 0.7 * 8 * 2.52 * 0.8);
    }
}

TEST_F(CardStage, a_missed_trigger_leaves_no_gap_in_the_ids_and_a_lost_frame_does) {
    const auto missed = play(4, {{FaultKind::drop_trigger, 0, 1}});
    ASSERT_EQ(missed.size(), 3u);
    EXPECT_EQ(missed[1].stamp.frame_id, 2u);
    EXPECT_EQ(missed[1].stamp.timestamp_ns, 1000u + 14000 * 8 * 1002 / 1000);
    const auto lost = play(4, {{FaultKind::drop_frame, 0, 1}});
    ASSERT_EQ(lost.size(), 3u);
    EXPECT_EQ(lost[1].stamp.frame_id, 3u);
}

TEST_F(CardStage, a_restarted_camera_counts_from_one_and_keeps_or_loses_its_clock) {
    const auto kept = play(4, {{FaultKind::restart_camera, 0, 2, 1, true}});
    EXPECT_EQ(kept[2].stamp.frame_id, 1u);
    EXPECT_EQ(kept[2].stamp.timestamp_ns - kept[1].stamp.timestamp_ns, 2000u * 8 * 1002 / 1000);
    const auto lost = play(4, {{FaultKind::restart_camera, 0, 2, 1, false}});
    EXPECT_EQ(lost[2].stamp.frame_id, 1u);
    EXPECT_EQ(lost[2].stamp.timestamp_ns, 0u);
    EXPECT_EQ(lost[3].stamp.timestamp_ns, 2000u * 8 * 1002 / 1000);
}

TEST_F(CardStage, faults_are_read_from_a_file_and_mistakes_named) {
    const std::string path = folder_ / "faults.toml";
    std::ofstream(path) << "[[fault]]\nkind = \"late\"\ntrigger = 7\nby = 4\n";
    const auto faults = read_faults(path);
    ASSERT_TRUE(faults.ok()) << faults.error().message;
    EXPECT_EQ((*faults)[0].kind, FaultKind::late);
    EXPECT_EQ((*faults)[0].trigger, 7u);
    EXPECT_EQ((*faults)[0].by, 4u);
    std::ofstream(path) << "[[fault]]\nkind = \"vanish\"\ntrigger = 7\n";
    EXPECT_NE(read_faults(path).error().message.find("faults.toml:2: fault.kind"), std::string::npos);
    std::ofstream(path) << "[[fault]]\nkind = \"late\"\n";
    EXPECT_NE(read_faults(path).error().message.find("trigger"), std::string::npos);
}
