// SPDX-License-Identifier: MIT
// Files that are there whole or not at all: what is in the folder after each way of failing.
// links: ols_image
#include "image/whole_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "image/exr.hpp"
#include "image/line_file.hpp"

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

TEST_F(WholeFile, names_that_look_like_ours_are_left_alone) {
    const std::string stranger = "a.part" + std::to_string(getpid()) + "-0";
    std::ofstream(path(stranger)) << "a stranger's";
    ASSERT_TRUE(write_whole_file(path("a"), "new").ok());
    ASSERT_FALSE(write_whole_file(path("a"), write_half).ok());
    EXPECT_EQ(text_of("a"), "new");
    EXPECT_EQ(text_of(stranger), "a stranger's");
    EXPECT_EQ(names(), (std::set<std::string>{"a", stranger}));
}

TEST_F(WholeFile, a_name_of_the_greatest_length_can_be_written) {
    const std::string name(255, 'n');
    EXPECT_TRUE(write_whole_file(path(name), "text").ok());
    EXPECT_EQ(names(), std::set<std::string>{name});
}

namespace {

// Files may not grow beyond `bytes` while this lives, as on a disk that is full.
class FileLimit {
  public:
    explicit FileLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
        getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit limit{bytes, before_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~FileLimit() {
        setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }

  private:
    rlimit before_{};
    void (*handler_)(int);
};

}  // namespace

TEST_F(WholeFile, on_a_full_disk_nothing_is_written_and_the_error_says_why) {
    ASSERT_TRUE(write_whole_file(path("a"), "old").ok());
    // Small pictures stay in a stream's buffer until its end, where OpenEXR's own stream forgets errors.
    for (const auto& [width, bytes] : {std::pair{8, 100}, std::pair{400, 100'000}}) {
        Image image(width, width, 3);
        for (size_t i = 0; i < image.data.size(); ++i) image.data[i] = float(i * 2654435761u % 100'003);
        const FileLimit limit(bytes);
        const Status done = write_exr(path("a"), image, ExrType::single_float);
        ASSERT_FALSE(done.ok());
        EXPECT_NE(done.error().message.find("cannot write '" + path("a") + "'"), std::string::npos);
    }
    EXPECT_EQ(text_of("a"), "old");
    EXPECT_EQ(names(), std::set<std::string>{"a"});
}

TEST_F(WholeFile, a_folder_comes_with_all_that_was_put_into_it_or_not_at_all) {
    std::string seen;
    const auto fill = [&](const std::string& temporary) -> Status {
        seen = temporary;
        std::ofstream(temporary + "/x") << "x";
        return Done{};
    };
    fs::create_directory(path("f.part"));  // another's
    ASSERT_TRUE(make_whole_folder(path("f/"), fill).ok());
    EXPECT_EQ(text_of("f/x"), "x");
    EXPECT_FALSE(fs::exists(seen));
    ASSERT_FALSE(make_whole_folder(path("g"), [&](const std::string& temporary) -> Status {
                     if (const Status filled = fill(temporary); !filled) return filled;
                     return fail("no more");
                 }).ok());
    EXPECT_FALSE(make_whole_folder(path("f"), fill).ok());
    EXPECT_EQ(names(), (std::set<std::string>{"f", "f.part"}));
}

TEST_F(WholeFile, a_line_that_cannot_be_written_is_told_and_those_after_it_harm_nothing) {
    LineFile full("/dev/full");
    ASSERT_TRUE(full.status().ok());
    full.add("one");
    full.add("two");
    EXPECT_FALSE(full.status().ok());
    const Status done = full.finish();
    ASSERT_FALSE(done.ok());
    EXPECT_NE(done.error().message.find("/dev/full"), std::string::npos);
    EXPECT_FALSE(LineFile(path("missing/a")).status().ok());
}

TEST_F(WholeFile, each_line_is_there_when_add_returns) {
    LineFile account(path("account"));
    account.add("one");
    EXPECT_EQ(text_of("account"), "one\n");
    account.add("two");
    EXPECT_TRUE(account.finish().ok());
    EXPECT_EQ(text_of("account"), "one\ntwo\n");
    LineFile none("");
    none.add("one");
    EXPECT_TRUE(none.finish().ok());
}

TEST_F(WholeFile, an_exception_is_an_error_and_leaves_nothing_half_written) {
    ASSERT_TRUE(write_whole_file(path("a"), "old").ok());
    const auto give_up = [](const std::string& temporary) -> Status {
        std::ofstream(fs::is_directory(temporary) ? temporary + "/part" : temporary) << "half of";
        throw std::bad_alloc();
    };
    for (const Status& done : {write_whole_file(path("a"), give_up), make_whole_folder(path("b"), give_up)})
        EXPECT_NE(done.error().message.find("memory ran out"), std::string::npos);
    EXPECT_EQ(text_of("a"), "old");
    EXPECT_EQ(names(), std::set<std::string>{"a"});
}
