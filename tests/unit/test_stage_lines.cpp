// SPDX-License-Identifier: MIT
// The stage's lines over a chip that a test holds: what stops a take, what begins it, and which edges are known to be lost.
// links: ols_device
#include "device/stage_lines.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <random>

#include "comes_true.hpp"
#include "steady_clock.hpp"

using namespace ols;
using namespace ols::test;
using namespace std::chrono_literals;

namespace {

// What the test moves; inputs in the order arm, emergency stop, genlock as far as they are there.
struct Chip {
    std::mutex mutex;
    std::condition_variable moved;
    std::vector<GpioEdge> waiting;
    std::vector<bool> levels;
    std::vector<bool> tally_was;  // every value it was set to
    bool is_gone = false;
    uint64_t waits = 0;

    void move(size_t input, bool active, bool with_edge = true, uint64_t time_ns = steady_ns()) {
        const std::lock_guard lock(mutex);
        levels[input] = active;
        if (with_edge) waiting.push_back({input, active, time_ns});
        moved.notify_all();
    }
    // Away from its level and back, at once: a watcher that is late sees both edges together.
    void glitch(size_t input, uint64_t begin_ns, uint64_t length_ns) {
        const std::lock_guard lock(mutex);
        waiting.push_back({input, !levels[input], begin_ns});
        waiting.push_back({input, levels[input], begin_ns + length_ns});
        moved.notify_all();
    }
    void unbind() {
        const std::lock_guard lock(mutex);
        is_gone = true;
        moved.notify_all();
    }
    bool tally() {
        const std::lock_guard lock(mutex);
        return !tally_was.empty() && tally_was.back();
    }
    // Until the watcher has looked at everything that has happened so far.
    void settle() {
        uint64_t before;
        {
            const std::lock_guard lock(mutex);
            before = waits;
        }
        ASSERT_TRUE(comes_true([&] {
            const std::lock_guard lock(mutex);
            return waits >= before + 4;
        }));
    }
};

class FakeGpio : public GpioLines {
  public:
    explicit FakeGpio(Chip& chip) : chip_(chip) {}
    std::string name() const override { return "the GPIO chip 'fake'"; }

    Result<std::vector<GpioEdge>> wait(int timeout_ms) override {
        std::unique_lock lock(chip_.mutex);
        ++chip_.waits;
        chip_.moved.wait_for(lock, std::chrono::milliseconds(timeout_ms),
                             [&] { return chip_.is_gone || !chip_.waiting.empty(); });
        if (chip_.is_gone) return gone();
        return std::exchange(chip_.waiting, {});
    }
    Result<std::vector<bool>> levels() override {
        const std::lock_guard lock(chip_.mutex);
        if (chip_.is_gone) return gone();
        return chip_.levels;
    }
    Status set(size_t, bool active) override {
        const std::lock_guard lock(chip_.mutex);
        if (chip_.is_gone) return gone();
        chip_.tally_was.push_back(active);
        return Done{};
    }

  private:
    static Error gone() { return fail("the GPIO chip 'fake' has gone"); }
    Chip& chip_;
};

GpioLineSetup line(const std::string& name, int debounce_ms = 0) {
    GpioLineSetup setup;
    setup.line = name;
    setup.debounce_ms = debounce_ms;
    return setup;
}

class StageLinesTest : public testing::Test {
  protected:
    StageLinesTest() {
        setup_.chip = "fake";
        setup_.arm = line("ARM", 20);
        setup_.emergency_stop = line("ESTOP");
        setup_.genlock = line("GENLOCK", 30);
        setup_.tally = line("TALLY");
        chip_.levels = {false, false, true};
    }
    ~StageLinesTest() override { lines_.reset(); }

    StageLines& lines() {
        if (!lines_)
            lines_ =
                std::make_unique<StageLines>(std::make_unique<FakeGpio>(chip_), setup_, [&](const std::string& why) {
                    const std::lock_guard lock(mutex_);
                    reasons_.push_back(why);
                });
        return *lines_;
    }
    std::vector<std::string> reasons() {
        const std::lock_guard lock(mutex_);
        return reasons_;
    }
    void expect_stop(const std::vector<std::string>& words) {
        ASSERT_TRUE(comes_true([&] { return !reasons().empty(); }));
        for (const std::string& word : words) EXPECT_NE(reasons()[0].find(word), std::string::npos) << reasons()[0];
        EXPECT_EQ(reasons().size(), 1u);
    }

