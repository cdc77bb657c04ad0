// SPDX-License-Identifier: MIT
// Basis files: what is written comes back; what is no basis is named with its line.
// links: ols_stage
#include "stage/basis_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

using namespace ols;

namespace {

class BasisFile : public testing::Test {
  protected:
    BasisFile() { std::filesystem::create_directories(folder); }
    ~BasisFile() override { std::filesystem::remove_all(folder); }

    std::string error_of(const std::string& text, int lamps = 3) {
        std::ofstream(path) << text;
        const auto basis = read_basis(path, lamps);
        return basis.ok() ? "" : basis.error().message;
    }

    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / testing::UnitTest::GetInstance()->current_test_info()->name();
    const std::string path = folder / "mine.csv";
};

TEST_F(BasisFile, what_is_written_comes_back) {
    const Basis written = *find_basis("spherical_harmonics:3");
    ASSERT_TRUE(write_basis(path, written, "one\ntwo").ok());
    const auto read = read_basis(path, 156);
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->name, "mine");
    EXPECT_EQ(read->levels, written.levels);
    EXPECT_EQ(read->level_max, 255);
    EXPECT_EQ(read->matrix, written.matrix);
}

TEST_F(BasisFile, any_separator_will_do_and_the_inverse_is_the_matrix_inverse) {
    std::ofstream(path) << "# triples\n1,1 0\n\n0;1;1\n1\t0\t1\r\n";
    const auto basis = read_basis(path, 3);
    ASSERT_TRUE(basis.ok()) << basis.error().message;
    EXPECT_EQ(basis->level_max, 1);
    const double inverse[3][3] = {{0.5, 0.5, -0.5}, {-0.5, 0.5, 0.5}, {0.5, -0.5, 0.5}};
    for (int r = 0; r < 3; ++r)
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(basis->inverse(r, i), inverse[r][i], 1e-12);
}

TEST_F(BasisFile, the_same_rows_come_of_every_kind_of_text) {
    for (const std::string text : {"1 0 0\n0 1 0\n0 0 1\n",
                                   "\xef\xbb\xbf"
                                   "1 0 0\r\n0 1 0\r\n0 0 1",
                                   "1 0 0\r0 1 0\r0 0 1\r"}) {
        EXPECT_EQ(error_of(text), "");
        EXPECT_EQ(read_basis(path, 3)->levels, (std::vector<uint8_t>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
    }
    EXPECT_NE(error_of(std::string("\xff\xfe"
                                   "1\0 ",
                                   5))
                  .find("is UTF-16 text"),
              std::string::npos);
}

TEST_F(BasisFile, fewer_rows_than_lamps_are_an_estimate) {
    std::ofstream(path) << "1 0 0\n0 1 1\n";
    EXPECT_TRUE(read_basis(path, 3)->is_estimate);
}

TEST_F(BasisFile, what_is_no_basis_is_named_with_its_line) {
    EXPECT_NE(error_of("1 0 0\n1 0\n").find("mine.csv:2: 2 levels where the stage has 3"), std::string::npos);
    EXPECT_NE(error_of("1 0 0\n1 0 x\n").find("mine.csv:2: 'x' is no level"), std::string::npos);
    EXPECT_NE(error_of("1 0 256\n").find("'256' is no level"), std::string::npos);
    EXPECT_NE(error_of("1 0 -1\n").find("'-1' is no level"), std::string::npos);
    EXPECT_NE(error_of("# level_max = 5\n1 0 1\n").find("'5' is none of"), std::string::npos);
    EXPECT_NE(error_of("# level_max = 3\n1 0 4\n").find("level 4 is above"), std::string::npos);
    EXPECT_NE(error_of("# nothing\n").find("no rows"), std::string::npos);
    EXPECT_NE(error_of("0 0 0\n").find("lights no lamp"), std::string::npos);
    EXPECT_NE(error_of("1 0 0\n1,,0\n").find("mine.csv:2: an empty cell"), std::string::npos);
    EXPECT_NE(error_of("1,0,0,\n").find("an empty cell"), std::string::npos);
    EXPECT_NE(error_of(",,\n").find("an empty cell"), std::string::npos);
    EXPECT_NE(error_of(std::string("1 0 0\0\n", 7)).find("is no level"), std::string::npos);
    EXPECT_NE(error_of("").find("no rows"), std::string::npos);
    EXPECT_FALSE(read_basis(folder / "absent.csv", 3).ok());
    EXPECT_FALSE(read_basis(folder, 3).ok());
}

TEST_F(BasisFile, more_rows_than_a_board_plays_are_refused_at_the_first_too_many) {
    std::string rows;
    for (int r = 0; r < 70'000; ++r) rows += "1 0 0\n";
    EXPECT_NE(error_of(rows).find("mine.csv:1025: more rows than the 1024"), std::string::npos);
}

// What has no end, /dev/zero for one, must not fill the memory first.
TEST_F(BasisFile, a_line_without_end_is_refused_after_64_kilobytes) {
    EXPECT_NE(error_of(std::string(1 << 20, ' ')).find("a line of more than"), std::string::npos);
    EXPECT_NE(read_basis("/dev/zero", 3).error().message.find("it is a device, not a file"), std::string::npos);
    EXPECT_NE(read_basis("", 3).error().message.find("path of the basis file is empty"), std::string::npos);
    EXPECT_NE(read_basis(folder, 3).error().message.find("it is a folder, not a file"), std::string::npos);
}

TEST_F(BasisFile, rows_of_zeros_carry_nothing_and_a_lamp_without_light_has_no_image) {
    std::ofstream(path) << "1 0 0\n0 0 0\n1 0 1\n";
    const auto basis = read_basis(path, 3);
    ASSERT_TRUE(basis.ok()) << basis.error().message;
    EXPECT_EQ(basis->image_lamps, (std::vector<std::vector<int>>{{0}, {2}}));
    EXPECT_FALSE(basis->is_estimate);
    for (int i = 0; i < 2; ++i) EXPECT_NEAR(basis->inverse(1, i), 0, 1e-12);
}

// Two lamps whose levels differ by one of 255 in one row of three: the condition number is about 255 sqrt(6).
TEST_F(BasisFile, a_near_singular_one_is_refused_beyond_the_limit) {
    EXPECT_EQ(error_of("255 255 0\n255 254 0\n0 0 255\n"), "");
    std::string rows;
    for (int r = 0; r < 24; ++r) rows += r == 0 ? "255 254 0\n" : "255 255 0\n";
    EXPECT_EQ(error_of(rows + "0 0 255\n"), "");
    // Lamp 2 shines like lamp 0 in all rows but one, at a two hundred and fifty-fifth, and a thousand rows say nothing else.
    rows.clear();
    for (int r = 0; r < 1000; ++r) rows += "255 255 0\n";
    EXPECT_NE(error_of(rows + "255 254 0\n0 0 255\n").find("near-singular"), std::string::npos);
}

}  // namespace
