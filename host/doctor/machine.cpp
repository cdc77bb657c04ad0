// SPDX-License-Identifier: MIT
// Files of the kernel (Linux, proc(5), sysfs(5)) and of /etc.
#include "doctor/machine.hpp"

#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

namespace ols {

namespace {

std::string trimmed(const std::string& text) {
    const size_t first = text.find_first_not_of(" \t\n"), last = text.find_last_not_of(" \t\n");
    return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

template <typename Number>
std::optional<Number> number_in(const std::string& text, int base = 10) {
    Number number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number, base);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return number;
}

// The value behind "key:" at the begin of a line.
std::optional<std::string> value_of(const std::optional<std::string>& text, const std::string& key) {
    for (const std::string& line : lines_in(text.value_or("")))
        if (line.starts_with(key + ":")) return trimmed(line.substr(key.size() + 1));
    return std::nullopt;
}

std::vector<std::string> split(const std::string& text, char separator) {
    std::vector<std::string> parts;
    std::istringstream stream(text);
    for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
    return parts;
}

}  // namespace

std::vector<std::string> words_in(const std::string& text) {
    std::istringstream stream(text);
    return {std::istream_iterator<std::string>(stream), {}};
}

std::vector<std::string> lines_in(const std::string& text) {
    return split(text, '\n');
}

std::optional<std::string> Machine::read(const std::string& path) const {
    std::ifstream file(place(path));
    std::string text{std::istreambuf_iterator<char>(file), {}};
    if (!file.is_open() || file.bad()) return std::nullopt;
    if (text.ends_with('\n')) text.pop_back();
    return text;
}

std::optional<int64_t> Machine::read_number(const std::string& path) const {
    const auto text = read(path);
    return text ? number_in<int64_t>(trimmed(*text)) : std::nullopt;
}

std::vector<std::string> Machine::list(const std::string& folder) const {
    std::vector<std::string> names;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(place(folder), error), end; !error && entry != end;
         entry.increment(error))
        names.push_back(entry->path().filename());
    std::ranges::sort(names);
    return names;
}

bool Machine::exists(const std::string& path) const {
    std::error_code error;
    return std::filesystem::exists(place(path), error);
}

std::optional<uint64_t> Machine::memory_bytes(const std::string& key) const {
    const auto words = words_in(value_of(read("/proc/meminfo"), key).value_or(""));
    if (words.size() != 2 || words[1] != "kB") return std::nullopt;
    const auto kib = number_in<uint64_t>(words[0]);
    return kib ? std::optional(*kib * 1024) : std::nullopt;
}

std::optional<std::string> Machine::process_status(const std::string& key) const {
    return value_of(read("/proc/self/status"), key);
}

// "Max locked memory         8388608              8388608              bytes"
std::optional<Limit> Machine::limit(const std::string& name) const {
    for (const std::string& line : lines_in(read("/proc/self/limits").value_or(""))) {
        if (!line.starts_with(name + " ")) continue;
        const auto words = words_in(line.substr(name.size()));
        if (words.size() < 2) return std::nullopt;
        const auto value = [](const std::string& word) {
            return word == "unlimited" ? std::optional(Limit::none) : number_in<uint64_t>(word);
        };
        const auto soft = value(words[0]), hard = value(words[1]);
        if (!soft || !hard) return std::nullopt;
        return Limit{*soft, *hard};
    }
    return std::nullopt;
}

// The second of the four numbers is the one in effect.
bool Machine::is_root() const {
    const auto ids = words_in(process_status("Uid").value_or(""));
    return ids.size() == 4 && ids[1] == "0";
}

bool Machine::has_capability(unsigned number) const {
    const auto bits = number_in<uint64_t>(process_status("CapEff").value_or(""), 16);
    return bits && (*bits >> number & 1);
}

std::set<std::string> Machine::groups() const {
    std::vector<std::string> ids = words_in(process_status("Groups").value_or(""));
    if (const auto own = words_in(process_status("Gid").value_or("")); own.size() == 4) ids.push_back(own[1]);
    std::set<std::string> names;
    for (const std::string& line : lines_in(read("/etc/group").value_or(""))) {
        const auto fields = split(line, ':');
        if (fields.size() >= 3 && std::ranges::find(ids, fields[2]) != ids.end()) names.insert(fields[0]);
    }
    return names;
}

bool Machine::is_member(const std::string& user, const std::string& group) const {
    for (const std::string& line : lines_in(read("/etc/group").value_or(""))) {
        const auto fields = split(line, ':');
        if (fields.size() < 4 || fields[0] != group) continue;
        const auto members = split(fields[3], ',');
        return std::ranges::find(members, user) != members.end();
    }
    return false;
}

std::string Machine::user() const {
    const auto ids = words_in(process_status("Uid").value_or(""));
    std::string id = ids.size() == 4 ? ids[1] : "";
    for (const std::string& line : lines_in(read("/etc/passwd").value_or(""))) {
        const auto fields = split(line, ':');
        if (fields.size() >= 3 && fields[2] == id) return fields[0];
    }
    return id;
}

bool Machine::may_open(const std::string& path) const {
    return ::access(place(path).c_str(), R_OK | W_OK) == 0;
}

std::optional<WallClock> Machine::wall_clock() const {
    timex clock{};  // modes 0: only asks
    if (::adjtimex(&clock) < 0) return std::nullopt;
    return WallClock{(clock.status & STA_UNSYNC) == 0, double(clock.maxerror) * 1e-6};
}

}  // namespace ols
