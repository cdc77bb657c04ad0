// SPDX-License-Identifier: MIT
// What the V4L2 driver asks a device for, and how it reads what it gets: formats, exposure, triggers, controls.
// links: ols_device
#include "v4l2_fixture.hpp"

namespace ols::test {
namespace {

// How one row of samples lies in memory, written down from the documents of the formats, and not from the driver's tables.
using PackRow = std::vector<uint8_t> (*)(const std::vector<uint16_t>&);

std::vector<uint8_t> as_bytes(const std::vector<uint16_t>& row) {
    return {row.begin(), row.end()};
}
std::vector<uint8_t> as_words(const std::vector<uint16_t>& row) {
    std::vector<uint8_t> bytes;
    for (const uint16_t sample : row) bytes.insert(bytes.end(), {uint8_t(sample), uint8_t(sample >> 8)});
    return bytes;
}
std::vector<uint8_t> as_high_words(const std::vector<uint16_t>& row) {
    std::vector<uint8_t> bytes;
    for (const uint16_t sample : row) bytes.insert(bytes.end(), {uint8_t(sample << 4), uint8_t(sample >> 4)});
    return bytes;
}
std::vector<uint8_t> as_big_words(const std::vector<uint16_t>& row) {
    std::vector<uint8_t> bytes;
    for (const uint16_t sample : row) bytes.insert(bytes.end(), {uint8_t(sample >> 8), uint8_t(sample)});
    return bytes;
}
std::vector<uint8_t> as_mipi_10(const std::vector<uint16_t>& row) {
    std::vector<uint8_t> bytes;
    for (size_t n = 0; n < row.size(); n += 4) {
        for (size_t k = 0; k < 4; ++k) bytes.push_back(uint8_t(row[n + k] / 4));
        bytes.push_back(uint8_t(row[n] % 4 + row[n + 1] % 4 * 4 + row[n + 2] % 4 * 16 + row[n + 3] % 4 * 64));
    }
    return bytes;
}
std::vector<uint8_t> as_mipi_12(const std::vector<uint16_t>& row) {
    std::vector<uint8_t> bytes;
    for (size_t n = 0; n < row.size(); n += 2)
        bytes.insert(bytes.end(),
                     {uint8_t(row[n] / 16), uint8_t(row[n + 1] / 16), uint8_t(row[n] % 16 + row[n + 1] % 16 * 16)});
    return bytes;
}
std::vector<uint8_t> as_bits_10(const std::vector<uint16_t>& row) {
    std::vector<uint8_t> bytes;
    for (size_t n = 0; n < row.size(); n += 4) {
        uint64_t bits = 0;
        for (size_t k = 0; k < 4; ++k) bits = bits * 1024 + row[n + k];
        for (int shift = 32; shift >= 0; shift -= 8) bytes.push_back(uint8_t(bits >> shift));
    }
    return bytes;
}

struct FormatCase {
    const char* fourcc;
    Cfa cfa;
    int bits;
    PackRow pack;
    bool is_big_endian = false;
};

const FormatCase format_cases[] = {
    {"GREY", Cfa::none, 8, as_bytes},       {"Y10 ", Cfa::none, 10, as_words},
    {"Y10B", Cfa::none, 10, as_bits_10},    {"Y10P", Cfa::none, 10, as_mipi_10},
    {"Y12 ", Cfa::none, 12, as_words},      {"Y12P", Cfa::none, 12, as_mipi_12},
    {"Y012", Cfa::none, 12, as_high_words}, {"Y14 ", Cfa::none, 14, as_words},
    {"Y16 ", Cfa::none, 16, as_words},      {"Y16 ", Cfa::none, 16, as_big_words, true},
    {"RGB3", Cfa::rgb, 8, as_bytes},        {"RGGB", Cfa::rggb, 8, as_bytes},
    {"BA81", Cfa::bggr, 8, as_bytes},       {"GRBG", Cfa::grbg, 8, as_bytes},
    {"GBRG", Cfa::gbrg, 8, as_bytes},       {"RG10", Cfa::rggb, 10, as_words},
    {"BG10", Cfa::bggr, 10, as_words},      {"BA10", Cfa::grbg, 10, as_words},
    {"GB10", Cfa::gbrg, 10, as_words},      {"pRAA", Cfa::rggb, 10, as_mipi_10},
    {"pBAA", Cfa::bggr, 10, as_mipi_10},    {"pgAA", Cfa::grbg, 10, as_mipi_10},
    {"pGAA", Cfa::gbrg, 10, as_mipi_10},    {"RG12", Cfa::rggb, 12, as_words},
    {"BG12", Cfa::bggr, 12, as_words},      {"BA12", Cfa::grbg, 12, as_words},
    {"GB12", Cfa::gbrg, 12, as_words},      {"pRCC", Cfa::rggb, 12, as_mipi_12},
    {"pBCC", Cfa::bggr, 12, as_mipi_12},    {"pgCC", Cfa::grbg, 12, as_mipi_12},
    {"pGCC", Cfa::gbrg, 12, as_mipi_12},    {"RG14", Cfa::rggb, 14, as_words},
    {"BG14", Cfa::bggr, 14, as_words},      {"GR14", Cfa::grbg, 14, as_words},
    {"GB14", Cfa::gbrg, 14, as_words},      {"RG16", Cfa::rggb, 16, as_words},
    {"BYR2", Cfa::bggr, 16, as_words},      {"GR16", Cfa::grbg, 16, as_words},
    {"GB16", Cfa::gbrg, 16, as_words},
};

class V4l2Formats : public V4l2CameraTest, public testing::WithParamInterface<FormatCase> {};

INSTANTIATE_TEST_SUITE_P(Kernel, V4l2Formats, testing::ValuesIn(format_cases), [](const auto& each) {
    std::string name = each.param.fourcc;
    while (name.ends_with(' ')) name.pop_back();
    return name + (each.param.is_big_endian ? "_BE" : "");
});

}  // namespace

TEST_P(V4l2Formats, are_chosen_by_cfa_and_bits_and_unpacked_from_rows_with_room_behind_them) {
    const FormatCase& each = GetParam();
    const char* f = each.fourcc;
    const uint32_t fourcc = uint32_t(f[0]) | uint32_t(f[1]) << 8 | uint32_t(f[2]) << 16 | uint32_t(f[3]) << 24 |
                            (each.is_big_endian ? 1u << 31 : 0);
    const size_t row_samples = size_t(width) * (each.cfa == Cfa::rgb ? 3 : 1);
    std::vector<uint16_t> samples(row_samples * height);
    for (size_t n = 0; n < samples.size(); ++n) samples[n] = uint16_t((n * 40503 + 977) & ((1u << each.bits) - 1));
    const size_t least = each.pack({samples.begin(), samples.begin() + long(row_samples)}).size();
    model_->formats = {{V4L2_PIX_FMT_MJPEG, "Motion-JPEG"}, {fourcc, "the one"}, {V4L2_PIX_FMT_YUYV, "YUYV 4:2:2"}};
    model_->least_row_bytes = [least](uint32_t, uint32_t) { return least; };
    start(setup_of(each.cfa, each.bits));
    const size_t row_bytes = model_->row_bytes_in_force();
    EXPECT_EQ(row_bytes % 32, 0u);
    V4l2Model::Exposure exposure;
    exposure.bytes.assign(row_bytes * height, 0xee);
    for (size_t y = 0; y < height; ++y) {
        const auto row =
            each.pack({samples.begin() + long(y * row_samples), samples.begin() + long((y + 1) * row_samples)});
        std::copy(row.begin(), row.end(), exposure.bytes.begin() + long(y * row_bytes));
    }
    model_->expose(exposure);
    const auto frame = camera_->read(surely_ms);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->camera, 2u);
    EXPECT_EQ(frame->white, float((1 << each.bits) - 1));
    ASSERT_EQ(frame->samples.size(), samples.size() * 2);
    EXPECT_EQ(std::memcmp(frame->samples.data(), samples.data(), frame->samples.size()), 0);
}

