// SPDX-License-Identifier: MIT
// stage.toml: what is read, what stands by default, and what each mistake is told.
// links: ols_stage
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "stage/stage.hpp"

using namespace ols;

namespace {

class StageFile : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() / ("stage" + std::to_string(getpid()));
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::string write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << text;
        return folder_ / name;
    }
    std::string error_of(const std::string& text) {
        const auto stage = read_stage(write("stage.toml", text));
        return stage.ok() ? "" : stage.error().message;
    }

    std::filesystem::path folder_;
};

}  // namespace

TEST_F(StageFile, the_example_says_what_the_default_is) {
    const auto read = read_stage("examples/stage.toml");
    ASSERT_TRUE(read.ok()) << read.error().message;
    const StageConfig stage = default_stage();
    EXPECT_EQ(read->lamps.size(), 156u);
    EXPECT_EQ(read->matte_lamps_m.size(), 6u);
    EXPECT_EQ(read->chain_bits, stage.chain_bits);
    EXPECT_EQ(read->chain_bit_of_lamp, stage.chain_bit_of_lamp);
    EXPECT_EQ(read->radius_m, stage.radius_m);
    EXPECT_EQ(read->lamp_beam_exponent, stage.lamp_beam_exponent);
    ASSERT_EQ(read->cameras.size(), 1u);
    const CameraConfig &a = read->cameras[0], &b = stage.cameras[0];
    EXPECT_EQ(std::tie(a.width, a.height, a.cfa, a.bits, a.black, a.white, a.trigger, a.position_m, a.look_at_m, a.up),
              std::tie(b.width, b.height, b.cfa, b.bits, b.black, b.white, b.trigger, b.position_m, b.look_at_m, b.up));
    EXPECT_EQ(std::tie(a.vertical_fov_deg, a.vignetting, a.counts_per_us, a.noise.read_counts, a.noise.shot),
              std::tie(b.vertical_fov_deg, b.vignetting, b.counts_per_us, b.noise.read_counts, b.noise.shot));
}

TEST_F(StageFile, lamps_of_an_lp_file_beside_it_replace_the_geometry) {
    write("three.lp", "3\na 0 0 2\nb 0 1 0\nc 1 0 0\n");
    const auto stage = read_stage(write("stage.toml",
                                        "[lamps]\nlp = \"three.lp\"\n[[lamps.matte]]\nposition_m = [0, 1, -0.5]\n"
                                        "[chain]\nbits = 8\nbit_of_lamp = [7, 0, 1, 2]\n"));
    ASSERT_TRUE(stage.ok()) << stage.error().message;
    ASSERT_EQ(stage->lamps.size(), 3u);
    EXPECT_NEAR(stage->lamps[0].direction.z, 1, 1e-12);
    EXPECT_EQ(stage->lamps[2].name, "lamp_002");
    ASSERT_EQ(stage->matte_lamps_m.size(), 1u);
    EXPECT_EQ(stage->matte_lamps_m[0].z, -0.5);
    EXPECT_EQ(stage->chain_bit_of_lamp, (std::vector<int>{7, 0, 1, 2}));
}

TEST_F(StageFile, says_how_a_camera_is_triggered_and_exposed) {
    const auto stage = read_stage(
        write("stage.toml",
              "[[camera]]\ntrigger_source = \"Line1\"\ntrigger_activation = \"falling_edge\"\ntrigger_delay_us = 2.5\n"
              "exposure_mode = \"timed\"\nexposure_us = 250\n"));
    ASSERT_TRUE(stage.ok()) << stage.error().message;
    const CameraSetup& setup = stage->cameras[0];
    EXPECT_EQ(setup.trigger_source, "Line1");
    EXPECT_EQ(setup.trigger_activation, TriggerActivation::falling_edge);
    EXPECT_EQ(setup.trigger_delay_us, 2.5);
    EXPECT_EQ(setup.exposure_mode, ExposureMode::timed);
    EXPECT_EQ(setup.exposure_us, 250);
    EXPECT_NE(error_of("[[camera]]\nexposure_mode = \"auto\"\n").find("none of: "), std::string::npos);
}

