// SPDX-License-Identifier: MIT
// Edges seen and missed, where they come while they are being counted: seen is always cycles begun and missed. The player and
// the receptor are played here.
// links: ols_firmware
#include "edges.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace {

// Two counters that go on by themselves: after so many reads of either, an edge comes, and begins a cycle or is missed.
struct Machine {
    uint32_t edges = 0, cycles = 0;
    std::vector<std::string> calls;
    int reads_until_edge = -1;  // -1: none comes
    bool begins_cycle = false;

    void read() {
        if (reads_until_edge < 0 || reads_until_edge-- > 0) return;
        edges++;
        cycles += begins_cycle;
    }
} machine;

}  // namespace

extern "C" {
uint32_t player_cycles_begun(void) {
    const uint32_t cycles = machine.cycles;
    machine.read();
    return cycles;
}
uint32_t receptor_edges(void) {
    const uint32_t edges = machine.edges;
    machine.read();
    return edges;
}
void receptor_arm(uint32_t debounce_ticks) {
    machine.calls.push_back("arm " + std::to_string(debounce_ticks));
}
void receptor_start(void) {
    machine.calls.push_back("start");
}
void receptor_stop(void) {
    machine.calls.push_back("stop");
}
}

namespace {

class Edges : public testing::Test {
  protected:
    void SetUp() override { machine = {}; }

    static void start() {
        edges_arm(OLS_START_EACH_CYCLE_BY_EDGE, 1250);
        edges_start();
    }

    static void expect(uint32_t seen, uint32_t missed) {
        EXPECT_EQ(edges_seen(), seen);
        EXPECT_EQ(edges_missed(), missed);
    }
};

TEST_F(Edges, those_that_began_no_cycle_are_missed) {
    start();
    edges_count();
    expect(0, 0);
    machine.edges = 7, machine.cycles = 4;
    expect(0, 0);
    edges_count();
    expect(7, 3);
}

TEST_F(Edges, one_that_comes_while_they_are_counted_is_missed_only_if_it_begins_no_cycle) {
    for (int reads = 0; reads < 8; reads++) {
        machine = {};
        start();
        machine.edges = 5, machine.cycles = 3;
        machine.reads_until_edge = reads;
        machine.begins_cycle = true;
        edges_count();
        EXPECT_EQ(edges_missed(), 2u) << "after " << reads << " reads";
        machine = {};
        start();
        machine.edges = 5, machine.cycles = 3;
        machine.reads_until_edge = reads;
        edges_count();
        EXPECT_EQ(edges_missed(), edges_seen() - 3) << "after " << reads << " reads";
    }
}

TEST_F(Edges, none_counts_where_cycles_do_not_wait_for_it) {
    for (const ols_start_source source : {OLS_START_BY_COMMAND, OLS_START_BY_EDGE}) {
        edges_arm(source, 0);
        edges_start();
        machine.edges = 3;
        edges_count();
        expect(0, 0);
        EXPECT_TRUE(machine.calls.empty()) << "the receptor rests";
    }
}

TEST_F(Edges, none_counts_before_start_nor_after_stop) {
    edges_arm(OLS_START_EACH_CYCLE_BY_EDGE, 1250);
    machine.edges = 1;
    edges_count();
    expect(0, 0);
    edges_start();
    machine.edges = 4, machine.cycles = 2;
    edges_stop();
    expect(4, 2);
    machine.edges = 9, machine.cycles = 0;  // of a player that has been stopped
    edges_count();
    edges_stop();
    expect(4, 2);
    EXPECT_EQ(machine.calls, (std::vector<std::string>{"arm 1250", "start", "stop", "stop"}));
    start();
    expect(0, 0);
    edges_arm(OLS_START_EACH_CYCLE_BY_EDGE, 1250);  // anew, without a stop
    edges_count();
    expect(0, 0);
}

}  // namespace