TEST_F(V4l2CameraTest, of_two_formats_for_the_same_samples_takes_the_one_of_fewer_bytes) {
    model_->formats = {{V4L2_PIX_FMT_Y10, "10-bit Greyscale"}, {V4L2_PIX_FMT_Y10P, "10-bit Greyscale (MIPI Packed)"}};
    ASSERT_EQ(set_up(setup_of(Cfa::none, 10)), "");
    EXPECT_TRUE(has(camera_->info().link, "Y10P")) << camera_->info().link;
}

TEST_F(V4l2CameraTest, says_who_it_is_and_what_was_chosen) {
    ASSERT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
    EXPECT_EQ(camera_->info().name, "Model camera (platform:model)");
    EXPECT_EQ(camera_->info().link,
              "V4L2 by model, RG12, at most 120 frames/s, 8 buffers, stamps at the end of the frame");
    EXPECT_EQ(camera_->info().clock_step_ns, 1000u);
}

TEST_F(V4l2CameraTest, a_mosaic_and_bits_that_are_not_to_be_had_are_refused_with_those_that_are) {
    model_->formats.emplace_back(V4L2_PIX_FMT_MJPEG, "Motion-JPEG");
    const std::string refusal = set_up(setup_of(Cfa::bggr, 10));
    EXPECT_TRUE(has(refusal, "cfa is none and not bggr")) << refusal;
    EXPECT_TRUE(has(refusal, "bits is 8 and not 10")) << refusal;
    EXPECT_TRUE(has(refusal, "GREY (8-bit Greyscale), RG12 (12-bit Bayer RGRG/GBGB); not read here: MJPG")) << refusal;
}

