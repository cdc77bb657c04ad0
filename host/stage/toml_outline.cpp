// SPDX-License-Identifier: MIT
// Outside of texts and comments it counts open brackets, and dots since the last thing that ends a key (TOML 1.0, "Keys", "String").
#include "stage/toml_outline.hpp"

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

bool begins_key(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '"' || c == '\'';
}

// Whether the line whose first bracket is at `at` names a table: [key or [[key.
bool is_header(std::string_view text, size_t at) {
    at += text.substr(at, 2) == "[[" ? 2 : 1;
    at = text.find_first_not_of(" \t", at);
    return at != text.npos && begins_key(text[at]);
}

}  // namespace

Status check_toml_outline(const std::string& path, std::string_view text) {
    int brackets = 0, dots = 0;
    bool begins_line = true;
    const auto wrong = [&](size_t at, const std::string& what) {
        return fail(fmt::format("{}:{}: {}", path,
                                1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(at), '\n'), what));
    };
    for (size_t i = text.starts_with("\xef\xbb\xbf") ? 3 : 0; i < text.size();) {
        const char c = text[i];
        if (c == '"' || c == '\'') {
            i = end_of_quoted(text, i);
            begins_line = false;
            continue;
        }
        if (c == '#') {
            i = std::min(text.find('\n', i), text.size());
            continue;
        }
        if ((c & 0x80) != 0)
            return wrong(i, "letters beyond ASCII stand in quotes, also in keys (and the file is UTF-8)");
        if (c == '[' && begins_line && brackets == 0 && !is_header(text, i))
            return wrong(i, "a bracket begins the line and no name of a table follows");
        if (c == '[' || c == '{') ++brackets;
        if (c == ']' || c == '}') brackets = std::max(0, brackets - 1);
        if (c == '.') ++dots;
        if (std::string_view("[]{},=\n").find(c) != std::string_view::npos) dots = 0;
        if (brackets > toml_brackets_max || dots > toml_dots_max)
            return wrong(i, fmt::format("nests deeper than the {} brackets and {} dots that any of our files needs",
                                        toml_brackets_max, toml_dots_max));
        begins_line = c == '\n' || (begins_line && (c == ' ' || c == '\t'));
        ++i;
    }
    return Done{};
}

}  // namespace ols
