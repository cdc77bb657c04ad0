// SPDX-License-Identifier: MIT
// Telemetry of lamp nodes from a bus that a test holds, in bytes as PROTOCOL.md draws them.
// links: ols_device
#include "device/lamp_nodes.hpp"

#include <gtest/gtest.h>

#include <condition_variable>
#include <deque>

#include "comes_true.hpp"

using namespace ols;
using namespace ols::test;
using namespace std::chrono_literals;

namespace {

// Frames and time are the test's: time stands still but when it is told to go on.
struct Wire {
    std::mutex mutex;
    std::condition_variable moved;
    std::deque<can_frame> frames;
    uint64_t now_us = 5'000'000;
    bool is_down = false;

    void put(uint32_t id, std::vector<uint8_t> data) {
        can_frame frame{};
        frame.can_id = id;
        frame.can_dlc = uint8_t(data.size());
        std::copy(data.begin(), data.end(), frame.data);
        const std::lock_guard lock(mutex);
        frames.push_back(frame);
        moved.notify_all();
    }
    // lamp | temperature 1/100 C| current mA   | open_outputs    | faults | count  |
    void tell(int node, int centi_c, int ma, int open = 0, int faults = 0, int count = 0) {
        const auto low = [](int value) { return uint8_t(value & 255); };
        const auto high = [](int value) { return uint8_t(value >> 8 & 255); };
        put(uint32_t(0x200 + node),
            {low(centi_c), high(centi_c), low(ma), high(ma), low(open), high(open), low(faults), low(count)});
    }
    void pass(uint64_t us) {
        const std::lock_guard lock(mutex);
        now_us += us;
        moved.notify_all();
    }
    void go_down() {
        const std::lock_guard lock(mutex);
        is_down = true;
        moved.notify_all();
    }
};

class FakeBus : public CanBus {
  public:
    explicit FakeBus(Wire& wire) : wire_(wire) {}
    std::string name() const override { return "the CAN bus 'fake'"; }
    Status send(const can_frame&, const Deadline&) override { return fail("nobody may send"); }
    Result<std::optional<can_frame>> receive(uint64_t, const Deadline&) override {
        std::unique_lock lock(wire_.mutex);
        wire_.moved.wait_for(lock, 1ms, [&] { return wire_.is_down || !wire_.frames.empty(); });
        if (!wire_.frames.empty()) {
            const can_frame frame = wire_.frames.front();
            wire_.frames.pop_front();
            return std::optional(frame);
        }
        if (wire_.is_down) return fail("the CAN bus 'fake' is down");
        return std::optional<can_frame>();
    }
    uint64_t now_us() const override {
        const std::lock_guard lock(wire_.mutex);
        return wire_.now_us;
    }

