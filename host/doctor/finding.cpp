// SPDX-License-Identifier: MIT
// Verdicts taken together, and figures and commands as text.
#include "doctor/finding.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>

namespace ols {

Finding skipped(Check check, std::string why, std::string subject) {
    return {check, std::move(subject), CheckVerdict::skipped, std::move(why), "", {}};
}

size_t count_of(const Findings& findings, CheckVerdict verdict) {
    return size_t(std::ranges::count(findings, verdict, &Finding::verdict));
}

int exit_code_of(const Findings& findings) {
    if (count_of(findings, CheckVerdict::fail) > 0) return 1;
    return count_of(findings, CheckVerdict::warn) > 0 ? 2 : 0;
}

std::string write_file_command(const std::string& path, const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) {
        assert(line.find('\'') == std::string::npos && line.find('%') == std::string::npos);
        text += line + "\\n";
    }
    return fmt::format("printf '{}' | sudo tee {}", text, path);
}

}  // namespace ols
