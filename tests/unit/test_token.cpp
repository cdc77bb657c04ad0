// SPDX-License-Identifier: MIT
// The token's file, and its comparison.
// links: ols_daemon
#include "daemon/token.hpp"

#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "take_fixture.hpp"

namespace ols {
namespace {

class Token : public test::TakeDirectory {
  protected:
    void write(const std::string& text, mode_t mode = 0640) {
        std::ofstream(file) << text;
        chmod(file.c_str(), mode);
    }
    void SetUp() override {
        TakeDirectory::SetUp();
        file = directory + "/token";
    }
    std::string file;
};

TEST_F(Token, is_made_once_of_256_bits_for_owner_and_group_alone) {
    const auto first = token_of_file(file);
    ASSERT_TRUE(first) << first.error().message;
    EXPECT_EQ(first->size(), 64u);
    struct stat facts {};
    ASSERT_EQ(stat(file.c_str(), &facts), 0);
    EXPECT_EQ(facts.st_mode & 0777, 0640u & ~07u);
    EXPECT_EQ(*token_of_file(file), *first);
    std::filesystem::remove(file);
    EXPECT_NE(*token_of_file(file), *first);
}

TEST_F(Token, that_others_read_or_is_short_or_no_file_is_refused) {
    write(std::string(40, 'a') + "\n", 0644);
    EXPECT_FALSE(token_of_file(file));
    write(std::string(31, 'a'), 0600);
    EXPECT_FALSE(token_of_file(file));
    write("", 0600);
    EXPECT_FALSE(token_of_file(file));
    write(std::string(300, 'a'), 0600);
    EXPECT_FALSE(token_of_file(file));
    write(std::string(40, 'a') + "\n", 0600);
    EXPECT_EQ(*token_of_file(file), std::string(40, 'a'));
    std::filesystem::create_symlink(file, directory + "/link");
    EXPECT_FALSE(token_of_file(directory + "/link"));
    EXPECT_FALSE(token_of_file(directory));
    EXPECT_FALSE(token_of_file(directory + "/none/token"));
}

TEST_F(Token, no_other_text_is_one) {
    const std::string token(64, 'a');
    EXPECT_TRUE(is_token(token, token));
    for (size_t at = 0; at < token.size(); ++at) {
        std::string wrong = token;
        wrong[at] = 'b';
        EXPECT_FALSE(is_token(wrong, token));
        EXPECT_FALSE(is_token(token.substr(0, at), token));
    }
    EXPECT_FALSE(is_token(token + "a", token));
    EXPECT_FALSE(is_token(token + token, token));
    EXPECT_FALSE(is_token("", token));
}

}  // namespace
}  // namespace ols
