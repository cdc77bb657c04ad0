// SPDX-License-Identifier: MIT
// What a stage asks of disks, and disks measured: nothing is left behind, bounds hold, figures are those of other programs.
// links: ols_doctor
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <csignal>

#include "doctor/disk_speed.hpp"
#include "image/disk_room.hpp"
#include "made_up_machine.hpp"
#include "steady_clock.hpp"

using namespace ols;

namespace {

class DisksOfAStage : public DoctorTest {
  protected:
    DisksOfAStage() {
        std::filesystem::create_directory(disk_);
        up.disk_s = 0.2;
    }
    static uint64_t df_free_bytes(const std::string& folder) {
        FILE* const pipe = popen(("df --block-size=1 --output=avail '" + folder + "' | tail -1").c_str(), "r");
        char line[64] = "";
        EXPECT_NE(std::fgets(line, sizeof line, pipe), nullptr);
        pclose(pipe);
        return std::strtoull(line, nullptr, 10);
    }
    size_t files_here() const {
        return size_t(std::distance(std::filesystem::recursive_directory_iterator(disk_), {}));
    }

    const std::string disk_ = folder_ / "disk";
};

// The paper's camera is 640 x 480 at 2160 frames/s: 1.33 GB/s.
TEST(NeedsOfAStage, are_those_of_the_papers_camera) {
    const StageConfig stage = default_stage();
    const auto sequence = compile_sequence(SequenceConfig{}, stage);
    ASSERT_TRUE(sequence.ok());
    const StageNeeds needs = needs_of(stage, *sequence, 10, 0, {100'000'000});
    EXPECT_NEAR(needs.raw_bytes_per_s(), 640 * 480 * 2 * 2160.0, 1e5);
    EXPECT_NEAR(needs.archive_bytes_per_s(), 1e8 * 2160 / double(sequence->slots.size()), 1e5);
    EXPECT_NEAR(needs_of(stage, *sequence, 10, 24, {100'000'000}).archive_bytes_per_s(), 2.4e9, 1);
}

TEST(NeedsOfAStage, count_each_camera_by_its_trigger_line_and_samples) {
    StageConfig stage = default_stage();
    stage.cameras[0].bits = 8;
    stage.cameras.push_back(stage.cameras[0]);
    stage.cameras[1].trigger = 1;
    stage.cameras[1].cfa = Cfa::rgb;
    const auto sequence = compile_sequence(SequenceConfig{}, stage);
    ASSERT_TRUE(sequence.ok());
    const StageNeeds needs = needs_of(stage, *sequence, 1, 0, {1, 1});
    EXPECT_EQ(needs.cameras[0].link_frame_bytes, 640u * 480);
    EXPECT_EQ(needs.cameras[1].link_frame_bytes, 640u * 480 * 3);
    EXPECT_EQ(needs.cameras[1].frame_bytes, 3 * needs.cameras[0].frame_bytes);
    EXPECT_NEAR(needs.cameras[1].frames_per_s, 2160, 1);
    stage.cameras[1].trigger = 3;  // a line that this program, made for another stage, does not fire
    EXPECT_EQ(needs_of(stage, *sequence, 1, 0, {1, 1}).cameras[1].frames_per_s, 0);
}

TEST_F(DisksOfAStage, are_skipped_without_folders_and_in_a_hurry) {
    for (const Finding& finding : check_disks(up)) EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.found;
    up.takes_folder = disk_;
    up.is_quick = true;
    for (const Finding& finding : check_disks(up))
        if (finding.check != Check::disk_space) {
            EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.found;
        }
}

TEST_F(DisksOfAStage, have_the_room_that_df_sees) {
    const auto room = room_of(disk_);
    ASSERT_TRUE(room.ok());
    EXPECT_NEAR(double(room->free_bytes), double(df_free_bytes(disk_)), 64e6);  // others write meanwhile
    EXPECT_FALSE(room_of("/no/such/folder").ok());
    EXPECT_FALSE(room_of("/proc/self/status").ok());
}

TEST_F(DisksOfAStage, fail_without_room_or_folder) {
    give_camera("fake:10", 10);
    up.is_quick = true;
    up.takes_folder = disk_;
    const auto of_takes = [this] {
        for (const Finding& finding : check_disks(up))
            if (finding.check == Check::disk_space && finding.subject == up.takes_folder) return finding;
        return Finding{};
    };
    EXPECT_EQ(of_takes().verdict, CheckVerdict::ok);
    up.needs.take_s = 1e9;
    EXPECT_EQ(of_takes().verdict, CheckVerdict::fail);
    up.takes_folder = "/no/such/folder";
    EXPECT_EQ(of_takes().verdict, CheckVerdict::fail);
    EXPECT_NE(of_takes().commands[0].find("/no/such/folder"), std::string::npos);
}

TEST_F(DisksOfAStage, in_memory_are_no_disks) {
    if (!room_of("/dev/shm").ok() || !room_of("/dev/shm")->is_memory) GTEST_SKIP() << "/dev/shm is no tmpfs here";
    give_camera("fake:10", 0.001);
    up.spill_folder = "/dev/shm";
    for (const Finding& finding : check_disks(up)) {
        if (finding.subject != "/dev/shm") continue;
        EXPECT_EQ(finding.verdict, finding.check == Check::disk_space ? CheckVerdict::warn : CheckVerdict::skipped)
            << finding.found;
        EXPECT_NE(finding.found.find("memory"), std::string::npos);
    }
}

TEST_F(DisksOfAStage, are_judged_by_what_the_stage_asks_for) {
    give_camera("fake:10", 0.001);  // kilobytes a second
    up.needs.targets_per_s = 0.001;
    up.takes_folder = up.spill_folder = disk_;
    const auto verdict_of = [this](Check check) {
        CheckVerdict worst = CheckVerdict::skipped;
        for (const Finding& finding : check_disks(up))
            if (finding.check == check && finding.verdict != CheckVerdict::skipped) worst = finding.verdict;
        return worst;
    };
    EXPECT_EQ(verdict_of(Check::disk_write), CheckVerdict::ok);
    up.needs.cameras[0].frames_per_s = 1e7;  // 20 TB/s
    EXPECT_EQ(verdict_of(Check::disk_write), CheckVerdict::warn);
    for (const Finding& finding : check_disks(up))
        if (finding.check == Check::disk_write) {
            EXPECT_NE(finding.found.find(": a take of 10 s takes "), std::string::npos) << finding.found;
        }
    EXPECT_EQ(files_here(), 0u);
}

TEST_F(DisksOfAStage, are_measured_within_bounds_and_nothing_stays) {
    uint64_t last = 0, calls = 0;
    DiskSpeedOptions options;
    options.seconds_max = 0.3;
    options.bytes_max = 64 << 20;
    options.progress = [&](uint64_t done, uint64_t) {
        last = done;
        ++calls;
    };
    const uint64_t begin_ns = steady_ns();
    const auto speed = measure_disk(disk_, options);
    const double took_s = double(steady_ns() - begin_ns) * 1e-9;
    ASSERT_TRUE(speed.ok()) << speed.error().message;
    EXPECT_LE(speed->bytes, options.bytes_max);
    EXPECT_NEAR(speed->write_bytes_per_s, double(speed->bytes) / speed->write_s, 1);
    EXPECT_LE(speed->write_s, took_s);
    EXPECT_GE(took_s, speed->write_s + (speed->read_bytes_per_s ? 1e-4 : 0));
    EXPECT_GT(calls, 1u);
    EXPECT_EQ(last, 1u);
    EXPECT_EQ(files_here(), 0u);
}

TEST_F(DisksOfAStage, are_read_only_where_it_matters) {
    DiskSpeedOptions options;
    options.seconds_max = 0.1;
    options.is_read = false;
    const auto speed = measure_disk(disk_, options);
    ASSERT_TRUE(speed.ok()) << speed.error().message;
    EXPECT_FALSE(speed->read_bytes_per_s);
}

// Whatever happens in the middle of it: killed, or at a limit of sizes.
TEST_F(DisksOfAStage, are_clean_after_a_program_that_was_killed) {
    const pid_t child = fork();
    if (child == 0) {
        DiskSpeedOptions options;
        options.seconds_max = 60;
        options.progress = [](uint64_t, uint64_t) { raise(SIGKILL); };
        (void)measure_disk(disk_, options);
        _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(files_here(), 0u);
}

TEST_F(DisksOfAStage, that_cannot_be_written_fail_with_what_to_do) {
    const pid_t child = fork();
    if (child == 0) {
        std::signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{1 << 20, 1 << 20};
        setrlimit(RLIMIT_FSIZE, &limit);
        give_camera("fake:10", 1);
        up.takes_folder = disk_;
        int code = 1;
        for (const Finding& finding : check_disks(up))
            if (finding.check == Check::disk_write && finding.verdict == CheckVerdict::fail &&
                !finding.commands.empty() && finding.found.find("cannot write a file") != std::string::npos)
                code = 0;
        _exit(code);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
}

}  // namespace
