// SPDX-License-Identifier: MIT
// Ingest: pictures written by OpenCV come back as linear light by the closed form of sRGB; everything a real folder gets
// wrong is named, and nothing is left behind.
// links: opencv_imgcodecs ols_photographs
#include "photographs/ingest.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "image/exr.hpp"
#include "take_fixture.hpp"

using namespace ols;
using namespace ols::test;

namespace {

// IEC 61966-2-1.
double linear_of(double code) {
    return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
}

// Code value of a test picture; B, G, R as OpenCV has them, all different.
int code(int picture, int x, int y, int channel, int last) {
    return (picture * 31 + x * 7 + y * 13 + channel * 57) * last / 255 % (last + 1);
}

}  // namespace

class Ingest : public TakeDirectory {
  protected:
    static constexpr int width = 70, height = 66;

    void SetUp() override {
        TakeDirectory::SetUp();
        folder = directory + "/my pictures";
        std::filesystem::create_directory(folder);
        options.directory = folder;
        options.lights = directory + "/lights.lp";
        options.output = path;
    }

    void add_picture(const std::string& name, int n, int depth = CV_8U, int channels = 3, int w = width) {
        cv::Mat mat(height, w, CV_MAKETYPE(depth, channels));
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < w; ++x)
                for (int c = 0; c < channels; ++c) {
                    if (depth == CV_8U) mat.ptr<uint8_t>(y)[x * channels + c] = uint8_t(code(n, x, y, c, 255));
                    if (depth == CV_16U) mat.ptr<uint16_t>(y)[x * channels + c] = uint16_t(code(n, x, y, c, 65535));
                }
        ASSERT_TRUE(cv::imwrite(folder + "/" + name, mat));
    }

    void write_lights(const std::vector<std::string>& names) {
        std::ofstream file(options.lights);
        file << names.size() << "\n";
        for (size_t i = 0; i < names.size(); ++i) file << names[i] << " " << double(i) << " 1.5 -1\n";
    }

    Target ingested() {
        const auto report = ingest(options);
        EXPECT_TRUE(report.ok()) << report.error().message;
        if (!report) return {};
        const auto reader = ArchiveReader::open(path);
        EXPECT_TRUE(reader->verify().problems.empty());
        return *reader->read_target(0, 0);
    }

    // The message of an ingest that must fail and leave nothing in the directory but what was there.
    std::string refusal() {
        const auto before = std::distance(std::filesystem::directory_iterator(directory), {});
        const auto report = ingest(options);
        EXPECT_FALSE(report.ok());
        EXPECT_FALSE(std::filesystem::exists(path));
        EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory), {}), before);
        return report.ok() ? "" : report.error().message;
    }

    std::string folder;
    IngestOptions options;
};

TEST_F(Ingest, srgb_pictures_of_8_and_16_bits_become_linear_light_in_the_order_of_the_lp_file) {
    options.sample_type = SampleType::single_float;
    add_picture("b.png", 1);
    add_picture("a 16 bit.png", 2, CV_16U);
    add_picture("c.tif", 3);
    write_lights({"b.png", "a 16 bit.png", "c.tif"});
    const Target target = ingested();
    ASSERT_EQ(target.lamps.size(), 9u);
    EXPECT_EQ(target.cfa, Cfa::rgb);
    for (int n = 0; n < 3; ++n)
        for (int c = 0; c < 3; ++c)
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x) {
                    const int last = n == 1 ? 65535 : 255;
                    const double truth = linear_of(double(code(n + 1, x, y, 2 - c, last)) / last);
                    ASSERT_NEAR(target.lamps[n * 3 + c][y * width + x], truth, 1e-6);
                }
    EXPECT_EQ(ArchiveReader::open(path)->info().color_interop_id, "lin_rec709_scene");
}

TEST_F(Ingest, half_float_archives_keep_linear_light_to_a_part_in_two_thousand) {
    add_picture("a.png", 1);
    write_lights({"a.png"});
    const Target target = ingested();
    for (size_t p = 0; p < target.lamps[1].size(); ++p) {
        const double truth = linear_of(code(1, int(p) % width, int(p) / width, 1, 255) / 255.0);
        ASSERT_NEAR(target.lamps[1][p], truth, truth / 2048 + 1e-7);
    }
}