TEST_F(StageFile, takes_a_cameras_own_settings_by_the_cameras_own_names) {
    const auto stage = read_stage(write("stage.toml",
                                        "[[camera]]\ncontrols = { \"Trigger Mode\" = 1, gain_automatic = false, "
                                        "Mode = \"50 Hz\", rate = 2.5 }\n"
                                        "[[camera]]\n[camera.controls]\nGain = -3\n"));
    ASSERT_TRUE(stage.ok()) << stage.error().message;
    using Controls = std::map<std::string, std::string>;
    EXPECT_EQ(stage->cameras[0].controls,
              (Controls{{"Trigger Mode", "1"}, {"gain_automatic", "false"}, {"Mode", "50 Hz"}, {"rate", "2.5"}}));
    EXPECT_EQ(stage->cameras[1].controls, (Controls{{"Gain", "-3"}}));
    EXPECT_NE(error_of("[[camera]]\ncontrols = \"Gain\"\n").find("camera.controls must be a table of settings"),
              std::string::npos);
    EXPECT_NE(
        error_of("[[camera]]\n\ncontrols = { Gain = [1, 2] }\n").find(":3: camera.controls must give \"Gain\" one"),
        std::string::npos);
}

TEST_F(StageFile, white_follows_the_bits_of_the_camera) {
    const auto stage = read_stage(write("stage.toml", "[[camera]]\nbits = 10\n"));
    ASSERT_TRUE(stage.ok());
    EXPECT_EQ(stage->cameras[0].white, 1023);
}

TEST_F(StageFile, a_mistake_is_named_with_file_line_and_key) {
    const auto expect = [&](const std::string& text, const std::string& line, const std::string& what) {
        const std::string message = error_of(text);
        EXPECT_NE(message.find("stage.toml:" + line + ":"), std::string::npos) << message;
        EXPECT_NE(message.find(what), std::string::npos) << message;
    };
    expect("[lamps]\nradius_m = -1\n", "2", "lamps.radius_m must be a number");
    expect("[lamps]\nradius = 1\n", "2", "lamps.radius is not a key that is known here; did you mean radius_m?");
    expect("[[camera]]\n[[camera]]\nwidth = 64\nheigth = 48\n", "4",
           "camera.heigth is not a key that is known here; did you mean height?");
    expect("[[camera]]\nwidth = 64.5\n", "2", "camera.width must be a whole number");
    expect("[[camera]]\ncfa = \"bayer\"\n", "2", "none of: bggr");
    expect("[camera]\nwidth = 64\n", "1", "write [[camera]]");
    expect("[chain]\nbits = 100\n", "2", "a lamp sits on bit");
    expect("[chain]\nbit_of_lamp = [1, 2]\n", "2", "2 bits for 162 lamps");
    expect("[[lamps.matte]]\n", "1", "position_m is missing");
    expect("[lamps]\nlp = \"none.lp\"\n", "2", "none.lp");
    expect("[[camera]]\nblack = 4095\n", "2", "below white");
    expect("\n\n[camera\n", "3", "");
    expect("[[camera]]\nlook_at_m = [0, 0]\n", "2", "three numbers");
    EXPECT_NE(read_stage("/nonexistent.toml").error().message.find("/nonexistent.toml"), std::string::npos);
}

TEST_F(StageFile, a_preset_gives_bits_and_noise_and_the_keys_beside_it_overrule_it) {
    const auto stage = read_stage(write("stage.toml", "[[camera]]\npreset = \"canon_d30\"\nnoise_shot = 0.5\n"));
    ASSERT_TRUE(stage.ok()) << stage.error().message;
    EXPECT_NEAR(stage->cameras[0].noise.read_counts, 18 * 4095 / 50000.0, 1e-12);
    EXPECT_EQ(stage->cameras[0].noise.shot, 0.5);
    EXPECT_NE(error_of("[[camera]]\npreset = \"d30\"\n").find("stage.toml:2: camera.preset"), std::string::npos);
}
