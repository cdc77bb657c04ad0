// SPDX-License-Identifier: MIT
// Where frames are until they are developed: memory that is made once, and a disk that forgets nothing, changes nothing and may fail.
// links: ols_record
#include "record/frame_room.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "small_disk.hpp"

using namespace ols;
using namespace ols::test;

namespace {

constexpr size_t bytes = 1000;
constexpr std::chrono::milliseconds at_once(0);

FrameRoom::Options options_of(size_t frames, std::shared_ptr<SpillFile> spill = nullptr, size_t reserve = 0) {
    FrameRoom::Options options;
    options.frames_max = frames, options.frame_bytes = bytes, options.reserve = reserve;
    options.spill = std::move(spill);
    options.period = std::chrono::hours(1);
    return options;
}

// As a reader and its camera do. Null where there is no place.
std::shared_ptr<Frame> read_frame(FrameRoom& room, int number) {
    if (!room.take_place(at_once)) return nullptr;
    Frame frame;
    frame.samples = room.lend();
    frame.samples.assign(bytes, std::byte(number));
    frame.stamp.frame_id = uint64_t(number);
    return room.adopt(std::move(frame));
}

bool shows(const Frame& frame, int number) {
    return frame.samples.size() == bytes && frame.stamp.frame_id == uint64_t(number) &&
           std::all_of(frame.samples.begin(), frame.samples.end(), [&](std::byte b) { return b == std::byte(number); });
}

// proc(5), VmLck.
uint64_t locked_kb() {
    std::ifstream status("/proc/self/status");
    for (std::string word; status >> word;)
        if (word == "VmLck:") return status >> word, std::stoull(word);
    return 0;
}

class FrameRooms : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (std::filesystem::temp_directory_path() / "spill_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        folder = pattern;
    }
    void TearDown() override { std::filesystem::remove_all(folder); }

    std::string folder;
};

}  // namespace

TEST_F(FrameRooms, the_same_buffers_come_and_go_and_no_frame_takes_memory_of_its_own) {
    const auto room = *FrameRoom::create(options_of(3));
    std::set<const std::byte*> buffers;
    for (int round = 0; round < 100; ++round) {
        std::vector<std::shared_ptr<Frame>> held;
        for (int n = 0; n < 3; ++n) {
            held.push_back(read_frame(*room, n));
            ASSERT_NE(held.back(), nullptr);
            buffers.insert(held.back()->samples.data());
        }
        EXPECT_EQ(read_frame(*room, 3), nullptr);
        EXPECT_EQ(room->use().frames_in_memory, 3u);
        EXPECT_EQ(room->use().bytes_in_memory, 3 * bytes);
    }
    EXPECT_EQ(buffers.size(), 3u);
    EXPECT_EQ(room->use().frames_elsewhere, 0u);
    EXPECT_EQ(room->use().frames_in_memory, 0u);
}

TEST_F(FrameRooms, a_frame_may_outlive_all_else_and_one_that_is_too_large_counts_like_any_other) {
    auto room = *FrameRoom::create(options_of(2));
    ASSERT_TRUE(room->take_place(at_once));
    Frame large;
    large.samples = room->lend();
    large.samples.assign(10 * bytes, std::byte{5});
    auto one = room->adopt(std::move(large));
    EXPECT_EQ(room->use().frames_elsewhere, 1u);
    auto other = read_frame(*room, 7);
    EXPECT_FALSE(room->take_place(at_once));
    room.reset();
    EXPECT_TRUE(shows(*other, 7));
}

TEST_F(FrameRooms, what_memory_does_not_hold_goes_to_the_disk_and_comes_back_as_it_was) {
    const auto spill = *SpillFile::create(folder, 0);
    const auto room = *FrameRoom::create(options_of(6, spill, 2));
    std::vector<std::shared_ptr<Frame>> held;
    for (int n = 0; n < 50; ++n) held.push_back(read_frame(*room, n));
    EXPECT_EQ(room->use().frames_in_memory, 3u)
        << "the fourth place is for the next to be read, two are for what is brought back";
    EXPECT_EQ(room->use().frames_on_disk, 47u);
    EXPECT_EQ(room->use().bytes_on_disk, 47 * bytes);
    for (int n = 0; n < 50; ++n) {
        const auto there = room->bring_back(held[size_t(n)]);
        ASSERT_TRUE(there.ok()) << there.error().message;
        EXPECT_TRUE(shows(**there, n)) << n;
        EXPECT_TRUE((*there)->samples.is_lent());
    }
    held.clear();
    EXPECT_EQ(room->use().frames_on_disk, 0u);
    EXPECT_EQ(room->use().frames_spilled, 47u);
    EXPECT_TRUE(std::filesystem::is_empty(folder)) << "nothing is left behind, however the process ends";
}