TEST_F(V4l2CameraTest, a_format_that_the_driver_changes_is_refused_by_its_name) {
    model_->changes_format_to = V4L2_PIX_FMT_YUYV;
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "its pixel format is YUYV"));
    model_->changes_format_to = V4L2_PIX_FMT_GREY;
    const std::string refusal = set_up(setup_of(Cfa::rggb, 12));
    EXPECT_TRUE(has(refusal, "its pixel format is GREY")) << refusal;
    EXPECT_TRUE(has(refusal, "bits is 8 and not 12")) << refusal;
}

TEST_F(V4l2CameraTest, layouts_that_cannot_be_are_refused) {
    model_->row_bytes = width * 2 - 1;
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "takes 47 bytes, and it takes 48"));
    model_->row_bytes = 0;
    model_->image_bytes = width * 2 * height - 1;
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "take 383 bytes"));
    model_->image_bytes = 0;
    model_->field = V4L2_FIELD_INTERLACED;
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "interlaced"));
    model_->field = V4L2_FIELD_NONE;
    model_->buffers_max = 1;
    EXPECT_TRUE(has(set_up(setup_of(Cfa::rggb, 12)), "gives 1 buffer"));
    model_->buffers_max = 4;
    EXPECT_EQ(set_up(setup_of(Cfa::rggb, 12)), "");
}

// Exposure, triggers and controls.

