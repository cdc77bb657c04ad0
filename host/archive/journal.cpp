// SPDX-License-Identifier: MIT
// Appending to and reading of journals.
#include "archive/journal.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <utility>

#include "archive/target_file.hpp"

namespace ols {

nlohmann::json to_json(const Checksum& sum) {
    return {{"bytes", sum.bytes}, {"crc32", fmt::format("{:08x}", sum.crc32)}};
}

std::optional<Checksum> checksum_from_json(const nlohmann::json& json) {
    if (!json.is_object() || !json.contains("bytes") || !json["bytes"].is_number_unsigned()) return std::nullopt;
    if (!json.contains("crc32") || !json["crc32"].is_string()) return std::nullopt;
    const auto& digits = json["crc32"].get_ref<const std::string&>();
    Checksum sum{json["bytes"].get<uint64_t>(), 0};
    const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), sum.crc32, 16);
    if (digits.size() != 8 || parsed.ptr != digits.data() + digits.size()) return std::nullopt;
    return sum;
}

namespace {

// Some hundred short lines: targets that a full disk took, one by one or in runs, and the end.
constexpr int64_t room_set_aside = 64 << 10;

// Text from outside may not be UTF-8; it is replaced, not thrown at.
std::string text_of(const nlohmann::json& line) {
    return line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace

JournalWriter::JournalWriter(JournalWriter&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), size_(other.size_), broken_(other.broken_) {}
JournalWriter::~JournalWriter() {
    if (fd_ < 0) return;
    // Truncating a file to its size frees what lies behind it; where it does not, a few kilobytes stay taken.
    [[maybe_unused]] const int ignored = ftruncate(fd_, size_);
    ::close(fd_);
}

Result<JournalWriter> JournalWriter::create(const std::string& path) {
    JournalWriter writer(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644));
    if (writer.fd_ < 0) return disk_error("make", path, errno);
    if (const auto synced = sync_directory(std::filesystem::path(path).parent_path()); !synced) return synced.error();
    return writer;
}

Status JournalWriter::append(const nlohmann::json& line) {
    return append(text_of(line), room_set_aside);
}

Status JournalWriter::append_reserved(const nlohmann::json& line) {
    return append(text_of(line), 0);
}

Status JournalWriter::append(const std::string& text, int64_t left_aside) {
    if (broken_)
        return fail(std::string(journal_name) + " could not be restored after a failed write: it is left alone");
    if (left_aside > 0)
        if (const int full = reserve_room(fd_, size_, int64_t(text.size()) + left_aside); full != 0)
            return disk_error("write", journal_name, full);
    int error = 0;
    for (size_t done = 0; done < text.size() && error == 0;) {
        const ssize_t n = ::write(fd_, text.data() + done, text.size() - done);
        if (n > 0)
            done += size_t(n);
        else if (n < 0 && errno != EINTR)
            error = errno;
    }
    if (error == 0 && fsync(fd_) != 0) error = errno;
    if (error != 0) {
        // Shortening a file gives back the room behind it, too; it is taken again at once, as far as the disk has it.
        broken_ = ftruncate(fd_, size_) != 0;
        reserve_room(fd_, size_, room_set_aside);
        return disk_error("write", journal_name, error);
    }
    size_ += int64_t(text.size());
    return Done{};
}

namespace {

std::optional<TargetEntry> target_entry(const nlohmann::json& line, const std::string& event) {
    TargetEntry entry;
    entry.camera = line.at("camera").get<uint32_t>();
    entry.index = line.at("index").get<uint32_t>();
    entry.last = entry.index;
    if (event == "missing") {
        entry.last = line.value("through", entry.index);
        if (entry.last < entry.index) return std::nullopt;
        entry.why_missing = line.at("why").get<std::string>();
        entry.detail = line.value("detail", nlohmann::json::object());
        return entry;
    }
    const auto sum = checksum_from_json(line);
    entry.file = line.at("file").get<std::string>();
    // A journal that was tampered with must not lead out of the archive.
    const bool inside = entry.file == target_file_name(entry.camera, entry.index);
    if (!sum || !inside) return std::nullopt;
    entry.bytes = sum->bytes;
    entry.crc32 = sum->crc32;
    entry.detail = line.value("provenance", nlohmann::json::object());
    return entry;
}

// Takes one line in; false when it is no line of a journal.
bool take_line(const std::string& text, Journal& journal) {
    const auto line = nlohmann::json::parse(text, nullptr, false);
    if (!line.is_object()) return false;
    try {
        const auto event = line.at("event").get<std::string>();
        if (event == "begin") {
            journal.lights = checksum_from_json(line.at("lights"));
        } else if (event == "end") {
            journal.ended = true;
            journal.manifest = checksum_from_json(line.at("manifest"));
        } else if (event == "expect") {
            journal.expected[line.at("camera").get<uint32_t>()] = line.at("targets").get<uint32_t>();
        } else if (event == "target" || event == "missing") {
            const auto entry = target_entry(line, event);
            if (!entry) return false;
            journal.targets.push_back(*entry);
        }  // other events: a later version's, of no matter here
        return true;
    } catch (const nlohmann::json::exception&) {
        return false;
    }
}

}  // namespace

Result<Journal> read_journal(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) return disk_error("read", path, errno);
    Journal journal;
    std::string line;
    for (int number = 1; std::getline(file, line); ++number) {
        const bool torn = file.eof();  // the last line has no newline: its write was interrupted
        if (torn && line.empty()) break;
        if (torn) {
            journal.problems.push_back(
                fmt::format("{}:{}: the line is torn: what it noted was not finished", journal_name, number));
        } else if (!take_line(line, journal)) {
            journal.problems.push_back(
                fmt::format("{}:{}: not a line of a journal: it is damaged", journal_name, number));
        }
    }
    std::stable_sort(journal.targets.begin(), journal.targets.end(), [](const auto& a, const auto& b) {
        return std::pair(a.camera, a.index) < std::pair(b.camera, b.index);
    });
    return journal;
}

std::vector<TargetEntry> undecided_targets(const Journal& journal) {
    std::vector<TargetEntry> runs;
    for (const auto& [camera, count] : journal.expected) {
        uint64_t next = 0;  // everything before it is decided or in a run
        const auto add_run_to = [&, camera = camera](uint64_t end) {
            if (next >= end) return;
            TargetEntry run;
            run.camera = camera, run.index = uint32_t(next), run.last = uint32_t(end - 1);
            runs.push_back(std::move(run));
        };
        for (const auto& entry : journal.targets) {
            if (entry.camera != camera) continue;
            add_run_to(std::min(entry.index, count));
            next = std::max(next, uint64_t(entry.last) + 1);
        }
        add_run_to(count);
    }
    return runs;
}

}  // namespace ols
