// SPDX-License-Identifier: MIT
// Counts open brackets, and dots since the last thing that ends a key, outside of texts and comments (TOML 1.0, "Keys", "String").
#include "stage/toml_depth.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ols {

namespace {

// Where the text that begins with the quote at `at` ends; the end of `text` if it does not.
size_t end_of_quoted(std::string_view text, size_t at) {
    const char quote = text[at];
    const std::string_view triple = quote == '"' ? R"(""")" : "'''";
    const bool many_lines = text.substr(at, 3) == triple;
    for (size_t i = at + (many_lines ? 3 : 1); i < text.size(); ++i) {
        if (quote == '"' && text[i] == '\\') {
            ++i;
        } else if (many_lines && text.substr(i, 3) == triple) {
            i += 3;
            // Up to two quotes may stand before the three that end it.
            while (i < text.size() && text[i] == quote) ++i;
            return i;
        } else if (!many_lines && (text[i] == quote || text[i] == '\n')) {
            return text[i] == quote ? i + 1 : i;
        }
    }
    return text.size();
}

}  // namespace

Status check_toml_depth(const std::string& path, std::string_view text) {
    int brackets = 0, dots = 0;
    for (size_t i = 0; i < text.size();) {
        const char c = text[i];
        if (c == '"' || c == '\'') {
            i = end_of_quoted(text, i);
            continue;
        }
        if (c == '#') {
            i = std::min(text.find('\n', i), text.size());
            continue;
        }
        if (c == '[' || c == '{') ++brackets;
        if (c == ']' || c == '}') brackets = std::max(0, brackets - 1);
        if (c == '.') ++dots;
        if (std::string_view("[]{},=\n").find(c) != std::string_view::npos) dots = 0;
        if (brackets > toml_brackets_max || dots > toml_dots_max)
            return fail(fmt::format("{}:{}: nests deeper than the {} brackets and {} dots that any of our files needs",
                                    path, 1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(i), '\n'),
                                    toml_brackets_max, toml_dots_max));
        ++i;
    }
    return Done{};
}

}  // namespace ols
