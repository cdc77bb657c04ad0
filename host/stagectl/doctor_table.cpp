// SPDX-License-Identifier: MIT
// Columns, wrapped lines, and a sum at the end, where a terminal shows it.
#include "stagectl/doctor_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "doctor/machine.hpp"

namespace ols {

namespace {

constexpr size_t line_columns = 110;
constexpr int verdict_columns = 8;
// By CheckVerdict: green, yellow, red and bold, grey (ECMA-48, SGR).
constexpr const char* colours[] = {"\033[32m", "\033[33m", "\033[1;31m", "\033[90m"};
constexpr const char* plain = "\033[0m";

// Breaks between words; every line but the first is indented.
std::string wrapped(const std::string& text, size_t indent, size_t first_column) {
    std::string lines;
    size_t column = first_column;
    for (const std::string& word : words_in(text)) {
        if (column > indent && column + 1 + word.size() > line_columns) {
            lines += "\n" + std::string(indent, ' ');
            column = indent;
        } else if (!lines.empty()) {
            lines += ' ';
            ++column;
        }
        lines += word;
        column += word.size();
    }
    return lines;
}

std::string title_of(const Finding& finding) {
    return std::string(finding.id()) + (finding.subject.empty() ? "" : " (" + finding.subject + ")");
}

std::string row_of(const Finding& finding, size_t title_columns, bool is_coloured, std::set<std::string>& said) {
    const auto verdict = size_t(finding.verdict);
    const std::string title = title_of(finding);
    const size_t indent = verdict_columns + title_columns + 2;
    std::string row = fmt::format("{}{:<{}}{}{:<{}}  {}\n", is_coloured ? colours[verdict] : "", verdict_names[verdict],
                                  verdict_columns, is_coloured ? plain : "", title, title_columns,
                                  wrapped(finding.found, indent, std::max(indent, verdict_columns + title.size() + 2)));
    if (finding.verdict != CheckVerdict::warn && finding.verdict != CheckVerdict::fail) return row;
    constexpr size_t below = verdict_columns + 8;
    row += fmt::format("{:{}}needed: {}\n", "", verdict_columns, wrapped(finding.needed, below, below));
    bool is_repeated = false;
    for (const std::string& command : finding.commands) {
        if (said.insert(command).second)
            row += fmt::format("{:{}}type:   {}\n", "", verdict_columns, command);  // whole, to be copied
        else
            is_repeated = true;
    }
    if (is_repeated) row += fmt::format("{:{}}type:   what stands above\n", "", verdict_columns);
    return row;
}

}  // namespace

std::string doctor_table(const Findings& findings, bool is_coloured) {
    size_t title_columns = 0;
    for (const Finding& finding : findings)
        if (const size_t size = title_of(finding).size(); size <= 40) title_columns = std::max(title_columns, size);
    std::string table;
    std::set<std::string> said;
    for (const Finding& finding : findings) table += row_of(finding, title_columns, is_coloured, said);
    const auto counted = [&findings](CheckVerdict verdict, const char* word) {
        const size_t count = count_of(findings, verdict);
        return fmt::format("{} {}{}", count, word, count == 1 ? "" : "s");
    };
    return table + fmt::format("\n{} ok, {}, {}, {} not checked\n", count_of(findings, CheckVerdict::ok),
                               counted(CheckVerdict::warn, "warning"), counted(CheckVerdict::fail, "failure"),
                               count_of(findings, CheckVerdict::skipped));
}

nlohmann::json doctor_json(const Findings& findings) {
    auto checks = nlohmann::json::array();
    for (const Finding& finding : findings)
        checks.push_back({{"id", finding.id()},
                          {"subject", finding.subject},
                          {"status", verdict_names[size_t(finding.verdict)]},
                          {"found", finding.found},
                          {"needed", finding.needed},
                          {"commands", finding.commands}});
    nlohmann::json counts = nlohmann::json::object();
    for (size_t n = 0; n < verdict_names.size(); ++n)
        counts[std::string(verdict_names[n])] = count_of(findings, CheckVerdict(n));
    return {{"checks", checks}, {"counts", counts}};
}

}  // namespace ols
