// SPDX-License-Identifier: MIT
// Reading and writing of levels as text.
#include "stage/basis_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <sstream>

#include "image/input_file.hpp"
#include "image/whole_file.hpp"
#include "stage/basis_inverse.hpp"
#include "wire.h"

namespace ols {

namespace {

constexpr int level_limit = 255;
constexpr size_t line_bytes_max = 64 * 1024;   // 255 and a comma for each of 256 lamps take 1 KB
constexpr uint64_t file_bytes_max = 16 << 20;  // 1024 rows take 1 MB; comments may be long

struct Lines {
    std::string path;
    int number = 0;

    Error error(const std::string& what) const { return fail(fmt::format("{}:{}: {}", path, number, what)); }
};

std::optional<int> whole_number(const std::string& word) {
    int value = 0;
    const auto parsed = std::from_chars(word.data(), word.data() + word.size(), value);
    if (parsed.ec != std::errc() || parsed.ptr != word.data() + word.size()) return std::nullopt;
    return value;
}

std::vector<std::string> words_of(std::string line) {
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == ',' || c == ';' || c == '=' || c == '\r'; }, ' ');
    std::istringstream stream(line);
    std::vector<std::string> words;
    for (std::string word; stream >> word;) words.push_back(word);
    return words;
}

// A level that is missing between commas must not let those behind it slip to other lamps.
bool has_empty_cell(const std::string& line) {
    constexpr const char* commas = ",;";
    if (line.find_first_of(commas) == std::string::npos) return false;
    for (size_t begin = 0;;) {
        const size_t end = line.find_first_of(commas, begin);
        if (line.find_first_not_of(" \t\r", begin) >= end) return true;
        if (end == std::string::npos) return false;
        begin = end + 1;
    }
}

// The text with \n at its lines' ends (old Mac files have \r alone) and without a byte order mark.
Result<std::string> read_text(const std::string& path) {
    auto text = read_input(path, "basis file", file_bytes_max);
    if (!text.ok()) return text;
    if (text->starts_with("\xff\xfe") || text->starts_with("\xfe\xff"))
        return fail(path + ": is UTF-16 text: save it as UTF-8 or as plain CSV");
    if (text->starts_with("\xef\xbb\xbf")) text->erase(0, 3);
    if (text->find('\n') == std::string::npos) std::replace(text->begin(), text->end(), '\r', '\n');
    return text;
}

// The next line without its end; false at the end of the file.
Result<bool> next_line(std::istream& file, Lines& at, std::string& line) {
    at.number++;
    if (!std::getline(file, line)) return false;
    if (line.size() >= line_bytes_max)
        return at.error(fmt::format("a line of more than {} bytes is no row of levels", line_bytes_max - 1));
    return true;
}

// `# level_max = N`; other comments say nothing.
Status read_comment(const Lines& at, const std::string& line, int& level_max) {
    const auto words = words_of(line.substr(1));
    if (words.size() != 2 || words[0] != "level_max") return Done{};
    const auto value = whole_number(words[1]);
    if (!value || *value < 1 || *value > level_limit || (*value & (*value + 1)) != 0)
        return at.error(fmt::format("level_max '{:.20}' is none of 1, 3, 7 ... 255", words[1]));
    level_max = *value;
    return Done{};
}

Status read_row(const Lines& at, const std::vector<std::string>& words, Basis& basis) {
    if (basis.rows == OLS_SLOTS_MAX)
        return at.error(fmt::format("more rows than the {} slots that the board plays: remove some", OLS_SLOTS_MAX));
    if (int(words.size()) != basis.lamps)
        return at.error(fmt::format("{} levels where the stage has {} lamps on its sphere", words.size(), basis.lamps));
    for (const auto& word : words) {
        const auto value = whole_number(word);
        if (!value || *value < 0 || *value > level_limit)
            return at.error(fmt::format("'{:.20}' is no level: give whole numbers from 0 to {}", word, level_limit));
        basis.levels.push_back(uint8_t(*value));
    }
    basis.rows++;
    return Done{};
}

}  // namespace

Result<Basis> read_basis(const std::string& path, int lamps) {
    auto text = read_text(path);
    if (!text.ok()) return text.error();
    std::istringstream file(std::move(*text));
    Basis basis;
    basis.name = std::filesystem::path(path).stem().string();
    basis.lamps = lamps;
    int stated_max = 0;
    Lines at{path};
    for (std::string line;;) {
        const auto more = next_line(file, at, line);
        if (!more.ok()) return more.error();
        if (!*more) break;
        if (line.starts_with('#')) {
            if (const Status status = read_comment(at, line, stated_max); !status.ok()) return status.error();
            continue;
        }
        const auto words = words_of(line);
        if (words.empty() && !has_empty_cell(line)) continue;
        if (has_empty_cell(line)) return at.error("an empty cell: give every lamp a level");
        if (const Status status = read_row(at, words, basis); !status.ok()) return status.error();
    }
    if (basis.rows == 0) return fail(path + ": no rows of levels in it");
    const int highest = *std::max_element(basis.levels.begin(), basis.levels.end());
    basis.level_max = stated_max ? stated_max : highest > 1 ? level_limit : 1;
    if (highest > basis.level_max)
        return fail(fmt::format("{}: level {} is above its level_max of {}", path, highest, basis.level_max));
    auto inverted = with_least_squares(std::move(basis));
    if (!inverted.ok()) return fail(path + ": " + inverted.error().message);
    return inverted;
}

std::string basis_text(const Basis& basis, const std::string& comment) {
    std::string text;
    std::istringstream lines(comment);
    for (std::string line; std::getline(lines, line);) text += "# " + line + "\n";
    text += fmt::format("# level_max = {}\n", basis.level_max);
    for (int r = 0; r < basis.rows; ++r)
        for (int lamp = 0; lamp < basis.lamps; ++lamp)
            text += fmt::format("{}{}", basis.level(r, lamp), lamp + 1 < basis.lamps ? "," : "\n");
    return text;
}

Status write_basis(const std::string& path, const Basis& basis, const std::string& comment) {
    return write_whole_file(path, basis_text(basis, comment));
}

}  // namespace ols
