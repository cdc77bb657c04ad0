// SPDX-License-Identifier: MIT
// Archives that take another's place: the old one stays until the new one has something, and a writer is alone.
// links: ols_archive
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include <fstream>

#include "archive/archive_place.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

std::vector<std::string> synced;  // files and folders, by the last part of their names

std::vector<std::string> entries_of(const std::string& folder) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
}

// A child that makes an archive, tells, and then waits to be killed.
class OtherWriter {
  public:
    OtherWriter(const std::string& path, bool takes_place) {
        int told[2];
        EXPECT_EQ(pipe(told), 0);
        pid_ = fork();
        if (pid_ == 0) {
            auto writer = ArchiveWriter::create_beside(path, take_info(2), true);
            if (writer.ok() && takes_place) (void)writer->take_place();
            if (writer.ok() && write(told[1], "", 1) == 1) pause();
            _exit(1);
        }
        close(told[1]);
        char byte;
        EXPECT_EQ(read(told[0], &byte, 1), 1) << "the other writer failed";
        close(told[0]);
    }
    ~OtherWriter() { kill_it(); }
    void kill_it() {
        if (pid_ <= 0) return;
        kill(pid_, SIGKILL);
        waitpid(pid_, nullptr, 0);
        pid_ = 0;
    }

  private:
    pid_t pid_ = 0;
};

}  // namespace

// Stands before the C library's: what is synced, in which order.
extern "C" int fsync(int fd) {
    std::error_code error;
    synced.push_back(std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd), error).filename().string());
    return int(syscall(SYS_fsync, fd));
}

class ArchivePlaces : public TakeDirectory {
  protected:
    void write_old_take() {
        auto old = ArchiveWriter::create(path, take_info(2));
        ASSERT_TRUE(old->write_target(numbered_target(2, 16, 16, Cfa::rggb, 5)).ok());
        ASSERT_TRUE(old->finish().ok());
    }
    bool old_take_is_whole() {
        const auto reader = ArchiveReader::open(path);
        return reader.ok() && reader->verify().problems.empty() && reader->read_target(0, 5).ok();
    }
};

TEST_F(ArchivePlaces, an_overwritten_take_stays_whole_until_the_new_one_takes_its_place) {
    write_old_take();
    auto fresh = ArchiveWriter::create_beside(path, take_info(3), true);
    ASSERT_TRUE(fresh.ok()) << fresh.error().message;
    EXPECT_TRUE(old_take_is_whole());
    ASSERT_TRUE(fresh->take_place().ok());
    EXPECT_EQ(fresh->folder(), path);
    EXPECT_EQ(entries_of(directory), std::vector<std::string>{"take.rfa"});
    ASSERT_TRUE(fresh->write_target(numbered_target(3, 16, 16, Cfa::rggb, 0)).ok());
    ASSERT_TRUE(fresh->finish().ok());
    const auto reader = ArchiveReader::open(path);
    EXPECT_EQ(reader->info().lights.size(), 3u);
    EXPECT_EQ(reader->verify().intact.size(), 1u);
    EXPECT_TRUE(reader->verify().problems.empty());
}

TEST_F(ArchivePlaces, a_take_that_never_begins_leaves_the_old_one_and_nothing_else) {
    write_old_take();
    { const auto fresh = ArchiveWriter::create_beside(path, take_info(3), true); }
    EXPECT_TRUE(old_take_is_whole());
    EXPECT_EQ(entries_of(directory), std::vector<std::string>{"take.rfa"});
    std::filesystem::remove_all(path);
    { const auto fresh = ArchiveWriter::create_beside(path, take_info(3), false); }
    EXPECT_TRUE(entries_of(directory).empty());
}

TEST_F(ArchivePlaces, a_writer_killed_before_its_first_frame_blocks_no_later_one) {
    write_old_take();
    { OtherWriter other(path, false); }
    EXPECT_EQ(entries_of(directory).size(), 2u);
    EXPECT_TRUE(old_take_is_whole());
    // It may have died while it wrote any of its files.
    for (const char* half_written : {"lights.lp.part4711-2", "manifest.json.part", "lights.lp.part12-0"})
        std::ofstream(directory + "/.take.rfa.recording/" + half_written) << "half";
    auto next = ArchiveWriter::create(path, take_info(3), true);
    ASSERT_TRUE(next.ok()) << next.error().message;
    EXPECT_EQ(entries_of(directory), std::vector<std::string>{"take.rfa"});
}

