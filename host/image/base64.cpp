// SPDX-License-Identifier: MIT
// Three bytes are four letters.
#include "image/base64.hpp"

#include <algorithm>
#include <cstring>

namespace ols {

namespace {

constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

}  // namespace

std::string base64_of(std::span<const uint8_t> bytes) {
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (size_t i = 0; i < bytes.size(); i += 3) {
        const size_t count = std::min<size_t>(3, bytes.size() - i);
        uint32_t group = 0;
        for (size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0);
        for (size_t k = 0; k < 4; ++k) text += k <= count ? letters[group >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

Result<std::string> bytes_of_base64(std::string_view text) {
    const Error wrong = fail("this is no base64");
    if (text.size() % 4 != 0) return wrong;
    std::string bytes;
    bytes.reserve(text.size() / 4 * 3);
    for (size_t i = 0; i < text.size(); i += 4) {
        size_t padding = 0;
        uint32_t group = 0;
        for (size_t k = 0; k < 4; ++k) {
            const char c = text[i + k];
            const char* const found = c ? std::strchr(letters, c) : nullptr;
            const bool may_pad = k >= 2 && i + 4 == text.size();
            if (c == '=' && may_pad)
                ++padding;
            else if (!found || padding > 0)
                return wrong;
            group = group << 6 | (found ? uint32_t(found - letters) : 0);
        }
        for (size_t k = 0; k < 3 - padding; ++k) bytes += char(group >> (16 - 8 * k) & 255);
    }
    return bytes;
}

}  // namespace ols
