// SPDX-License-Identifier: MIT
// Takes whose developing is behind: every frame that has room comes out as if it had not been, and what has none is named.
// links: ols_take
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "played_take.hpp"
#include "small_disk.hpp"
#include "take/frame_rooms.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

constexpr int cycles = 12;

// An archive whose targets wait until they may be written.
class HeldSink : public ArchiveSink {
  public:
    explicit HeldSink(ArchiveWriter& archive) : ArchiveSink(archive) {}
    Status write_target(const Target& target) override {
        is_held.wait(true);
        return ArchiveSink::write_target(target);
    }
    void let_go() {
        is_held = false;
        is_held.notify_all();
    }
    std::atomic<bool> is_held = true;
};

std::string bytes_of_file(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

// Every file of two archives, but for times of day and of the run.
void expect_equal_targets(const std::filesystem::path& a, const std::filesystem::path& b) {
    int files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(a)) {
        if (entry.path().extension() != ".exr") continue;
        ++files;
        EXPECT_EQ(bytes_of_file(entry.path()), bytes_of_file(b / std::filesystem::relative(entry.path(), a)));
    }
    EXPECT_EQ(files, cycles);
}

class TakeMemories : public TakeDirectory {
  protected:
    // A take whose targets are not written before the camera has exposed everything.
    Result<TakeReport> run_held(const std::string& to, const TakeMemory& memory, bool drops = false) {
        auto archive = ArchiveWriter::create(to, take_info(156));
        EXPECT_TRUE(archive.ok());
        auto sink = std::make_shared<HeldSink>(*archive);
        PlayedCamera::Options options;
        options.drops = drops;
        PlayedCamera* camera = nullptr;
        // Frames are dropped because there is no room, and not because a thread of this machine had no processor.
        const auto has_room = [&] {
            const auto cameras = monitor.progress().record.cameras;
            return cameras.empty() || cameras[0].room.frames_in_memory < cameras[0].room.frames_max ||
                   (!memory.spill_folder.empty() && !cameras[0].room.disk_has_failed);
        };
        if (drops)
            options.before = [&](uint64_t) {
                while (camera->is_full() && has_room()) std::this_thread::yield();
            };
        PlayedTake take("single", cycles, options);
        camera = &take.camera;
        take.description.memory = memory;
        take.progress = [&](uint64_t decided, uint64_t total) {
            // All but the last target is identified although none is written.
            if (decided + take.description.sequence.slots.size() >= total) sink->let_go();
        };
        std::jthread last_resort([&](std::stop_token stop) {  // where frames are dropped nothing is decided any more
            while (!stop.stop_requested() && take.camera.exposed() < take.description.sequence.trigger_count())
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
            sink->let_go();
        });
        return take.run(sink, &monitor);
    }
    TakeMemory enough() const {
        const TakeDescription take = PlayedTake::describe("single", cycles);
        return {take.sequence.trigger_count() * 2 * FrameRoom::bytes_a_frame(take.stage.cameras[0].frame_bytes()), "",
                0};
    }
    void run_quick(const std::string& to) {
        auto archive = ArchiveWriter::create(to, take_info(156));
        ASSERT_TRUE(PlayedTake("single", cycles).run(*archive).ok());
    }

    TakeMonitor monitor;
};

}  // namespace

TEST_F(TakeMemories, a_take_in_memory_is_the_same_however_far_behind_developing_is) {
    run_quick(directory + "/quick.rfa");
    const auto report = run_held(path, enough());
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report->record.missing().total(), 0u) << report->record.missing().to_words();
    EXPECT_EQ(report->outputs[0].targets_written, cycles);
    EXPECT_EQ(monitor.progress().record.cameras[0].room.frames_elsewhere, 0u);
    expect_equal_targets(path, directory + "/quick.rfa");
}

TEST_F(TakeMemories, a_take_that_is_spilled_is_the_same) {
    run_quick(directory + "/quick.rfa");
    const auto report = run_held(path, {0, directory, 0});
    ASSERT_TRUE(report.ok()) << report.error().message;
    EXPECT_EQ(report->record.missing().total(), 0u) << report->record.missing().to_words();
    EXPECT_EQ(report->outputs[0].targets_written, cycles);
    EXPECT_GT(report->memory.frames_spilled, 500u);
    EXPECT_EQ(report->memory.problem, "");
    EXPECT_EQ(monitor.progress().record.cameras[0].room.frames_on_disk, 0u);
    EXPECT_EQ(monitor.progress().record.cameras[0].room.frames_elsewhere, 0u);
    expect_equal_targets(path, directory + "/quick.rfa");
}

TEST_F(TakeMemories, without_room_frames_are_dropped_and_what_was_waited_for_is_named) {
    const auto report = run_held(path, {}, true);
    ASSERT_TRUE(report.ok()) << report.error().message;
    // Whether developing or the disk is behind when the room is full is for the reader's own test: here it is both, in turn.
    const CauseCounts missing = report->record.missing();
    EXPECT_GT(missing.of(Cause::disk_was_late) + missing.of(Cause::host_was_late), 0u) << missing.to_words();
    EXPECT_GT(report->outputs[0].targets_written, 1);
    EXPECT_EQ(report->outputs[0].targets_written + report->outputs[0].targets_missing, cycles);
}

TEST_F(TakeMemories, a_spill_disk_that_is_full_loses_what_does_not_fit_and_says_so) {
    const std::string disk = directory + "/disk";
    std::filesystem::create_directory(disk);
    const int code = on_small_disk(disk, 40 * 4096, [&] {
        const auto report = run_held(path, {0, disk, 0}, true);
        if (!report.ok()) {
            std::fprintf(stderr, "%s\n", report.error().message.c_str());
            return 1;
        }
        if (report->memory.problem.find("No space left") == std::string::npos) return 2;
        if (report->memory.frames_spilled == 0) return 3;
        const CauseCounts missing = report->record.missing();
        if (missing.of(Cause::disk_was_late) == 0) return 4;
        const auto archive = ArchiveReader::open(path);
        if (!archive.ok() || !archive->finished() || !archive->verify().problems.empty()) return 5;
        if (!archive->info().extra.at("memory").at("problem").is_string()) return 6;
        return 0;
    });
    if (code == no_mount) GTEST_SKIP() << "mounting a small disk needs rights that are not given here";
    EXPECT_EQ(code, 0);
}

TEST_F(TakeMemories, memory_that_cannot_hold_what_developing_needs_at_once_is_refused_with_what_can) {
    TakeDescription take = PlayedTake::describe("single", cycles);
    take.memory.ram_bytes = 100'000;
    const auto rooms = make_frame_rooms(take, {});
    ASSERT_FALSE(rooms.ok());
    EXPECT_NE(rooms.error().message.find("or more (--memory-mb"), std::string::npos);
    take.memory.spill_folder = directory + "/none";
    const auto no_folder = make_frame_rooms(take, {});
    ASSERT_FALSE(no_folder.ok());
    EXPECT_NE(no_folder.error().message.find("none"), std::string::npos);
}
