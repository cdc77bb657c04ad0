// SPDX-License-Identifier: MIT
// TOML files of any kind: values of the right type within their range come through, the rest is named with file, line and key.
// links: ols_stage
#include "stage/toml_section.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <limits>

#include "scratch_folder.hpp"
#include "stage/toml_outline.hpp"

using namespace ols;

namespace {

class TomlFile : public ScratchFolder {
  protected:
    std::string write(const std::string& text) { return ScratchFolder::write("a.toml", text); }
    std::string opening(const std::string& text) {
        const auto file = TomlSection::open(write(text));
        return file ? "opened" : file.error().message;
    }
    // What a value is told when it is read by `read`.
    template <typename Read>
    std::string told(const std::string& text, const Read& read) {
        auto file = TomlSection::open(write(text));
        if (!file) return file.error().message;
        read(*file);
        const Status status = file->finish();
        return status ? "" : status.error().message;
    }
};

bool contains(const std::string& text, const std::string& what) {
    return text.find(what) != text.npos;
}

std::string times(size_t count, const std::string& text) {
    std::string all;
    for (size_t i = 0; i < count; ++i) all += text;
    return all;
}

}  // namespace

TEST_F(TomlFile, depth_is_bounded_before_it_is_parsed) {
    for (const std::string& deep : {times(60'000, "{a="), "x = " + times(60'000, "["), "x = " + times(60'000, "{a="),
                                    "x = " + times(60'000, "{a=["), "[" + times(60'000, "a.") + "a]\n",
                                    times(60'000, "a.") + "a = 1\n", "x = [\n" + times(17, "[\n")}) {
        const std::string message = opening(deep);
        EXPECT_PRED2(contains, message, "nests deeper than the 16 brackets and 16 dots") << deep.substr(0, 20);
        EXPECT_PRED2(contains, message, "a.toml:") << message;
    }
    EXPECT_EQ(opening("x = " + times(16, "[") + times(16, "]")), "opened");
}

TEST_F(TomlFile, brackets_in_texts_and_comments_are_no_depth) {
    const std::string many = times(40, "[");
    for (const std::string& text :
         {"x = \"" + many + "\"", "x = '" + many + "'", "# " + many, "x = \"\"\"\n" + many + "\"\"\"\n",
          "x = '''\n" + many + "'''", "x = \"\\\"" + many + "\"", "\"" + times(40, ".") + "\" = 1",
          "x = \"\"\"" + many + "\"\"\"\"\"\ny = [1]", "x = ''\ny = '" + many + "'"})
        EXPECT_EQ(opening(text), "opened") << text;
}

TEST_F(TomlFile, what_is_no_toml_is_an_error_with_its_line) {
    for (const std::string text : {"\n[{",
                                   "\n[[",
                                   "\nx = [{",
                                   "\nx = ",
                                   "\nx = 1\nx = 2",
                                   "\n[a]\n[a]",
                                   "\nx = {a=1, a=2}",
                                   "\nx = 99999999999999999999",
                                   "\nx = \"\\q\"",
                                   "\nx = \"\xff\"",
                                   "\nx = 'a",
                                   "\nx = 1 y = 2",
                                   "\nx = 2026-13-45",
                                   "\n\x01",
                                   "\n= 1",
                                   "\nx = [1,,2]",
                                   "\nx = {a = 1\n}",
                                   "\n[a]\nb = 1\n[a.b]\n",
                                   "\na.b = 1\na = 2",
                                   "\n\"\\uD800\" = 1"}) {
        const std::string message = opening(text);
        EXPECT_PRED2(contains, message, "a.toml:") << text;
        EXPECT_NE(message, "opened");
    }
    EXPECT_PRED2(contains, opening("\n[{"), "a.toml:2: a bracket begins the line and no name of a table follows");
    EXPECT_PRED2(contains, opening("\n\u03c5]"), "a.toml:2: letters beyond ASCII stand in quotes");
    EXPECT_EQ(opening("\xef\xbb\xbf[a]\n'\u03c5' = \"\u03c5\" # \u03c5\n  [[ \"b\" ]]\nx = [\n [1],\n\t[{a = 1}] ]"),
              "opened");
    EXPECT_PRED2(contains, opening("\xff\xfex"), "a.toml");
}

TEST_F(TomlFile, only_regular_files_of_a_bounded_size_are_opened) {
    const auto why = [](const std::string& path) { return TomlSection::open(path).error().message; };
    EXPECT_PRED2(contains, why(""), "the path of the configuration is empty");
    EXPECT_PRED2(contains, why(folder_), "it is a folder");
    const std::string pipe = folder_ / "pipe.toml";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    EXPECT_PRED2(contains, why(pipe), "it is a pipe");
    EXPECT_PRED2(contains, why("/dev/zero"), "it is a device");
    EXPECT_PRED2(contains, why(folder_ / "none.toml"), "No such file");
    EXPECT_PRED2(contains, opening(std::string((4 << 20) + 1, '#')), "has at most 4194304");
}

TEST_F(TomlFile, a_number_comes_through_in_its_range_only) {
    const auto real = [&](const std::string& value) {
        return told("\nx = " + value, [](TomlSection& file) {
            double x = 5;
            file.read("x", x, -2, 3.5);
        });
    };
    for (const std::string good : {"-2", "3.5", "0", "-0.0", "1e-320", "+3", "0x2"}) EXPECT_EQ(real(good), "") << good;
    for (const std::string bad :
         {"nan", "-nan", "inf", "-inf", "3.6", "-2.1", "1e308", "true", "\"1\"", "[1]", "{}", "2026-01-01", "4"})
        EXPECT_PRED2(contains, real(bad), "a.toml:2: x must be a number from -2 to 3.5") << bad;
    const auto whole = [&](const std::string& value) {
        return told("\nx = " + value, [](TomlSection& file) {
            int x = 5;
            file.read("x", x, -1, std::numeric_limits<int>::max());
        });
    };
    for (const std::string good : {"-1", "2147483647", "1_000"}) EXPECT_EQ(whole(good), "") << good;
    for (const std::string bad :
         {"-2", "2147483648", "4294967296", "9223372036854775807", "-9223372036854775808", "1.0", "true", "nan", "'1'"})
        EXPECT_PRED2(contains, whole(bad), "a.toml:2: x must be a whole number from -1 to 2147483647") << bad;
}

TEST_F(TomlFile, a_list_comes_through_with_its_length_and_range_only) {
    const auto triple = [&](const std::string& value) {
        return told("\nx = " + value, [](TomlSection& file) {
            std::array<double, 3> x{};
            file.read("x", x, -1, 1);
        });
    };
    EXPECT_EQ(triple("[1, -1, 0.5]"), "");
    for (const std::string bad :
         {"[1, 0]", "[1, 0, 0, 0]", "[]", "[1, 0, nan]", "[1, 0, 1e308]", "[1, 0, true]", "[1, 0, [0]]", "1"})
        EXPECT_PRED2(contains, triple(bad), "must be a list of three numbers from -1 to 1") << bad;
    const auto wholes = [&](const std::string& value) {
        return told("\nx = " + value, [](TomlSection& file) {
            std::vector<int> x;
            file.read("x", x, 0, 9);
        });
    };
    EXPECT_EQ(wholes("[0, 9]"), "");
    for (const std::string& bad :
         {std::string("[10]"), std::string("[0.0]"), std::string("9"), "[" + times(4097, "1,") + "]"})
        EXPECT_PRED2(contains, wholes(bad), "must be a list of at most 4096 whole numbers from 0 to 9");
    const auto direction = [&](const std::string& value) {
        return told("\nx = " + value, [](TomlSection& file) {
            std::array<double, 3> x{};
            file.read_direction("x", x);
        });
    };
    EXPECT_EQ(direction("[0, 0, 1e-5]"), "");
    EXPECT_PRED2(contains, direction("[0, 0, 0]"), "it is a direction");
    EXPECT_PRED2(contains, direction("[0, 0, 1e308]"), "three numbers from");
}

TEST_F(TomlFile, texts_and_tables_are_bounded_too) {
    const auto text = [&](const std::string& value) {
        return told("\nx = " + value, [](TomlSection& file) {
            std::string x;
            file.read("x", x);
        });
    };
    EXPECT_EQ(text("\"M\u00fcller\""), "");
    for (const std::string& bad :
         {std::string("7"), std::string("\"a\\u0000b\""), std::string("\"a\\nb\""), "\"" + times(5000, "a") + "\""})
        EXPECT_PRED2(contains, text(bad), "must be a text in quotes");
    EXPECT_PRED2(contains,
                 told(times(4, "[[x]]\n"), [](TomlSection& file) { EXPECT_TRUE(file.sections("x", 3).empty()); }),
                 "a.toml:1: x has 4 tables and may have 3");
}
