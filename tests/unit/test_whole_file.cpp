// SPDX-License-Identifier: MIT
// Files that are there whole or not at all: what is in the folder after each way of failing.
// links: ols_image
#include "image/whole_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

using namespace ols;
namespace fs = std::filesystem;

namespace {

class WholeFile : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("whole_file" + std::to_string(getpid()));
        fs::create_directory(folder_);
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string path(const std::string& name) const { return folder_ / name; }
    std::string text_of(const std::string& name) const {
        std::ostringstream text;
        text << std::ifstream(path(name)).rdbuf();
        return text.str();
    }
    std::set<std::string> names() const {
        std::set<std::string> found;
        for (const auto& entry : fs::directory_iterator(folder_)) found.insert(entry.path().filename());
        return found;
    }

  private:
    fs::path folder_;
};

Status write_half(const std::string& temporary) {
    std::ofstream(temporary) << "half of";
    return fail("the rest is not to be had");
}

}  // namespace

TEST_F(WholeFile, replaces_the_older_file_and_leaves_nothing_else) {
    ASSERT_TRUE(write_whole_file(path("a"), "old").ok());
    ASSERT_TRUE(write_whole_file(path("a"), std::string_view("new\0text", 8)).ok());
    EXPECT_EQ(text_of("a"), std::string("new\0text", 8));
    EXPECT_EQ(names(), std::set<std::string>{"a"});
}

TEST_F(WholeFile, keeps_the_older_file_until_the_new_one_is_written) {
    ASSERT_TRUE(write_whole_file(path("a"), "old").ok());
    const Status done = write_whole_file(path("a"), [&](const std::string& temporary) -> Status {
        std::ofstream(temporary) << "new";
        EXPECT_EQ(text_of("a"), "old");
        return Done{};
    });
    EXPECT_TRUE(done.ok());
    EXPECT_EQ(text_of("a"), "new");
}

TEST_F(WholeFile, a_write_that_fails_leaves_the_older_file_and_no_temporary) {
    ASSERT_TRUE(write_whole_file(path("a"), "old").ok());
    const Status done = write_whole_file(path("a"), write_half);
    ASSERT_FALSE(done.ok());
    EXPECT_EQ(done.error().message, "the rest is not to be had");
    EXPECT_EQ(text_of("a"), "old");
    EXPECT_EQ(names(), std::set<std::string>{"a"});
}

TEST_F(WholeFile, a_name_that_is_a_folder_is_refused_and_no_temporary_stays) {
    fs::create_directory(path("a"));
    std::ofstream(path("a/b")) << "inside";
    const Status done = write_whole_file(path("a"), "text");
    ASSERT_FALSE(done.ok());
    EXPECT_NE(done.error().message.find("cannot write '" + path("a") + "'"), std::string::npos);
    EXPECT_EQ(names(), std::set<std::string>{"a"});
    EXPECT_EQ(text_of("a/b"), "inside");
}

TEST_F(WholeFile, a_missing_folder_is_named_with_what_to_do) {
    const Status done = write_whole_file(path("missing/a"), "text");
    ASSERT_FALSE(done.ok());
    EXPECT_NE(done.error().message.find("check that the folder exists"), std::string::npos);
}
