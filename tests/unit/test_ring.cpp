// SPDX-License-Identifier: MIT
// The shared-memory ring: nothing lost or reordered between two threads, waiting and dropping as told, starts answered, ends
// of either side noticed, bad files refused.
// links: ols_device
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "device/ring.hpp"
#include "ring_rig.hpp"

using namespace ols;

namespace {

using Outcome = RingWriter::Outcome;
const std::atomic<bool> never{false};
constexpr int patience_ms = 60'000;

std::string ring_path(const char* name) {
    return std::filesystem::temp_directory_path() / (std::string(name) + std::to_string(getpid()) + ".ring");
}

RingContent small_content() {
    return {16, 8, PixelFormat::u16, Cfa::rggb, 12, 0};
}

// A frame whose every byte follows from its id.
Frame numbered_frame(uint64_t id, uint32_t width = 16, uint32_t height = 8) {
    Frame frame;
    frame.stamp = {id, id * 1000};
    frame.width = width;
    frame.height = height;
    frame.cfa = Cfa::rggb;
    frame.pitch_bytes = width * 2;
    frame.samples.assign(size_t(height) * frame.pitch_bytes, std::byte(id * 37 + 11));
    return frame;
}

// A ring whose reader has started the camera.
struct StartedRing {
    StartedRing(const char* name, uint32_t slots)
        : writer(std::move(*RingWriter::create(ring_path(name), slots, small_content()))),
          reader(std::move(*RingReader::open(ring_path(name)))) {
        EXPECT_EQ(start(0), 0u);
    }
    uint64_t start(uint64_t camera_time_ns) {
        std::thread camera([&] {
            while (!writer.start_asked()) std::this_thread::yield();
            writer.confirm_start(*writer.start_asked(), camera_time_ns);
        });
        const auto started = reader.start(patience_ms);
        camera.join();
        return started.ok() ? *started : UINT64_MAX;
    }
    RingWriter writer;
    RingReader reader;
};

}  // namespace

TEST(Ring, a_frame_comes_out_as_it_went_in) {
    StartedRing ring("same", 4);
    Frame sent = numbered_frame(7);
    sent.camera = 3;
    sent.black = 64;
    sent.white = 4095;
    ASSERT_EQ(ring.writer.write(sent, true, never), Outcome::written);
    const auto got = ring.reader.read(0);
    ASSERT_TRUE(got.has_value());
    EXPECT_EQ(got->camera, 3u);
    EXPECT_EQ(got->stamp.frame_id, 7u);
    EXPECT_EQ(got->stamp.timestamp_ns, 7000u);
    EXPECT_EQ(got->width, 16u);
    EXPECT_EQ(got->cfa, Cfa::rggb);
    EXPECT_EQ(got->black, 64);
    EXPECT_EQ(got->samples, sent.samples);
    EXPECT_FALSE(got->identified);
    EXPECT_FALSE(ring.reader.read(0).has_value());
}

TEST(Ring, the_reader_learns_what_the_frames_are) {
    StartedRing ring("content", 4);
    EXPECT_EQ(ring.reader.content().width, 16u);
    EXPECT_EQ(ring.reader.content().height, 8u);
    EXPECT_EQ(ring.reader.content().cfa, Cfa::rggb);
    EXPECT_EQ(ring.reader.content().bits, 12u);
    EXPECT_EQ(ring.reader.slots(), 4u);
}

TEST(Ring, ten_thousand_frames_cross_two_threads_in_order_and_whole) {
    StartedRing ring("order", 3);
    std::thread camera([&] {
        for (uint64_t id = 0; id < 10000; ++id) ring.writer.write(numbered_frame(id), true, never);
        ring.writer.close();
    });
    uint64_t expected = 0;
    while (ring.reader.writer() == RingReader::Writer::live) {
        const auto frame = ring.reader.read(1000);
        if (!frame) continue;
        ASSERT_EQ(frame->stamp.frame_id, expected);
        ASSERT_EQ(frame->samples, numbered_frame(expected).samples);
        ++expected;
    }
    camera.join();
    EXPECT_EQ(expected, 10000u);
}