TEST_F(Ingest, linear_transfer_keeps_code_values) {
    options.picture.transfer = Transfer::linear;
    options.sample_type = SampleType::single_float;
    add_picture("a.png", 1, CV_8U, 1);
    write_lights({"a.png"});
    const Target target = ingested();
    ASSERT_EQ(target.cfa, Cfa::none);
    EXPECT_NEAR(target.lamps[0][5 * width + 9], code(1, 9, 5, 0, 255) / 255.0, 1e-7);
}

TEST_F(Ingest, openexr_pictures_are_taken_as_linear_and_keep_values_above_one) {
    Image image(width, height, 3);
    for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(i % 2048) / 256;
    ASSERT_TRUE(write_exr(folder + "/a.exr", image).ok());
    write_lights({"a.exr"});
    const Target target = ingested();
    for (size_t p = 0; p < target.lamps[0].size(); ++p)
        for (int c = 0; c < 3; ++c) ASSERT_EQ(target.lamps[c][p], image.data[p * 3 + c]);
}

TEST_F(Ingest, grey_pictures_among_coloured_ones_are_grey_in_all_colours) {
    add_picture("a.png", 1);
    add_picture("dark.png", 2, CV_8U, 1);
    write_lights({"a.png", "dark.png"});
    const Target target = ingested();
    ASSERT_EQ(target.lamps.size(), 6u);
    EXPECT_EQ(target.lamps[3], target.lamps[5]);
    EXPECT_NE(target.lamps[0], target.lamps[2]);
}

TEST_F(Ingest, paths_of_another_machine_and_other_letter_case_find_their_pictures) {
    add_picture("one.png", 1);
    add_picture("IMG_2.JPG", 2);
    add_picture("my third.bmp", 3);
    write_lights({"C:\\RTI\\images\\one.png", "/home/somebody/img_2.jpg", "images/my third.bmp"});
    EXPECT_EQ(ingested().lamps.size(), 9u);
    EXPECT_EQ(ArchiveReader::open(path)->info().lights[1].name, "img_2.jpg");
}

TEST_F(Ingest, a_path_into_a_subfolder_is_taken_as_written) {
    std::filesystem::create_directory(folder + "/left");
    add_picture("left/a.png", 1);
    add_picture("a.png", 2);
    write_lights({"left/a.png", "a.png"});
    const Target target = ingested();
    EXPECT_NE(target.lamps[0], target.lamps[3]);
}

TEST_F(Ingest, decimal_commas_and_any_number_of_lamps_are_understood) {
    std::ofstream(options.lights) << "2\r\nb.png 0,6 0 0,8\r\na.png -0,6 0 0,8\r\n";
    add_picture("a.png", 1);
    add_picture("b.png", 2);
    ingested();
    EXPECT_NEAR(ArchiveReader::open(path)->info().lights[1].direction.x, -0.6, 1e-12);
}

TEST_F(Ingest, a_mask_marks_what_is_black_in_it_as_outside) {
    add_picture("a.png", 1);
    cv::Mat mask(height, width, CV_8U, cv::Scalar(255));
    mask.at<uint8_t>(3, 4) = 0;
    mask.at<uint8_t>(65, 69) = 100;
    options.mask = directory + "/mask.png";
    ASSERT_TRUE(cv::imwrite(options.mask, mask));
    write_lights({"a.png"});
    const Target target = ingested();
    EXPECT_EQ(std::count(target.mask.begin(), target.mask.end(), uint32_t(mask_outside)), 2);
    EXPECT_EQ(target.mask[3 * width + 4], uint32_t(mask_outside));
}

TEST_F(Ingest, pictures_that_the_lp_file_does_not_name_are_reported) {
    add_picture("a.png", 1);
    add_picture("flat field.png", 2);
    write_lights({"a.png"});
    EXPECT_EQ(ingest(options)->unused, std::vector<std::string>{"flat field.png"});
}

