// SPDX-License-Identifier: MIT
// doctor's checks of processor, memory, limits and clocks, against made-up kernels; and what it reads of this one, against other
// programs that read the same.
// links: ols_doctor
#include "doctor/check_up.hpp"
#include "made_up_machine.hpp"

using namespace ols;

namespace {

class MachineOfAShoot : public DoctorTest {
  protected:
    void put_memory(uint64_t available_kib, uint64_t swap_kib, uint64_t swap_free_kib) {
        put("/proc/meminfo", "MemTotal:       32000000 kB\nMemAvailable:   " + std::to_string(available_kib) +
                                 " kB\nSwapTotal:      " + std::to_string(swap_kib) +
                                 " kB\nSwapFree:       " + std::to_string(swap_free_kib) + " kB\n");
    }
    void put_governor(int core, const std::string& governor) {
        put("/sys/devices/system/cpu/cpu" + std::to_string(core) + "/cpufreq/scaling_governor", governor + "\n");
    }
};

TEST_F(MachineOfAShoot, that_shows_nothing_is_not_well) {
    std::filesystem::remove(machine.place("/proc/self/status"));
    machine.clock.reset();
    for (const auto family : {check_processor, check_memory, check_clock})
        for (const Finding& finding : family(up)) EXPECT_EQ(finding.verdict, CheckVerdict::skipped) << finding.id();
}

TEST_F(MachineOfAShoot, has_every_core_at_full_clock) {
    put_governor(0, "performance");
    put_governor(1, "performance");
    expect(check_processor(up), Check::governor, CheckVerdict::ok, "performance on 2 cores");
    put_governor(1, "schedutil");
    const Findings findings = check_processor(up);
    expect(findings, Check::governor, CheckVerdict::warn, "schedutil on 1 core");
    EXPECT_NE(only(findings, Check::governor).commands[0].find("/etc/tmpfiles.d/"), std::string::npos);
}

TEST_F(MachineOfAShoot, has_a_core_for_each_reader_and_one_more) {
    give_camera("fake:100", 1);
    give_camera("fake:101", 1);
    expect(check_processor(up), Check::cores, CheckVerdict::ok, "4 cores");
    for (const auto& [list, count] : std::map<std::string, std::string>{{"1", "1"}, {"0,2", "2"}}) {
        cores = list;
        be_user("1000", "1000", 0);
        expect(check_processor(up), Check::cores, CheckVerdict::warn, count + " core");
    }
    cores = "0-1,3";
    be_user("1000", "1000", 0);
    expect(check_processor(up), Check::cores, CheckVerdict::ok, "3 cores");
}

TEST_F(MachineOfAShoot, may_have_enough_files_open) {
    give_camera("fake:100", 1);
    put_limit("Max open files", "320");
    expect(check_processor(up), Check::open_files, CheckVerdict::ok, "320 files");
    put_limit("Max open files", "319");
    expect(check_processor(up), Check::open_files, CheckVerdict::fail, "319 files");
    put_limit("Max open files", "unlimited");
    expect(check_processor(up), Check::open_files, CheckVerdict::ok, "no limit");
}

// 2 MB a frame, 10 frames/s: 8 MB of the four that are held, 200 MB in 10 s.
TEST_F(MachineOfAShoot, has_memory_for_the_frames_that_wait) {
    give_camera("fake:10", 10);
    put_memory(7'812, 0, 0);
    expect(check_memory(up), Check::memory_free, CheckVerdict::fail, "8 MB free");
    put_memory(7'813, 0, 0);
    expect(check_memory(up), Check::memory_free, CheckVerdict::warn, "0.4 s of frames");
    put_memory(195'313, 0, 0);
    expect(check_memory(up), Check::memory_free, CheckVerdict::ok, "200 MB free");
}

TEST_F(MachineOfAShoot, locks_what_could_be_swapped_out) {
    give_camera("fake:10", 10);
    put_memory(1'000'000, 1'000'000, 1'000'000);
    put_limit("Max locked memory", "7999999");
    expect(check_memory(up), Check::memory_lock, CheckVerdict::warn);
    be_user("1000", "1000", uint64_t(1) << 14);
    expect(check_memory(up), Check::memory_lock, CheckVerdict::ok, "CAP_IPC_LOCK");
    be_user("1000", "1000", 0);
    put_memory(1'000'000, 0, 0);
    expect(check_memory(up), Check::memory_lock, CheckVerdict::ok, "no swap");
    put_memory(1'000'000, 1'000'000, 1'000'000);
    put_limit("Max locked memory", "8000000");
    expect(check_memory(up), Check::memory_lock, CheckVerdict::ok);
}

TEST_F(MachineOfAShoot, has_nothing_swapped_out) {
    put_memory(1'000'000, 2'000'000, 2'000'000);
    expect(check_memory(up), Check::memory_swap, CheckVerdict::ok);
    put_memory(1'000'000, 2'000'000, 1'999'999);
    expect(check_memory(up), Check::memory_swap, CheckVerdict::warn, "in use");
}

TEST_F(MachineOfAShoot, reads_its_clock_in_the_processor) {
    const std::string file = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    for (const auto& [source, verdict] : std::map<std::string, CheckVerdict>{{"tsc", CheckVerdict::ok},
                                                                             {"kvm-clock", CheckVerdict::ok},
                                                                             {"arch_sys_counter", CheckVerdict::ok},
                                                                             {"hpet", CheckVerdict::warn},
                                                                             {"acpi_pm", CheckVerdict::warn},
                                                                             {"jiffies", CheckVerdict::warn}}) {
        put(file, source + "\n");
        expect(check_clock(up), Check::clock_source, verdict, source);
    }
}

TEST_F(MachineOfAShoot, has_the_right_time) {
    expect(check_clock(up), Check::clock_synchronised, CheckVerdict::ok, "0.02 s");
    machine.clock = WallClock{false, 16};
    expect(check_clock(up), Check::clock_synchronised, CheckVerdict::warn);
}

std::string output_of(const std::string& command) {
    std::string text;
    FILE* const pipe = popen((command + " 2>/dev/null").c_str(), "r");
    char buffer[256];
    while (pipe && std::fgets(buffer, sizeof buffer, pipe)) text += buffer;
    if (pipe) pclose(pipe);
    if (text.ends_with('\n')) text.pop_back();
    return text;
}

TEST(ThisMachine, is_read_as_other_programs_read_it) {
    const Machine here;
    EXPECT_EQ(here.user(), output_of("id -un"));
    EXPECT_EQ(here.is_root(), output_of("id -u") == "0");
    for (const std::string& group : here.groups())
        EXPECT_NE((" " + output_of("id -Gn") + " ").find(" " + group + " "), std::string::npos) << group;
    const auto files = here.limit("Max open files");
    ASSERT_TRUE(files);
    EXPECT_EQ(std::to_string(files->soft), output_of("ulimit -n"));
    // `ulimit -l` of dash and bash is in KiB.
    const auto lock = here.limit("Max locked memory");
    ASSERT_TRUE(lock);
    EXPECT_EQ(lock->soft == Limit::none ? "unlimited" : std::to_string(lock->soft / 1024), output_of("ulimit -l"));
    EXPECT_EQ(std::to_string(here.memory_bytes("MemTotal").value_or(0) / 1024),
              output_of("free -k | awk '/^Mem/{print $2}'"));
    const std::string cores = output_of("nproc");
    CheckUp up = plain_check_up(here);
    for (const Finding& finding : check_processor(up))
        if (finding.check == Check::cores) {
            EXPECT_EQ(finding.found.substr(0, finding.found.find(' ')), cores);
        }
}

TEST(ThisMachine, has_the_clock_that_timedatectl_sees) {
    const std::string said = output_of("timedatectl show --property=NTPSynchronized --value");
    if (said.empty()) GTEST_SKIP() << "no timedated";
    const auto clock = Machine().wall_clock();
    ASSERT_TRUE(clock);
    EXPECT_EQ(clock->is_synchronised ? "yes" : "no", said);
}

TEST(FindingsTogether, give_the_exit_code_of_the_worst) {
    const auto with = [](CheckVerdict verdict) { return Finding{Check::mtu, "", verdict, "", "", {}}; };
    EXPECT_EQ(exit_code_of({}), 0);
    EXPECT_EQ(exit_code_of({with(CheckVerdict::ok), with(CheckVerdict::skipped)}), 0);
    EXPECT_EQ(exit_code_of({with(CheckVerdict::warn), with(CheckVerdict::ok)}), 2);
    EXPECT_EQ(exit_code_of({with(CheckVerdict::warn), with(CheckVerdict::fail)}), 1);
}

TEST(FiguresOfFindings, are_decimal_with_three_digits) {
    for (const auto& [bytes, text] : std::map<double, std::string>{{0, "0 bytes"},
                                                                   {999, "999 bytes"},
                                                                   {1000, "1 kB"},
                                                                   {53'084'160, "53.1 MB"},
                                                                   {1.327e9, "1.33 GB"},
                                                                   {9.996e5, "1 MB"}})
        EXPECT_EQ(bytes_text(bytes), text);
}

TEST(CommandsOfFindings, write_the_lines_that_they_say) {
    const std::string command = write_file_command("FILE", {"one = 1", "two 2"});
    EXPECT_EQ(command, "printf 'one = 1\\ntwo 2\\n' | sudo tee FILE");
    EXPECT_EQ(output_of(command.substr(0, command.find('|'))), "one = 1\ntwo 2");
}

}  // namespace