TEST(Ring, a_full_ring_drops_and_counts_when_the_writer_may_not_wait) {
    StartedRing ring("full", 2);
    for (uint64_t id = 0; id < 5; ++id)
        EXPECT_EQ(ring.writer.write(numbered_frame(id), false, never), id < 2 ? Outcome::written : Outcome::full);
    EXPECT_EQ(ring.reader.read(0)->stamp.frame_id, 0u);
    EXPECT_EQ(ring.writer.write(numbered_frame(9), false, never), Outcome::written);
    EXPECT_EQ(ring.writer.write(numbered_frame(10), false, never), Outcome::full);
    EXPECT_EQ(ring.reader.read(0)->stamp.frame_id, 1u);
    EXPECT_EQ(ring.reader.dropped(), 0u) << "of those before it: what is missing there was not dropped";
    EXPECT_EQ(ring.reader.read(0)->stamp.frame_id, 9u);
    EXPECT_EQ(ring.reader.dropped(), 4u) << "all, once all are read";
    EXPECT_EQ(ring.writer.write(numbered_frame(11), false, never), Outcome::written);
    EXPECT_EQ(ring.writer.write(numbered_frame(12), false, never), Outcome::written);
    EXPECT_EQ(ring.writer.write(numbered_frame(13), false, never), Outcome::full);
    EXPECT_EQ(ring.reader.read(0)->stamp.frame_id, 11u);
    EXPECT_EQ(ring.reader.dropped(), 4u);
    EXPECT_EQ(ring.reader.read(0)->stamp.frame_id, 12u);
    EXPECT_EQ(ring.reader.dropped(), 5u);
    EXPECT_EQ(ring.writer.write(numbered_frame(14), false, never), Outcome::written);
    EXPECT_EQ(ring.reader.dropped(), 5u) << "what was told of is not taken back";
}

TEST(Ring, a_waiting_writer_gives_up_when_cancelled) {
    StartedRing ring("cancel", 1);
    ASSERT_EQ(ring.writer.write(numbered_frame(0), true, never), Outcome::written);
    const std::atomic<bool> cancelled{true};
    EXPECT_EQ(ring.writer.write(numbered_frame(1), true, cancelled), Outcome::cancelled);
}

TEST(Ring, frames_are_for_a_reader_that_has_started_the_camera_and_for_nobody_else) {
    auto writer = RingWriter::create(ring_path("wanted"), 1, small_content());
    EXPECT_FALSE(writer->wanted());
    EXPECT_EQ(writer->write(numbered_frame(0), true, never), Outcome::unwanted) << "and does not wait";
    auto reader = RingReader::open(ring_path("wanted"));
    EXPECT_EQ(writer->write(numbered_frame(1), true, never), Outcome::unwanted) << "a reader that has not started it";
    std::thread starting([&] { EXPECT_EQ(reader->start(patience_ms).value(), 5000u); });
    while (!writer->start_asked()) std::this_thread::yield();
    EXPECT_EQ(writer->write(numbered_frame(2), true, never), Outcome::unwanted) << "asked for, and not yet answered";
    writer->confirm_start(*writer->start_asked(), 5000);
    starting.join();
    EXPECT_FALSE(writer->start_asked().has_value());
    EXPECT_EQ(writer->write(numbered_frame(3), true, never), Outcome::written);
    reader->stop();
    EXPECT_EQ(writer->write(numbered_frame(4), true, never), Outcome::unwanted);
}

TEST(Ring, a_writer_that_waits_for_room_is_let_go_when_the_reader_stops_or_goes) {
    for (const bool goes : {false, true}) {
        std::optional<StartedRing> ring(std::in_place, "let_go", 1);
        std::optional<RingReader> reader(std::move(ring->reader));
        ASSERT_EQ(ring->writer.write(numbered_frame(0), true, never), Outcome::written);
        std::thread camera([&] { EXPECT_EQ(ring->writer.write(numbered_frame(1), true, never), Outcome::unwanted); });
        if (goes)
            reader.reset();
        else
            reader->stop();
        camera.join();
    }
}

