// SPDX-License-Identifier: MIT
// Nothing is lost (rule 5): writers that are killed, and disks that are full, at any moment.
// links: ols_archive
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <random>

#include "archive/archive.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

// Runs `work` in a child process; its return value is the exit status.
pid_t in_child(const std::function<int()>& work) {
    const pid_t pid = fork();
    if (pid == 0) _exit(work());
    return pid;
}

int exit_status(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// No file may grow beyond this: a disk that is full, without a disk. The write fails with EFBIG instead of a signal.
void limit_file_size(rlim_t bytes) {
    signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, RLIM_INFINITY};
    setrlimit(RLIMIT_FSIZE, &limit);
}

bool names_an_interruption(const std::string& problem) {
    for (const char* what : {"was not finished", "is torn", "has no end"})
        if (problem.find(what) != std::string::npos) return true;
    return false;
}

std::string joined(const std::vector<std::string>& lines) {
    std::string text;
    for (const auto& line : lines) text += line + "\n";
    return text;
}

}  // namespace

class ArchiveCrash : public TakeDirectory {};

// The child tells through a pipe, after each target, that it was written. Whatever it told must be there, whole.
TEST_F(ArchiveCrash, fifty_writers_killed_at_random_moments_keep_every_target_they_finished) {
    std::mt19937 random(20260101);
    std::uniform_int_distribution<useconds_t> delay_us(0, 30000);
    int finished_targets = 0, interrupted_targets = 0;
    for (int round = 0; round < 50; ++round) {
        std::filesystem::remove_all(path);
        int told[2];
        ASSERT_EQ(pipe(told), 0);
        const pid_t pid = in_child([&] {
            auto writer = ArchiveWriter::create(path, take_info(3));
            for (uint32_t n = 0;; ++n) {
                if (!writer->write_target(numbered_target(3, 96, 80, Cfa::rggb, n))) return 1;
                if (write(told[1], "", 1) != 1) return 2;
            }
        });
        close(told[1]);
        // Up to three targets on, then at any moment.
        char buffer[4096];
        ssize_t reported = 0;
        for (; reported < round % 4; ++reported) ASSERT_EQ(read(told[0], buffer, 1), 1) << "the writer failed";
        usleep(delay_us(random));
        kill(pid, SIGKILL);
        exit_status(pid);
        reported += read(told[0], buffer, sizeof buffer);
        close(told[0]);

        const auto reader = ArchiveReader::open(path);
        if (!reader) {
            EXPECT_EQ(reported, 0) << reader.error().message;
            EXPECT_FALSE(std::filesystem::exists(path + "/journal.jsonl")) << reader.error().message;
            continue;
        }
        const auto found = reader->verify();
        EXPECT_FALSE(reader->finished());
        EXPECT_GE(std::ssize(found.intact), reported);
        EXPECT_EQ(found.intact.size(), reader->targets().size()) << joined(found.problems);
        for (const auto& problem : found.problems) EXPECT_TRUE(names_an_interruption(problem)) << problem;
        for (const auto& entry : reader->targets()) {
            const auto target = reader->read_target(0, entry.index);
            ASSERT_TRUE(target.ok()) << target.error().message;
            EXPECT_EQ(target->lamps, numbered_target(3, 96, 80, Cfa::rggb, entry.index).lamps);
        }
        finished_targets += int(found.intact.size());
        interrupted_targets += found.problems.size() > 1;
    }
    EXPECT_GE(finished_targets, 12 * (1 + 2 + 3));
    EXPECT_GT(interrupted_targets, 5);  // else no kill came while a target was being written
}

TEST_F(ArchiveCrash, a_full_disk_names_itself_and_the_writer_goes_on_when_there_is_space) {
    const auto child = [&]() -> int {
        auto writer = ArchiveWriter::create(path, take_info(4));
        if (!writer->write_target(numbered_target(4, 64, 64, Cfa::rggb, 0))) return 1;
        // 4 lamps x 2 bytes x 300 x 300 do not fit; the limit strikes at different places of the file.
        for (const rlim_t limit : {100, 3000, 100'000, 720'000}) {
            limit_file_size(limit);
            const auto written = writer->write_target(numbered_target(4, 300, 300, Cfa::rggb, 1));
            if (written.ok() || written.error().message.find("ulimit") == std::string::npos) return 2;
            if (written.error().message.find("target_000001.exr") == std::string::npos) return 3;
        }
        limit_file_size(RLIM_INFINITY);
        if (!writer->write_target(numbered_target(4, 300, 300, Cfa::rggb, 1))) return 4;
        return writer->finish().ok() ? 0 : 5;
    };
    ASSERT_EQ(exit_status(in_child(child)), 0);
    const auto reader = ArchiveReader::open(path);
    const auto found = reader->verify();
    EXPECT_EQ(found.intact.size(), 2u);
    EXPECT_EQ(joined(found.problems), "");
    EXPECT_EQ(reader->read_target(0, 1)->lamps, numbered_target(4, 300, 300, Cfa::rggb, 1).lamps);
}

TEST_F(ArchiveCrash, a_journal_line_that_does_not_fit_is_taken_back_and_made_up_for_in_short_or_at_the_end) {
    const auto child = [&]() -> int {
        auto writer = ArchiveWriter::create(path, take_info(1));
        if (!writer->write_target(numbered_target(1, 8, 8, Cfa::none, 0))) return 1;
        limit_file_size(8000);
        if (!writer->note_missing_target(0, 1, std::string(20000, 'x'))) return 2;
        // Now not even that fits.
        limit_file_size(std::filesystem::file_size(path + "/journal.jsonl") + 20);
        const auto noted = writer->note_missing_target(0, 2, "a short reason");
        if (noted.ok() || noted.error().message.find("journal.jsonl") == std::string::npos) return 3;
        limit_file_size(RLIM_INFINITY);
        return writer->finish().ok() ? 0 : 4;
    };
    ASSERT_EQ(exit_status(in_child(child)), 0);
    const auto reader = ArchiveReader::open(path);
    EXPECT_EQ(joined(reader->verify().problems), "");
    ASSERT_EQ(reader->targets().size(), 3u);
    EXPECT_EQ(reader->targets()[1].why_missing, std::string(160, 'x'));
    EXPECT_EQ(reader->targets()[2].why_missing, "a short reason");
    EXPECT_EQ(reader->manifest()["targets"]["missing"][0]["why"], std::string(160, 'x'));
}

TEST_F(ArchiveCrash, an_archive_that_cannot_be_begun_leaves_no_directory) {
    const auto child = [&]() -> int {
        limit_file_size(100);
        const auto writer = ArchiveWriter::create(path, take_info(156));
        return !writer.ok() && writer.error().message.find("lights.lp") != std::string::npos ? 0 : 1;
    };
    EXPECT_EQ(exit_status(in_child(child)), 0);
    EXPECT_FALSE(std::filesystem::exists(path));
}
