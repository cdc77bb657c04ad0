// SPDX-License-Identifier: MIT
// std::from_chars, and what it leaves out: plus signs, and numbers too small for a double.
#include "scene/numbers.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>

namespace ols {

namespace {

// What follows a plus sign; nothing stays of a word with two signs.
std::string_view without_plus(std::string_view word) {
    if (!word.starts_with('+')) return word;
    word.remove_prefix(1);
    return word.starts_with('-') || word.starts_with('+') ? std::string_view() : word;
}

}  // namespace

std::vector<std::string_view> words_of(std::string_view line) {
    constexpr const char* blanks = " \t\v\f";
    std::vector<std::string_view> words;
    for (size_t i = 0; (i = line.find_first_not_of(blanks, i)) != line.npos;) {
        const size_t end = std::min(line.find_first_of(blanks, i), line.size());
        words.push_back(line.substr(i, end - i));
        i = end;
    }
    return words;
}

std::optional<double> decimal_number(std::string_view word) {
    word = without_plus(word);
    double value = 0;
    const char* end = word.data() + word.size();
    const auto parsed = std::from_chars(word.data(), end, value);
    if (parsed.ptr != end) return std::nullopt;
    if (parsed.ec == std::errc::result_out_of_range)
        value = std::strtod(std::string(word).c_str(), nullptr);
    else if (parsed.ec != std::errc())
        return std::nullopt;
    if (!std::isfinite(value)) return std::nullopt;
    return value;
}

std::optional<int64_t> whole_number(std::string_view word) {
    word = without_plus(word);
    int64_t value = 0;
    const char* end = word.data() + word.size();
    const auto parsed = std::from_chars(word.data(), end, value);
    if (parsed.ec != std::errc() || parsed.ptr != end) return std::nullopt;
    return value;
}

}  // namespace ols
