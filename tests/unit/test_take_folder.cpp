// SPDX-License-Identifier: MIT
// Names of takes: what may be one, the next number, and that none leads anywhere else.
// links: ols_daemon
#include "daemon/take_folder.hpp"

#include <filesystem>

#include "take_fixture.hpp"

namespace ols {
namespace {

namespace fs = std::filesystem;

class Takes : public test::TakeDirectory {
  protected:
    void make(const std::string& name) { fs::create_directory(fs::path(directory) / (name + ".rfa")); }
};

TEST(Slate, is_a_part_of_a_file_name_and_nothing_else) {
    for (const char* good : {"1A", "scene 12", "a.b", "x_y-z", "0"}) EXPECT_TRUE(check_slate(good)) << good;
    for (const std::string& bad : {std::string(""), std::string("."), std::string(".."), std::string("a/b"),
                                   std::string("../a"), std::string("a\0b", 3), std::string("a\nb"), std::string("é"),
                                   std::string(" a"), std::string("a "), std::string(65, 'a'), std::string("a\\b"),
                                   std::string("~"), std::string("$(x)"), std::string("a;b"), std::string("a*")})
        EXPECT_FALSE(check_slate(bad)) << bad;
}

TEST_F(Takes, numbers_go_on_from_the_highest_of_the_slate) {
    const TakeFolder folder(directory);
    EXPECT_EQ(folder.next("12A", {})->text(), "12A_001");
    make("12A_001"), make("12A_009"), make("12_050"), make("12A_x"), make("12A_10b"), make("other_700");
    fs::create_directory(fs::path(directory) / "12A_500");  // not an archive's name
    EXPECT_EQ(folder.next("12A", {})->text(), "12A_010");
    EXPECT_EQ(folder.next("12", {})->text(), "12_051");
    EXPECT_EQ(folder.next("12A", 5)->text(), "12A_005");
    EXPECT_FALSE(folder.next("12A", 9));
    EXPECT_FALSE(folder.next("12A", 0));
    make("12A_9999");
    EXPECT_FALSE(folder.next("12A", {}));
}

TEST_F(Takes, a_name_that_is_none_is_not_looked_for) {
    const TakeFolder folder(directory + "/inside");
    fs::create_directory(directory + "/inside");
    make("outside_001");
    for (const char* name : {"../outside_001", "..", "", "/etc/passwd", "inside/../../outside_001"})
        EXPECT_FALSE(folder.find(name)) << name;
}

TEST_F(Takes, a_folder_that_cannot_be_read_is_an_error_that_names_it) {
    const TakeFolder folder(directory + "/none");
    const auto next = folder.next("a", {});
    ASSERT_FALSE(next);
    EXPECT_NE(next.error().message.find(directory + "/none"), std::string::npos);
    EXPECT_FALSE(folder.list(10));
    EXPECT_FALSE(folder.latest_target(""));
}

TEST_F(Takes, what_is_no_archive_is_listed_with_what_is_wrong) {
    make("bad_001");
    const auto list = TakeFolder(directory).list(10);
    ASSERT_TRUE(list);
    ASSERT_EQ(list->size(), 1u);
    EXPECT_NE((*list)[0]["state"], "finished");
}

TEST_F(Takes, the_latest_target_is_that_of_the_latest_take_that_has_one) {
    const auto write = [&](const std::string& name, int targets) {
        auto archive = ArchiveWriter::create(directory + "/" + name + ".rfa", test::take_info(3));
        ASSERT_TRUE(archive) << archive.error().message;
        for (int n = 0; n < targets; ++n)
            ASSERT_TRUE(archive->write_target(test::numbered_target(3, 8, 6, Cfa::none, uint32_t(n))));
        ASSERT_TRUE(archive->finish());
    };
    write("a_001", 3), write("b_001", 0);
    const auto latest = TakeFolder(directory).latest_target("");
    ASSERT_TRUE(latest) << latest.error().message;
    EXPECT_EQ(latest->index, 2u);
    EXPECT_NE(latest->archive.find("a_001"), std::string::npos);
    EXPECT_FALSE(TakeFolder(directory).latest_target("b_001"));
}

}  // namespace
}  // namespace ols
