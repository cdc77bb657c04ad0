// SPDX-License-Identifier: MIT
// Base64 against the vectors of RFC 4648, section 10.
// links: ols_image
#include "image/base64.hpp"

#include <gtest/gtest.h>

namespace ols {
namespace {

std::string encoded(const std::string& text) {
    return base64_of({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

TEST(Base64, is_that_of_the_rfc_in_both_directions) {
    const std::pair<const char*, const char*> vectors[] = {{"", ""},
                                                           {"f", "Zg=="},
                                                           {"fo", "Zm8="},
                                                           {"foo", "Zm9v"},
                                                           {"foob", "Zm9vYg=="},
                                                           {"fooba", "Zm9vYmE="},
                                                           {"foobar", "Zm9vYmFy"}};
    for (const auto& [text, letters] : vectors) {
        EXPECT_EQ(encoded(text), letters);
        EXPECT_EQ(*bytes_of_base64(letters), text);
    }
    std::string all;
    for (int n = 0; n < 1000; ++n) all += char(n * 37);
    EXPECT_EQ(*bytes_of_base64(encoded(all)), all);
}

TEST(Base64, other_text_is_refused) {
    for (const char* wrong : {"Z", "Zg=", "Zg==Zg==", "=Zg=", "Zm9*", "Zm 9", "Zg=a", "===="})
        EXPECT_FALSE(bytes_of_base64(wrong)) << wrong;
    EXPECT_FALSE(bytes_of_base64(std::string_view("Zm\0v", 4)));
}

}  // namespace
}  // namespace ols