    enum { arm, estop, genlock };
    Chip chip_;
    GpioSetup setup_;
    std::atomic<bool> stop_ = false;
    std::mutex mutex_;
    std::vector<std::string> reasons_;
    std::unique_ptr<StageLines> lines_;
};

TEST_F(StageLinesTest, the_tally_is_lit_from_the_begin_of_a_take_to_its_end) {
    lines();
    EXPECT_FALSE(chip_.tally());
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    EXPECT_TRUE(chip_.tally());
    lines().end_take();
    EXPECT_FALSE(chip_.tally());
    EXPECT_EQ(chip_.tally_was, (std::vector<bool>{true, false}));
}

TEST_F(StageLinesTest, the_tally_is_dark_after_ctrl_c_and_when_the_lines_are_let_go_in_a_failure) {
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    stop_ = true;
    EXPECT_TRUE(comes_true([&] { return !chip_.tally(); }));
    lines().end_take();
    stop_ = false;
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    EXPECT_TRUE(chip_.tally());
    lines_.reset();
    EXPECT_FALSE(chip_.tally());
}

TEST_F(StageLinesTest, an_emergency_stop_ends_the_take_by_name_and_the_tally_goes_dark) {
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    chip_.move(estop, true);
    expect_stop({"emergency stop", "'ESTOP'", "the GPIO chip 'fake'", "release it"});
    EXPECT_TRUE(comes_true([&] { return !chip_.tally(); }));
}

TEST_F(StageLinesTest, a_pulse_of_the_emergency_stop_is_enough_and_is_not_forgotten) {
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    chip_.move(estop, true);
    chip_.move(estop, false);
    expect_stop({"emergency stop"});
    lines().end_take();
    EXPECT_FALSE(lines().begin_take(stop_).ok());
}

TEST_F(StageLinesTest, an_emergency_stop_whose_edge_the_kernel_dropped_is_found_by_its_level) {
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    chip_.move(estop, true, false);
    expect_stop({"emergency stop"});
    EXPECT_TRUE(comes_true([&] { return lines().report()[estop].edges_lost == 1; }));
    EXPECT_EQ(lines().report()[estop].edges, 0u);
}

TEST_F(StageLinesTest, a_take_does_not_begin_while_the_emergency_stop_is_held_or_genlock_is_absent) {
    chip_.levels[genlock] = false;
    const Status absent = lines().begin_take(stop_);
    ASSERT_FALSE(absent.ok());
    EXPECT_NE(absent.error().message.find("genlock is absent: line 'GENLOCK'"), std::string::npos)
        << absent.error().message;
    EXPECT_FALSE(chip_.tally());
    lines_.reset();
    chip_.levels = {false, true, true};
    const Status held = lines().begin_take(stop_);
    ASSERT_FALSE(held.ok());
    EXPECT_NE(held.error().message.find("emergency stop"), std::string::npos) << held.error().message;
    EXPECT_FALSE(chip_.tally());
    EXPECT_TRUE(reasons().empty());
}

TEST_F(StageLinesTest, genlock_that_is_lost_ends_the_take_and_a_glitch_does_not) {
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    chip_.glitch(genlock, steady_ns(), 29'000'000);  // 1 ms short of its 30
    chip_.settle();
    EXPECT_TRUE(reasons().empty());
    chip_.move(genlock, false);
    expect_stop({"genlock is absent", "'GENLOCK'"});
}

TEST_F(StageLinesTest, genlock_may_only_be_warned_of) {
    setup_.genlock_absence = GenlockAbsence::warns;
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    chip_.move(genlock, false);
    EXPECT_TRUE(comes_true([&] { return !lines().warnings().empty(); }));
    EXPECT_NE(lines().warnings()[0].find("genlock is absent"), std::string::npos);
    EXPECT_TRUE(reasons().empty());
    EXPECT_TRUE(chip_.tally());
}

TEST_F(StageLinesTest, the_arm_button_counts_when_it_is_pressed_anew_and_held_for_its_debounce) {
    chip_.levels[arm] = true;  // held down already
    lines();
    std::atomic<bool> has_begun = false;
    std::thread presser([&] {
        chip_.settle();
        EXPECT_FALSE(has_begun);
        chip_.glitch(arm, steady_ns(), 1'000'000);  // bounces, it was not let go
        chip_.settle();
        EXPECT_FALSE(has_begun);
        chip_.move(arm, false);
        chip_.settle();  // looks 20 ms apart: it has held
        EXPECT_FALSE(has_begun);
        chip_.move(arm, true);
    });
    EXPECT_TRUE(lines().wait_for_arm(stop_).ok());
    has_begun = true;
    presser.join();
}

TEST_F(StageLinesTest, waiting_for_the_button_ends_at_a_stop_an_emergency_stop_and_a_lost_chip) {
    stop_ = true;
    EXPECT_NE(lines().wait_for_arm(stop_).error().message.find("stopped before"), std::string::npos);
    stop_ = false;
    chip_.move(estop, true);
    EXPECT_NE(lines().wait_for_arm(stop_).error().message.find("emergency stop"), std::string::npos);
    lines_.reset();
    chip_.levels[estop] = false;
    lines();
    chip_.unbind();
    EXPECT_NE(lines().wait_for_arm(stop_).error().message.find("has gone"), std::string::npos);
}

TEST_F(StageLinesTest, a_press_during_what_is_done_meanwhile_counts_and_an_error_of_that_ends_the_wait) {
    int calls = 0;
    const auto press_in_third = [&] {
        if (++calls == 3) chip_.move(arm, true), chip_.settle();
        return Status(Done{});
    };
    EXPECT_TRUE(lines().wait_for_arm(stop_, press_in_third).ok());
    EXPECT_EQ(calls, 3);
    const Status ended = lines().wait_for_arm(stop_, [] { return Status(fail("the board is gone")); });
    EXPECT_EQ(ended.error().message, "the board is gone");
}

TEST_F(StageLinesTest, a_chip_that_goes_ends_the_take_by_name_and_says_that_the_tally_cannot_be_switched) {
    ASSERT_TRUE(lines().begin_take(stop_).ok());
    chip_.unbind();
    expect_stop({"the GPIO chip 'fake' has gone"});
    lines().end_take();
    ASSERT_FALSE(lines().warnings().empty());
    EXPECT_NE(lines().warnings()[0].find("tally"), std::string::npos);
}

TEST_F(StageLinesTest, edges_are_counted_and_carry_the_kernels_time) {
    lines();
    for (int n = 0; n < 6; ++n) chip_.move(arm, n % 2 == 0, true, 1000 + uint64_t(n));
    ASSERT_TRUE(comes_true([&] { return lines().report()[arm].edges == 6; }));
    const LineReport report = lines().report()[arm];
    EXPECT_EQ(report.use, "arm");
    EXPECT_EQ(report.line, "ARM");
    EXPECT_EQ(report.edges_lost, 0u);
    EXPECT_EQ(report.last_edge_ns, 1005u);
}

// The kernel's queue of 16 against an account that sees only what comes through: of each run of dropped edges an odd number is
// known as one, an even number cannot be known, and nothing is ever counted that was not dropped.
TEST(EdgeAccount, knows_of_each_run_of_dropped_edges_whether_it_was_odd) {
    std::mt19937 random(7);
    for (int trial = 0; trial < 200; ++trial) {
        EdgeAccount account;
        uint64_t dropped = 0, odd_runs = 0, run = 0, seen = 0;
        bool level = false;
        account.look(level);
        for (int burst = 0; burst < 20; ++burst) {
            const int edges = int(random() % 40);
            for (int n = 0; n < edges; ++n) {
                level = !level;
                if (n < 16) {
                    account.add(level);
                    ++seen;
                } else {
                    ++dropped;
                    ++run;
                }
            }
            account.look(level);
            account.look(level);  // after the burst it is quiet
            odd_runs += run % 2;
            run = 0;
        }
        EXPECT_EQ(account.seen(), seen);
        EXPECT_EQ(account.lost(), odd_runs);
        EXPECT_LE(account.lost(), dropped);
    }
}

TEST(EdgeAccount, does_not_take_an_edge_that_is_on_its_way_for_lost) {
    EdgeAccount account;
    account.add(true);
    account.look(false);  // read between the interrupt and its edge
    account.add(false);
    account.look(false);
    account.look(false);
    EXPECT_EQ(account.lost(), 0u);
}

TEST(DebouncedLevel, changes_after_it_has_held_by_the_times_of_the_edges_alone) {
    DebouncedLevel level(false, 100);
    EXPECT_FALSE(level.set(true, 1000));
    EXPECT_FALSE(level.advance(1099));
    EXPECT_FALSE(level.set(false, 1099));  // a bounce
    EXPECT_FALSE(level.set(true, 1100));
    EXPECT_TRUE(level.set(false, 1250)) << "it had held for 150 by then, whenever this was read";
    EXPECT_TRUE(level.active());
    EXPECT_TRUE(level.advance(1350));
    EXPECT_FALSE(level.active());
}

}  // namespace