TEST_F(Ingest, missing_pictures_are_listed) {
    add_picture("a.png", 1);
    write_lights({"a.png", "b.png", "c d.png"});
    const std::string why = refusal();
    EXPECT_NE(why.find("2 of the 3 pictures"), std::string::npos) << why;
    EXPECT_NE(why.find("'b.png', 'c d.png'"), std::string::npos) << why;
}

TEST_F(Ingest, a_wrong_count_is_refused) {
    add_picture("a.png", 1);
    std::ofstream(options.lights) << "2\na.png 0 0 1\n";
    EXPECT_NE(refusal().find("says 2 lights and lists 1"), std::string::npos);
}

TEST_F(Ingest, mixed_sizes_name_the_picture_that_differs) {
    add_picture("a.png", 1);
    add_picture("b.png", 2);
    add_picture("narrow.png", 3, CV_8U, 3, width - 1);
    write_lights({"a.png", "b.png", "narrow.png"});
    EXPECT_NE(refusal().find("narrow.png' is 69 x 66, but"), std::string::npos);
}

TEST_F(Ingest, damaged_and_cut_pictures_are_named) {
    add_picture("a.png", 1);
    write_lights({"a.png", "bad.png"});
    std::ofstream(folder + "/bad.png") << "this is no picture";
    EXPECT_NE(refusal().find("bad.png'"), std::string::npos);
    for (const std::string name : {"cut.png", "cut.jpg", "cut.tif", "cut.exr"}) {
        if (name == "cut.exr")
            ASSERT_TRUE(write_exr(folder + "/" + name, Image(width, height, 3)).ok());
        else
            add_picture(name, 2);
        const auto file = folder + "/" + name;
        std::filesystem::resize_file(file, std::filesystem::file_size(file) * 2 / 3);
        write_lights({"a.png", name});
        EXPECT_NE(refusal().find(name + "'"), std::string::npos) << name;
    }
}

TEST_F(Ingest, two_lights_with_one_picture_are_refused) {
    add_picture("a.png", 1);
    write_lights({"a.png", "old/a.png"});
    EXPECT_NE(refusal().find("both mean"), std::string::npos);
}

TEST_F(Ingest, names_that_differ_in_case_alone_are_ambiguous) {
    add_picture("A.png", 1);
    add_picture("a.PNG", 1);
    write_lights({"a.png"});
    EXPECT_NE(refusal().find("may mean 'A.png', 'a.PNG'"), std::string::npos);
}

TEST_F(Ingest, a_mask_of_another_size_is_refused) {
    add_picture("a.png", 1);
    add_picture("mask.png", 1, CV_8U, 1, 20);
    options.mask = folder + "/mask.png";
    write_lights({"a.png"});
    EXPECT_NE(refusal().find("is 20 x 66, the pictures are 70 x 66"), std::string::npos);
}

TEST_F(Ingest, an_output_that_exists_or_has_no_folder_is_refused_before_any_work) {
    add_picture("a.png", 1);
    write_lights({"a.png"});
    options.output = folder;
    EXPECT_NE(ingest(options).error().message.find("exists"), std::string::npos);
    options.output = directory + "/no such folder/take.rfa";
    EXPECT_NE(ingest(options).error().message.find("does not exist"), std::string::npos);
    options.output = path;
    options.lights = directory + "/none.lp";
    EXPECT_NE(refusal().find("none.lp"), std::string::npos);
    write_lights({"a.png"});
    options.directory = directory + "/nowhere";
    EXPECT_NE(refusal().find("nowhere"), std::string::npos);
}

TEST_F(Ingest, a_failed_overwrite_keeps_the_archive_that_was_there) {
    add_picture("a.png", 1);
    write_lights({"a.png"});
    const Target target = ingested();
    options.overwrite = true;
    write_lights({"a.png", "lost.png"});
    EXPECT_FALSE(ingest(options).ok());
    EXPECT_EQ(ArchiveReader::open(path)->read_target(0, 0)->lamps, target.lamps);
}
