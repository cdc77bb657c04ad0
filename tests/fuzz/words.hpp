// SPDX-License-Identifier: MIT
// Text for readers of formats that are text: what a fuzzer would have to find letter by letter is a byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

// Bytes below 0x80 are themselves, those above stand for one of the words each.
inline std::string with_words(std::span<const uint8_t> bytes, std::span<const char* const> words) {
    std::string text;
    for (const uint8_t byte : bytes)
        if (byte >= 0x80)
            text += words[byte % words.size()];
        else
            text.push_back(char(byte));
    return text;
}