TEST_F(ArchivePlaces, nobody_writes_into_or_over_an_archive_that_is_being_written) {
    for (const bool takes_place : {false, true}) {
        std::filesystem::remove_all(path);
        OtherWriter other(path, takes_place);
        for (const bool overwrite : {true, false}) {
            const auto second = ArchiveWriter::create_beside(path, take_info(1), overwrite);
            ASSERT_FALSE(second.ok());
            const std::string& message = second.error().message;
            EXPECT_TRUE(message.find("being recorded") != std::string::npos || !overwrite) << message;
        }
        if (takes_place) {
            const auto problems = ArchiveReader::open(path)->verify().problems;
            ASSERT_EQ(problems.size(), 1u);
            EXPECT_NE(problems[0].find("goes on"), std::string::npos) << problems[0];
        }
        other.kill_it();
        EXPECT_TRUE(ArchiveWriter::create(path, take_info(1), true).ok());
    }
}

TEST_F(ArchivePlaces, a_file_that_is_no_archives_is_kept_and_named_before_anything_is_recorded) {
    write_old_take();
    std::ofstream(path + "/notes.txt") << "mine";
    const auto refused = ArchiveWriter::create_beside(path, take_info(1), true);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("notes.txt"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(path + "/notes.txt"));
}

TEST_F(ArchivePlaces, a_folder_that_came_in_the_place_of_the_old_take_is_kept_and_so_are_files_that_came_into_it) {
    for (const bool is_other_folder : {true, false}) {
        std::filesystem::remove_all(directory + "/.take.rfa.recording");
        std::filesystem::remove_all(path);
        write_old_take();
        auto fresh = ArchiveWriter::create_beside(path, take_info(3), true);
        ASSERT_TRUE(fresh.ok()) << fresh.error().message;
        if (is_other_folder) {
            std::filesystem::rename(path, path + ".moved");
            std::filesystem::create_directory(path);
        }
        std::ofstream(path + "/mine") << "mine";
        const auto placed = fresh->take_place();
        ASSERT_FALSE(placed.ok());
        EXPECT_NE(placed.error().message.find(".take.rfa.recording"), std::string::npos) << placed.error().message;
        EXPECT_TRUE(std::filesystem::exists(directory + "/.take.rfa.recording/mine"));
        EXPECT_EQ(fresh->folder(), path);
        EXPECT_TRUE(fresh->finish().ok());
    }
}

TEST_F(ArchivePlaces, targets_that_were_left_beside_are_not_emptied_away_by_an_overwrite) {
    write_old_take();
    std::filesystem::create_directories(directory + "/.take.rfa.recording/cam0");
    std::ofstream(directory + "/.take.rfa.recording/cam0/target_000000.exr") << "a target";
    const auto refused = ArchiveWriter::create_beside(path, take_info(3), true);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("rename it to keep them"), std::string::npos) << refused.error().message;
    EXPECT_TRUE(std::filesystem::exists(directory + "/.take.rfa.recording/cam0/target_000000.exr"));
    EXPECT_TRUE(old_take_is_whole());
}

TEST_F(ArchivePlaces, a_recording_whose_name_was_taken_meanwhile_stays_beside_and_is_finished_there) {
    auto writer = ArchiveWriter::create_beside(path, take_info(2), false);
    std::filesystem::create_directory(path);
    std::ofstream(path + "/mine") << "mine";
    EXPECT_FALSE(writer->take_place().ok());
    EXPECT_TRUE(writer->write_target(numbered_target(2, 16, 16, Cfa::rggb, 0)).ok());
    EXPECT_FALSE(writer->finish().ok());  // tells again where it is
    const auto reader = ArchiveReader::open(writer->folder());
    EXPECT_TRUE(reader->finished());
    EXPECT_TRUE(reader->verify().problems.empty());
    EXPECT_TRUE(std::filesystem::exists(path + "/mine"));
}

TEST_F(ArchivePlaces, the_lamps_are_on_the_disk_before_the_journal_vouches_for_them) {
    synced.clear();
    ASSERT_TRUE(ArchiveWriter::create(path, take_info(2)).ok());
    // Under whatever name it has before it is renamed.
    const auto lights = std::ranges::find_if(synced, [](const auto& name) { return name.starts_with("lights.lp"); });
    const auto journal = std::find(synced.begin(), synced.end(), "journal.jsonl");
    ASSERT_NE(lights, synced.end());
    EXPECT_LT(lights, journal);
    ASSERT_NE(journal, synced.end());
}
