// SPDX-License-Identifier: MIT
// The shared-memory ring: nothing lost or reordered between two threads, waiting and dropping as told, bad files
// refused.
// links: ols_device
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "device/ring.hpp"

using namespace ols;

namespace {

const std::atomic<bool> never{false};

std::string ring_path(const char* name) {
    return std::filesystem::temp_directory_path() / (std::string(name) + std::to_string(getpid()) + ".ring");
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

}  // namespace

TEST(Ring, a_frame_comes_out_as_it_went_in) {
    auto writer = RingWriter::create(ring_path("same"), 4, 256);
    ASSERT_TRUE(writer.ok()) << writer.error().message;
    auto reader = RingReader::open(ring_path("same"));
    ASSERT_TRUE(reader.ok()) << reader.error().message;
    Frame sent = numbered_frame(7);
    sent.camera = 3;
    sent.black = 64;
    sent.white = 4095;
    ASSERT_TRUE(writer->write(sent, true, never));
    const auto got = reader->read(0);
    ASSERT_TRUE(got.has_value());
    EXPECT_EQ(got->camera, 3u);
    EXPECT_EQ(got->stamp.frame_id, 7u);
    EXPECT_EQ(got->stamp.timestamp_ns, 7000u);
    EXPECT_EQ(got->width, 16u);
    EXPECT_EQ(got->cfa, Cfa::rggb);
    EXPECT_EQ(got->black, 64);
    EXPECT_EQ(got->samples, sent.samples);
    EXPECT_FALSE(got->identified);
    EXPECT_FALSE(reader->read(0).has_value());
}

TEST(Ring, ten_thousand_frames_cross_two_threads_in_order_and_whole) {
    auto writer = RingWriter::create(ring_path("order"), 3, 256);
    auto reader = RingReader::open(ring_path("order"));
    ASSERT_TRUE(writer.ok() && reader.ok());
    std::thread camera([&] {
        for (uint64_t id = 0; id < 10000; ++id) writer->write(numbered_frame(id), true, never);
        writer->close();
    });
    uint64_t expected = 0;
    while (!reader->closed()) {
        const auto frame = reader->read(1000);
        if (!frame) continue;
        ASSERT_EQ(frame->stamp.frame_id, expected);
        ASSERT_EQ(frame->samples, numbered_frame(expected).samples);
        ++expected;
    }
    camera.join();
    EXPECT_EQ(expected, 10000u);
}

TEST(Ring, a_full_ring_drops_and_counts_when_the_writer_may_not_wait) {
    auto writer = RingWriter::create(ring_path("full"), 2, 256);
    auto reader = RingReader::open(ring_path("full"));
    for (uint64_t id = 0; id < 5; ++id) EXPECT_EQ(writer->write(numbered_frame(id), false, never), id < 2);
    EXPECT_EQ(reader->dropped(), 3u);
    EXPECT_EQ(reader->read(0)->stamp.frame_id, 0u);
    EXPECT_TRUE(writer->write(numbered_frame(9), false, never));
    EXPECT_EQ(reader->read(0)->stamp.frame_id, 1u);
    EXPECT_EQ(reader->read(0)->stamp.frame_id, 9u);
}

TEST(Ring, a_waiting_writer_gives_up_when_cancelled) {
    auto writer = RingWriter::create(ring_path("cancel"), 1, 256);
    ASSERT_TRUE(writer->write(numbered_frame(0), true, never));
    const std::atomic<bool> cancelled{true};
    EXPECT_FALSE(writer->write(numbered_frame(1), true, cancelled));
}

TEST(Ring, watermark_and_end_reach_the_reader) {
    auto writer = RingWriter::create(ring_path("mark"), 2, 256);
    auto reader = RingReader::open(ring_path("mark"));
    writer->set_watermark(123456789);
    EXPECT_EQ(reader->watermark_ns(), 123456789u);
    ASSERT_TRUE(writer->write(numbered_frame(1), true, never));
    writer->close();
    EXPECT_FALSE(reader->closed()) << "a frame is still to be read";
    EXPECT_TRUE(reader->read(0).has_value());
    EXPECT_TRUE(reader->closed());
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
    { ASSERT_TRUE(RingWriter::create(ring_path("cut"), 8, 4096).ok()); }
    std::filesystem::resize_file(ring_path("cut"), 8192);
    EXPECT_FALSE(RingReader::open(ring_path("cut")).ok());
}