TEST_F(V4l2CameraTest, an_exposure_that_is_no_step_of_the_camera_is_refused_with_the_nearest) {
    model_->controls = {{V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", V4L2_CTRL_TYPE_INTEGER, 2, 5000}};
    CameraSetup timed = setup_of(Cfa::rggb, 12);
    timed.exposure_mode = ExposureMode::timed;
    timed.exposure_us = 330;
    EXPECT_TRUE(has(set_up(timed), "exposure_us is 300 and not 330"));
    timed.exposure_us = 50;
    EXPECT_TRUE(has(set_up(timed), "exposure_us is 200 and not 50"));
    timed.exposure_us = 300;
    EXPECT_EQ(set_up(timed), "");
    EXPECT_EQ(camera_->info().setup.exposure_us, 300);
    EXPECT_EQ(camera_->info().setup.exposure_mode, ExposureMode::timed);
}

TEST_F(V4l2CameraTest, a_timed_exposure_is_refused_of_a_camera_that_has_none) {
    CameraSetup timed = setup_of(Cfa::rggb, 12);
    timed.exposure_mode = ExposureMode::timed;
    EXPECT_TRUE(has(set_up(timed), "it has no exposure_mode, leave it out"));
}

TEST_F(V4l2CameraTest, triggers_are_asked_for_by_the_drivers_own_controls) {
    CameraSetup setup = setup_of(Cfa::rggb, 12);
    setup.trigger_source = "Line1";
    setup.trigger_delay_us = 5;
    EXPECT_TRUE(has(set_up(setup), "this driver has no control for them"));
    model_->controls = {{V4L2_CID_USER_BASE + 0x1001, "Trigger Mode"}, {V4L2_CID_USER_BASE + 0x1002, "Trigger Pin"}};
    const std::string refusal = set_up(setup);
    EXPECT_TRUE(has(refusal, "it has no trigger_source, leave it out")) << refusal;
    EXPECT_TRUE(has(refusal, "it has no trigger_delay_us, leave it out")) << refusal;
    EXPECT_TRUE(has(refusal, "`controls`: \"Trigger Mode\", \"Trigger Pin\"")) << refusal;
}

class V4l2ControlsTest : public V4l2CameraTest {
  protected:
    void SetUp() override {
        model_->controls = {
            {V4L2_CID_GAIN, "Gain", V4L2_CTRL_TYPE_INTEGER, 0, 100, 5, 20, 0, {}, "", V4L2_CID_AUTOGAIN},
            {V4L2_CID_AUTOGAIN, "Gain, Automatic", V4L2_CTRL_TYPE_BOOLEAN, 0, 1, 1, 1},
            {V4L2_CID_POWER_LINE_FREQUENCY,
             "Power Line Frequency",
             V4L2_CTRL_TYPE_MENU,
             0,
             2,
             1,
             1,
             0,
             {"Disabled", "50 Hz", "60 Hz"}},
            {V4L2_CID_USER_BASE + 0x1000, "Trigger Mode", V4L2_CTRL_TYPE_INTEGER, 0, 1, 1, 0},
            {V4L2_CID_USER_BASE + 0x1001, "Big", V4L2_CTRL_TYPE_INTEGER64, -(int64_t(1) << 40), int64_t(1) << 40, 1, 0},
            {V4L2_CID_USER_BASE + 0x1002, "Label", V4L2_CTRL_TYPE_STRING, 0, 8, 1, 0},
            {V4L2_CID_USER_BASE + 0x1003, "Heat", V4L2_CTRL_TYPE_INTEGER, 0, 100, 1, 40, V4L2_CTRL_FLAG_READ_ONLY}};
    }
    std::string set(const std::map<std::string, std::string>& controls) {
        CameraSetup setup = setup_of(Cfa::rggb, 12);
        setup.controls = controls;
        return set_up(setup);
    }
};

TEST_F(V4l2ControlsTest, are_set_by_either_name_and_items_by_theirs_one_after_what_it_waits_for) {
    EXPECT_EQ(set({{"Gain", "45"},
                   {"gain_automatic", "false"},
                   {"Power Line Frequency", "60 Hz"},
                   {"trigger_mode", "1"},
                   {"Big", "-1099511627775"},
                   {"Label", "top left"}}),
              "");
    EXPECT_EQ(model_->control(V4L2_CID_GAIN).value, 45);
    EXPECT_EQ(model_->control(V4L2_CID_AUTOGAIN).value, 0);
    EXPECT_EQ(model_->control(V4L2_CID_POWER_LINE_FREQUENCY).value, 2);
    EXPECT_EQ(model_->control(V4L2_CID_USER_BASE + 0x1000).value, 1);
    EXPECT_EQ(model_->control(V4L2_CID_USER_BASE + 0x1001).value, -1099511627775);
    EXPECT_EQ(model_->control(V4L2_CID_USER_BASE + 0x1002).text, "top left");
    EXPECT_EQ(camera_->info().setup.controls.at("Gain"), "45");
}

TEST_F(V4l2ControlsTest, are_refused_by_name_with_what_they_take) {
    EXPECT_TRUE(has(set({{"gain", "12"}}), "control \"Gain\" takes 0 to 100 in steps of 5, not 12"));
    EXPECT_TRUE(has(set({{"Gain", "105"}}), "takes 0 to 100 in steps of 5, not 105"));
    EXPECT_TRUE(has(set({{"Gain", "much"}}), "not much"));
    EXPECT_TRUE(has(set({{"Gain", "10"}}), "control \"Gain\" does not take 10 (Permission denied)"));
    EXPECT_TRUE(has(set({{"Gain, Automatic", "2"}}), "takes true or false, not 2"));
    EXPECT_TRUE(has(set({{"power_line_frequency", "70 Hz"}}), "takes 0 (Disabled), 1 (50 Hz), 2 (60 Hz), not 70 Hz"));
    EXPECT_TRUE(has(set({{"Label", "much too long"}}), "it takes a text of 0 to 8 bytes"));
    EXPECT_TRUE(has(set({{"Heat", "5"}}), "can only be read"));
    const std::string both = set({{"Sharpness", "1"}, {"Gain", "3"}});
    EXPECT_TRUE(has(both, "it has no control \"Sharpness\" (it has: \"Gain, Automatic\", \"Gain\", ")) << both;
    EXPECT_TRUE(has(both, "\"Gain\" takes")) << both;
}

TEST_F(V4l2ControlsTest, one_that_a_driver_takes_and_does_not_keep_is_refused) {
    model_->controls = {{V4L2_CID_GAIN, "Gain", V4L2_CTRL_TYPE_INTEGER, 0, 100, 1, 20, V4L2_CTRL_FLAG_VOLATILE}};
    model_->keeps_no_control = true;
    EXPECT_TRUE(has(set({{"Gain", "30"}}), "control \"Gain\" is 20 and not 30 (it takes 0 to 100 in steps of 1)"));
}

TEST_F(V4l2ControlsTest, what_changes_pictures_by_itself_is_said) {
    ASSERT_EQ(set({}), "");
    EXPECT_TRUE(has(camera_->info().link, "automatic gain")) << camera_->info().link;
    ASSERT_EQ(set({{"Gain, Automatic", "false"}}), "");
    EXPECT_FALSE(has(camera_->info().link, "automatic")) << camera_->info().link;
}

}  // namespace ols::test