  private:
    Wire& wire_;
};

class LampNodesTest : public testing::Test {
  protected:
    LampNodesTest() : stage_(default_stage()) {
        stage_.telemetry.bus = "can:fake";
        stage_.telemetry.nodes = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10};  // of 176 bits
    }
    LampNodes& nodes() {
        if (!nodes_)
            nodes_ = std::make_unique<LampNodes>(std::make_unique<FakeBus>(wire_), stage_, [&](const std::string& why) {
                const std::lock_guard lock(mutex_);
                reasons_.push_back(why);
            });
        return *nodes_;
    }
    void all_tell(int count) {
        for (const int node : stage_.telemetry.nodes) wire_.tell(node, 2500 + node, 100 * node, 0, 0, count);
    }
    void begin() {
        nodes();
        all_tell(0);
        const Status begun = nodes().begin_take(stop_);
        ASSERT_TRUE(begun.ok()) << begun.error().message;
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
    const LampNodeReport report(int node) {
        for (const LampNodeReport& one : nodes().report())
            if (one.node == node) return one;
        return {};
    }

    Wire wire_;
    StageConfig stage_;
    std::atomic<bool> stop_ = false;
    std::mutex mutex_;
    std::vector<std::string> reasons_;
    std::unique_ptr<LampNodes> nodes_;
};

TEST_F(LampNodesTest, a_take_begins_when_all_have_been_heard_and_keeps_their_extremes) {
    begin();
    wire_.tell(3, -1050, 512, 0, 0, 1);
    wire_.tell(3, 8031, 0xfff0, 0, 0, 2);
    ASSERT_TRUE(comes_true([&] { return report(3).frames == 3; }));
    EXPECT_DOUBLE_EQ(report(3).temperature_min_c, -10.5);
    EXPECT_DOUBLE_EQ(report(3).temperature_max_c, 80.31);
    EXPECT_EQ(report(3).current_min_ma, 300);
    EXPECT_EQ(report(3).current_max_ma, 0xfff0);
    EXPECT_EQ(report(3).frames_lost, 0u);
    EXPECT_TRUE(reasons().empty());
}

TEST_F(LampNodesTest, a_node_that_was_never_heard_refuses_the_take_by_name_and_lamps) {
    nodes();
    std::thread clock([&] {
        for (int second = 0; second <= 6; ++second) {
            for (const int node : {0, 1, 2, 3, 5, 6, 7, 8, 9, 10}) wire_.tell(node, 2500, 0, 0, 0, second);
            EXPECT_TRUE(comes_true([&] { return report(10).frames == uint64_t(second) + 1; }) || second == 6);
            wire_.pass(1'000'000);
        }
    });
    const Status begun = nodes().begin_take(stop_);
    clock.join();
    ASSERT_FALSE(begun.ok());
    EXPECT_NE(begun.error().message.find("lamp node 4 is silent"), std::string::npos) << begun.error().message;
    EXPECT_NE(begun.error().message.find("the lamps 64-79"), std::string::npos) << begun.error().message;
}

TEST_F(LampNodesTest, a_node_that_falls_silent_ends_the_take_with_node_lamps_and_time) {
    begin();
    for (int second = 1; second <= 6; ++second) {
        wire_.pass(1'000'000);
        for (const int node : stage_.telemetry.nodes)
            if (node != 4) wire_.tell(node, 2500, 0, 0, 0, second);
        ASSERT_TRUE(comes_true([&] { return report(10).frames == uint64_t(second) + 1 || !reasons().empty(); }));
        if (second < 5) {
            EXPECT_TRUE(reasons().empty()) << "after " << second << " s";
        }
    }
    expect_stop({"lamp node 4 is silent", "the lamps 64-79", "the CAN bus 'fake'", "s, and it speaks every second"});
}

TEST_F(LampNodesTest, over_temperature_ends_the_take_with_node_value_and_lamps) {
    begin();
    wire_.tell(9, 9320, 512, 0, 1, 1);
    expect_stop({"lamp node 9", "over-temperature", "93.2 C, 512 mA", "the lamps 144-159"});
}

TEST_F(LampNodesTest, every_other_fault_ends_it_too) {
    const std::vector<std::pair<int, std::string>> faults = {
        {2, "open output"}, {4, "shorted"}, {8, "under-voltage"}, {16, "unknown faults 0x10"}};
    for (const auto& [bits, word] : faults) {
        begin();
        wire_.tell(0, 3000, 1, 0, bits, 1);
        expect_stop({"lamp node 0", word, "the lamps 0-15"});
        nodes_.reset();
        reasons_.clear();
    }
}

TEST_F(LampNodesTest, an_open_output_is_named_by_its_lamp_and_one_without_a_lamp_is_none) {
    std::swap(stage_.chain_bit_of_lamp[0], stage_.chain_bit_of_lamp[150]);  // lamp 0 is on bit 150, of node 9
    begin();
    wire_.tell(10, 3000, 1, 0xfffc, 2, 1);  // bits 162 to 175 are spare
    ASSERT_TRUE(comes_true([&] { return report(10).frames == 2; }));
    EXPECT_TRUE(reasons().empty());
    EXPECT_EQ(report(10).open_outputs, 0xfffc);
    wire_.tell(9, 3000, 1, 1 << 6, 2, 1);
    expect_stop({"lamp node 9", "open output, lamps 0:", "the lamps 0, 144-149, 151-159"});
}

TEST_F(LampNodesTest, nodes_are_numbered_as_the_stage_says) {
    stage_.telemetry.nodes = {200, 7};
    nodes();
    wire_.tell(0, 9999, 0, 0, 1);  // another stage's
    wire_.tell(200, 2500, 0);
    wire_.tell(7, 2500, 0);
    ASSERT_TRUE(nodes().begin_take(stop_).ok());
    wire_.tell(7, 2500, 0, 0, 4, 1);
    expect_stop({"lamp node 7", "the lamps 16-31"});
}

TEST_F(LampNodesTest, the_stages_own_limit_counts_beside_the_nodes) {
    stage_.telemetry.temperature_max_c = 60;
    begin();
    wire_.tell(2, 6000, 0, 0, 0, 1);
    ASSERT_TRUE(comes_true([&] { return report(2).frames == 2; }));
    EXPECT_TRUE(reasons().empty());
    wire_.tell(2, 6001, 0, 0, 0, 2);
    expect_stop({"lamp node 2", "60.0 C", "temperature_max_c of 60"});
}

TEST_F(LampNodesTest, lost_frames_are_counted_by_the_nodes_own_count_also_across_its_wrap) {
    begin();
    wire_.tell(1, 2500, 0, 0, 0, 1);
    wire_.tell(1, 2500, 0, 0, 0, 4);    // 2 and 3 were lost
    wire_.tell(1, 2500, 0, 0, 0, 255);  // 250 more
    wire_.tell(1, 2500, 0, 0, 0, 0);
    ASSERT_TRUE(comes_true([&] { return report(1).frames == 5; }));
    EXPECT_EQ(report(1).frames_lost, 252u);
    EXPECT_TRUE(reasons().empty());
}

TEST_F(LampNodesTest, other_frames_on_the_bus_are_no_telemetry) {
    begin();
    wire_.put(0x100, {0, 0, 0, 0, 0, 0, 1, 0});
    wire_.put(0x300, {0, 0, 0, 0, 0, 0, 1, 0});
    wire_.put(0x200, {0, 0, 0, 0, 0, 0, 1});                    // too short
    wire_.put(0x200 | CAN_EFF_FLAG, {0, 0, 0, 0, 0, 0, 1, 0});  // of the extended format
    wire_.put(0x200 | CAN_RTR_FLAG, {0, 0, 0, 0, 0, 0, 1, 0});  // a request
    wire_.tell(0, 2500, 0, 0, 0, 1);
    ASSERT_TRUE(comes_true([&] { return report(0).frames == 2; }));
    EXPECT_TRUE(reasons().empty());
}

TEST_F(LampNodesTest, a_bus_that_goes_down_ends_the_take_by_name) {
    begin();
    wire_.go_down();
    expect_stop({"the lamp nodes' bus: the CAN bus 'fake' is down"});
}

TEST_F(LampNodesTest, a_stop_ends_the_wait_for_nodes) {
    nodes();
    stop_ = true;
    EXPECT_NE(nodes().begin_take(stop_).error().message.find("stopped before"), std::string::npos);
}

TEST_F(LampNodesTest, nothing_stops_what_is_no_take) {
    begin();
    nodes().end_take();
    wire_.tell(0, 9000, 0, 0, 1, 1);
    ASSERT_TRUE(comes_true([&] { return report(0).frames == 2; }));
    EXPECT_TRUE(reasons().empty());
    EXPECT_FALSE(nodes().begin_take(stop_).ok()) << "but the next take is refused";
}

TEST(LampList, joins_neighbours) {
    EXPECT_EQ(lamp_list({}), "none");
    EXPECT_EQ(lamp_list({5}), "5");
    EXPECT_EQ(lamp_list({1, 2, 3, 7, 9, 10}), "1-3, 7, 9-10");
}

}  // namespace