TEST_F(FrameRooms, a_disk_that_may_hold_so_much_holds_so_much_and_its_places_are_used_again) {
    const auto spill = *SpillFile::create(folder, 2 * bytes);
    const auto room = *FrameRoom::create(options_of(2, spill, 0));
    std::vector<std::shared_ptr<Frame>> held;
    for (int round = 0; round < 3; ++round) {
        for (int n = 0; n < 4; ++n) held.push_back(read_frame(*room, n));
        EXPECT_EQ(read_frame(*room, 4), nullptr);
        EXPECT_FALSE(room->waits_for_disk()) << "what fills it is developed too slowly";
        for (int n = 0; n < 4; ++n) EXPECT_TRUE(shows(**room->bring_back(held[size_t(n)]), n));
        held.clear();
    }
    EXPECT_EQ(spill->problem(), "");
}

TEST_F(FrameRooms, samples_that_the_disk_changed_are_never_handed_out) {
    const auto spill = *SpillFile::create(folder, 0);
    const auto room = *FrameRoom::create(options_of(1, spill, 0));
    const auto frame = read_frame(*room, 3);
    ASSERT_EQ(room->use().frames_on_disk, 1u);
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
        std::error_code none;
        if (std::filesystem::read_symlink(entry.path(), none).string().find(folder) == std::string::npos) continue;
        const int fd = std::stoi(entry.path().filename());
        ASSERT_EQ(pwrite(fd, "x", 1, 17), 1);
    }
    const auto there = room->bring_back(frame);
    ASSERT_FALSE(there.ok());
    EXPECT_NE(there.error().message.find("other samples than were written"), std::string::npos);
    EXPECT_EQ(spill->problem(), there.error().message);
    EXPECT_TRUE(room->waits_for_disk());
}

TEST_F(FrameRooms, a_full_disk_is_named_and_what_it_does_not_take_stays_in_memory) {
    const int code = on_small_disk(folder, 16 * 4096, [&] {
        const auto spill = *SpillFile::create(folder, 0);
        FrameRoom::Options options = options_of(3, spill, 0);
        options.frame_bytes = 4096;
        const auto room = *FrameRoom::create(options);
        std::vector<std::shared_ptr<Frame>> held;
        while (auto frame = read_frame(*room, int(held.size()))) held.push_back(std::move(frame));
        if (spill->problem().find("No space left") == std::string::npos || !room->waits_for_disk()) return 1;
        if (room->use().frames_in_memory != 3 || held.size() < 20) return 2;
        for (size_t n = 0; n < held.size(); ++n) {
            const auto there = room->bring_back(held[n]);
            if (!there.ok() || !shows(**there, int(n))) return 3;
        }
        return 0;
    });
    if (code == no_mount) GTEST_SKIP() << "mounting a small disk needs rights that are not given here";
    EXPECT_EQ(code, 0);
}

TEST_F(FrameRooms, memory_is_locked_as_the_kernel_counts_it) {
    const uint64_t before_kb = locked_kb();
    auto room = FrameRoom::create(options_of(1000));
    ASSERT_TRUE(room.ok());
    const uint64_t held_kb = 1000 * FrameRoom::bytes_a_frame(bytes) / 1024;
    if (!(*room)->use().is_locked) GTEST_SKIP() << "this machine lets nobody lock " << held_kb << " kB";
    EXPECT_GE(locked_kb(), before_kb + held_kb);
    room->reset();
    EXPECT_EQ(locked_kb(), before_kb);
}

TEST_F(FrameRooms, memory_that_is_not_there_is_an_error_before_the_take) {
    FrameRoom::Options options = options_of(1 << 20);
    options.frame_bytes = size_t(1) << 40;
    const auto room = FrameRoom::create(options);
    ASSERT_FALSE(room.ok());
    EXPECT_NE(room.error().message.find("--memory-mb"), std::string::npos);
    const auto spill = SpillFile::create("/proc/none", 0);
    ASSERT_FALSE(spill.ok());
    EXPECT_NE(spill.error().message.find("choose a folder"), std::string::npos);
}
