// SPDX-License-Identifier: MIT
// Outputs against inputs, against one another and against archives: what each refusal says, and that nothing was touched.
// links: ols_image
#include "image/outputs.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "image/whole_file.hpp"

using namespace ols;
namespace fs = std::filesystem;

namespace {

class OutputFiles : public testing::Test {
  protected:
    void SetUp() override {
        folder_ = fs::temp_directory_path() / ("outputs" + std::to_string(getpid()));
        fs::create_directories(folder_ / "take.rfa/cam0");
        for (const char* name : {"take.rfa/manifest.json", "take.rfa/journal.jsonl", "take.rfa/cam0/target.exr", "map"})
            std::ofstream(folder_ / name) << "contents of " << name;
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string path(const std::string& name) const { return folder_ / name; }
    // What is refused, and the words of the refusal.
    void expect_refused(const Outputs& outputs, const std::string& words) const {
        const Status checked = check_outputs(outputs);
        ASSERT_FALSE(checked.ok());
        EXPECT_NE(checked.error().message.find(words), std::string::npos) << checked.error().message;
    }

  private:
    fs::path folder_;
};

}  // namespace

TEST_F(OutputFiles, new_files_and_older_ones_that_nobody_reads_are_welcome) {
    std::ofstream(path("old")) << "old";
    const Status checked = check_outputs({.inputs = {path("take.rfa"), path("map"), path("no file"), ""},
                                          .files = {path("old"), path("new"), ""},
                                          .folders = {path("lamps"), path("more/")},
                                          .streams = {path("account"), "/dev/null"}});
    EXPECT_TRUE(checked.ok()) << checked.error().message;
}

TEST_F(OutputFiles, an_input_is_refused_by_each_of_its_names) {
    fs::create_symlink(path("map"), path("link"));
    fs::create_hard_link(path("map"), path("hard"));
    for (const auto& name : {path("map"), path("./take.rfa/../map"), path("link"), path("hard")})
        expect_refused({.inputs = {path("map")}, .files = {name}}, "which is read");
    expect_refused({.inputs = {path("map")}, .streams = {path("link")}}, "which is read");
    expect_refused({.inputs = {path("link")}, .files = {path("map")}}, "which is read");
}

TEST_F(OutputFiles, a_file_of_a_folder_that_is_read_is_refused_by_its_hard_link) {
    fs::create_hard_link(path("take.rfa/cam0/target.exr"), path("hard.exr"));
    expect_refused({.inputs = {path("take.rfa")}, .files = {path("hard.exr")}}, "take.rfa/cam0/target.exr");
}

TEST_F(OutputFiles, nothing_is_put_into_an_archive_whether_it_is_read_or_not) {
    fs::create_directory_symlink(path("take.rfa/cam0"), path("elsewhere"));
    for (const auto& name : {path("take.rfa/manifest.json"), path("take.rfa/cam0/new.exr"), path("elsewhere/new.exr"),
                             path("take.rfa/../take.rfa/new"), path("elsewhere/../manifest.json")}) {
        expect_refused({.files = {name}}, "archive");
        expect_refused({.folders = {name + "_folder"}}, "archive");
        expect_refused({.streams = {name}}, "archive");
        EXPECT_FALSE(write_whole_file(name, "damage").ok());
    }
    EXPECT_FALSE(make_whole_folder(path("take.rfa/lamps"), [](const std::string&) { return Done{}; }).ok());
    std::string text;
    std::getline(std::ifstream(path("take.rfa/manifest.json")), text);
    EXPECT_EQ(text, "contents of take.rfa/manifest.json");
    EXPECT_EQ(std::distance(fs::directory_iterator(path("take.rfa/cam0")), {}), 1);
}

TEST_F(OutputFiles, two_outputs_of_one_name_are_refused_before_there_is_a_file) {
    expect_refused({.files = {path("x"), path("x")}}, "they are one file");
    expect_refused({.files = {path("x"), path("take.rfa/../x")}}, "they are one file");
    fs::create_directory_symlink(path("."), path("here"));
    expect_refused({.files = {path("x")}, .streams = {path("here/x")}}, "they are one file");
    expect_refused({.files = {path("x")}, .folders = {path("x/")}}, "they are one file");
}

TEST_F(OutputFiles, what_is_no_regular_file_stays_and_is_called_by_its_kind) {
    ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
    fs::create_symlink(path("gone"), path("dangling"));
    fs::create_symlink("/dev/null", path("to_device"));
    const std::pair<std::string, std::string> kinds[] = {{path("take.rfa"), "a folder"},
                                                         {path("pipe"), "a pipe"},
                                                         {"/dev/null", "a device"},
                                                         {path("to_device"), "a device"},
                                                         {path("dangling"), "leads nowhere"}};
    for (const auto& [name, kind] : kinds) {
        expect_refused({.files = {name}}, kind);
        const Status written = write_whole_file(name, "text");
        ASSERT_FALSE(written.ok());
        EXPECT_NE(written.error().message.find(kind), std::string::npos) << written.error().message;
    }
    EXPECT_TRUE(fs::is_fifo(path("pipe")));
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    EXPECT_TRUE(fs::is_symlink(fs::symlink_status(path("dangling"))));
}

TEST_F(OutputFiles, a_link_is_followed_and_stays_a_link) {
    fs::create_directory(path("disk"));
    std::ofstream(path("disk/file")) << "old";
    fs::create_symlink(path("disk/file"), path("link"));
    ASSERT_TRUE(write_whole_file(path("link"), "new").ok());
    std::string text;
    std::getline(std::ifstream(path("disk/file")), text);
    EXPECT_EQ(text, "new");
    EXPECT_TRUE(fs::is_symlink(fs::symlink_status(path("link"))));
}

TEST_F(OutputFiles, a_folder_that_exists_or_has_nowhere_to_go_is_refused) {
    expect_refused({.folders = {path("take.rfa/..")}}, "exists");
    expect_refused({.folders = {path("nowhere/lamps")}}, "check that the folder exists");
    expect_refused({.files = {path("nowhere/x.exr")}}, "check that the folder exists");
}