// The child holds the reader's end and is killed while the ring is full.
TEST(Ring, a_reader_that_was_killed_is_noticed_and_the_next_one_finds_nothing_of_its_frames) {
    const std::string path = ring_path("killed");  // named after this process
    auto writer = RingWriter::create(path, 2, small_content());
    ASSERT_TRUE(writer.ok());
    const pid_t child = fork();
    if (child == 0) {
        auto reader = RingReader::open(path);
        (void)reader->start(patience_ms);
        for (;;) pause();
    }
    while (!writer->start_asked()) ASSERT_EQ(waitpid(child, nullptr, WNOHANG), 0);
    writer->confirm_start(*writer->start_asked(), 0);
    for (const uint64_t id : {0, 1}) ASSERT_EQ(writer->write(numbered_frame(id), true, never), Outcome::written);
    std::thread killer([&] {
        kill(child, SIGKILL);
        waitpid(child, nullptr, 0);
    });
    EXPECT_EQ(writer->write(numbered_frame(2), true, never), Outcome::unwanted)
        << "it waits for room, until nobody is there";
    killer.join();

    auto reader = RingReader::open(path);
    ASSERT_TRUE(reader.ok()) << reader.error().message;
    EXPECT_FALSE(reader->read(0).has_value());
    std::thread camera([&] {
        while (!writer->start_asked()) std::this_thread::yield();
        writer->confirm_start(*writer->start_asked(), 0);
        EXPECT_EQ(writer->write(numbered_frame(3), true, never), Outcome::written);
    });
    ASSERT_TRUE(reader->start(patience_ms).ok());
    camera.join();
    EXPECT_EQ(reader->read(0)->stamp.frame_id, 3u);
}

TEST(Ring, stale_frames_in_the_ring_are_gone_after_a_start_and_those_after_it_are_not) {
    StartedRing ring("stale", 4);
    for (const uint64_t id : {0, 1, 2}) ASSERT_EQ(ring.writer.write(numbered_frame(id), true, never), Outcome::written);
    EXPECT_EQ(ring.start(77), 77u);
    ASSERT_EQ(ring.writer.write(numbered_frame(3), true, never), Outcome::written);
    EXPECT_EQ(ring.reader.read(0)->stamp.frame_id, 3u);
    EXPECT_FALSE(ring.reader.read(0).has_value());
}

TEST(Ring, one_reader_at_a_time_and_the_second_is_told_that_it_is_busy) {
    test::RingRig rig;
    auto first = RingReader::open(rig.path());
    ASSERT_TRUE(first.ok());
    const auto second = RingReader::open(rig.path());
    ASSERT_FALSE(second.ok());
    EXPECT_NE(second.error().message.find("busy"), std::string::npos) << second.error().message;
    { const RingReader gone = std::move(*first); }
    EXPECT_TRUE(RingReader::open(rig.path()).ok());
}

TEST(Ring, watermark_and_end_reach_the_reader) {
    StartedRing ring("mark", 2);
    ring.writer.set_watermark(123456789);
    EXPECT_EQ(ring.reader.watermark_ns(), 123456789u);
    ASSERT_EQ(ring.writer.write(numbered_frame(1), true, never), Outcome::written);
    ring.writer.close();
    EXPECT_EQ(ring.reader.writer(), RingReader::Writer::live) << "a frame is still to be read";
    EXPECT_TRUE(ring.reader.read(0).has_value());
    EXPECT_EQ(ring.reader.writer(), RingReader::Writer::closed);
}

TEST(Ring, a_missing_file_and_a_file_that_is_no_ring_are_clear_errors) {
    const auto missing = RingReader::open("/nonexistent/cam0.ring");
    ASSERT_FALSE(missing.ok());
    EXPECT_NE(missing.error().message.find("start the camera first"), std::string::npos);

    std::ofstream(ring_path("short")) << "hello";
    EXPECT_FALSE(RingReader::open(ring_path("short")).ok());

    std::ofstream(ring_path("other")) << std::string(4096, 'x');
    EXPECT_NE(RingReader::open(ring_path("other")).error().message.find("no camera ring"), std::string::npos);

    // A header that promises more records than the file holds.
    auto cut = RingWriter::create(ring_path("cut"), 8, {64, 32, PixelFormat::u16, Cfa::rggb, 12, 0});
    ASSERT_TRUE(cut.ok());
    std::filesystem::resize_file(ring_path("cut"), 8192);
    EXPECT_NE(RingReader::open(ring_path("cut")).error().message.find("no camera ring"), std::string::npos);
}

TEST(Ring, a_ring_that_nothing_fills_any_more_is_a_clear_error) {
    {
        auto writer = RingWriter::create(ring_path("left"), 2, small_content());
        ASSERT_TRUE(writer.ok());
    }
    const auto left = RingReader::open(ring_path("left"));
    ASSERT_FALSE(left.ok());
    EXPECT_NE(left.error().message.find("start the camera again"), std::string::npos) << left.error().message;

    test::RingRig rig;
    rig.die();
    EXPECT_FALSE(RingReader::open(rig.path()).ok());
}
