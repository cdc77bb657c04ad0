// SPDX-License-Identifier: MIT
// [gpio] and [telemetry] of stage.toml: what is read, and that each mistake names its key.
// links: ols_stage
#include "scratch_folder.hpp"
#include "stage/stage.hpp"

using namespace ols;

namespace {

class WiresOfAStage : public ScratchFolder {
  protected:
    StageConfig read(const std::string& text) {
        const auto stage = read_stage(write("stage.toml", text));
        EXPECT_TRUE(stage.ok()) << stage.error().message;
        return stage.ok() ? *stage : StageConfig();
    }
    std::string error_of(const std::string& text) {
        const auto stage = read_stage(write("stage.toml", text));
        return stage.ok() ? "" : stage.error().message;
    }
    void expect_error(const std::string& text, const std::string& words) {
        EXPECT_NE(error_of(text).find(words), std::string::npos) << text << "\n" << error_of(text);
    }
};

TEST_F(WiresOfAStage, are_none_by_default) {
    const StageConfig stage = read("");
    EXPECT_FALSE(stage.gpio.has_lines());
    EXPECT_TRUE(stage.telemetry.bus.empty());
}

TEST_F(WiresOfAStage, are_read_line_by_line) {
    const StageConfig stage = read(R"(
[gpio]
chip = "gpio-sim.0"
[gpio.arm]
line = "17"
active_low = true
bias = "pull_up"
debounce_ms = 7
[gpio.emergency_stop]
line = "ESTOP"
[gpio.genlock]
line = "LOCKED"
when_absent = "warn"
[gpio.tally]
line = "3"
active_low = true
)");
    ASSERT_TRUE(stage.gpio.arm && stage.gpio.emergency_stop && stage.gpio.genlock && stage.gpio.tally);
    EXPECT_EQ(stage.gpio.chip, "gpio-sim.0");
    EXPECT_EQ(stage.gpio.arm->line, "17");
    EXPECT_TRUE(stage.gpio.arm->active_low);
    EXPECT_EQ(stage.gpio.arm->bias, GpioBias::pull_up);
    EXPECT_EQ(stage.gpio.arm->debounce_ms, 7);
    EXPECT_EQ(stage.gpio.emergency_stop->debounce_ms, 0);
    EXPECT_EQ(stage.gpio.genlock->debounce_ms, 100);
    EXPECT_EQ(stage.gpio.genlock_absence, GenlockAbsence::warns);
    EXPECT_TRUE(stage.gpio.tally->active_low);
}

TEST_F(WiresOfAStage, name_the_key_that_is_wrong) {
    expect_error("[gpio.arm]\nline = \"1\"\n", "gpio.chip is missing");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.arm]\n", "gpio.arm.line is missing");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.arm]\nline = 17\n", "gpio.arm.line must be a text");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.emergency_stop]\nline = \"1\"\ndebounce_ms = 5\n",
                 "debounce_ms is not a key");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.tally]\nline = \"1\"\nbias = \"pull_up\"\n", "bias is not a key");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.arm]\nline = \"1\"\nbias = \"up\"\n",
                 "gpio.arm.bias is 'up', which is none of");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.arm]\nline = \"1\"\n[gpio.tally]\nline = \"1\"\n",
                 "line '1' in two uses");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.genlok]\nline = \"1\"\n", "did you mean genlock?");
    expect_error("[gpio]\nchip = \"c\"\n[gpio.arm]\nline = \"1\"\ndebounce_ms = 10001\n",
                 "gpio.arm.debounce_ms must be");
}

TEST_F(WiresOfAStage, have_telemetry_of_nodes_along_the_chain) {
    const StageConfig stage = read("[telemetry]\nbus = \"can:can0\"\n");
    EXPECT_EQ(stage.telemetry.nodes, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));  // 176 bits of 16
    EXPECT_EQ(stage.telemetry.silent_s, 5);
    EXPECT_EQ(read("[telemetry]\nbus = \"can-socket:run/can.sock\"\nnodes = [200, 7]\n").telemetry.nodes,
              (std::vector<int>{200, 7}));
}

TEST_F(WiresOfAStage, refuse_telemetry_that_cannot_be) {
    expect_error("[telemetry]\nbus = \"can0\"\n", "telemetry.bus is 'can0': write can:IFACE or can-socket:PATH");
    expect_error("[telemetry]\nbus = \"can:can0\"\nnodes = [1, 1]\n", "telemetry.nodes names a node twice");
    expect_error("[telemetry]\nbus = \"can:can0\"\nnodes = []\n", "telemetry.nodes is empty");
    expect_error("[telemetry]\nbus = \"can:can0\"\nnodes = [256]\n", "telemetry.nodes must be");
    expect_error("[telemetry]\nbus = \"can:can0\"\nnodes = [0,1,2,3,4,5,6,7,8,9,10,11]\n",
                 "the chain's 176 bits have 11");
    expect_error("[telemetry]\nbus = \"can:can0\"\nsilent_s = 1\n", "telemetry.silent_s must be");
}

}  // namespace
