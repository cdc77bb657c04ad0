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

JournalWriter::JournalWriter(std::string path, int fd) : path_(std::move(path)), fd_(fd) {}
JournalWriter::JournalWriter(JournalWriter&& other) noexcept
    : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)), size_(other.size_), broken_(other.broken_) {}
JournalWriter::~JournalWriter() {
    if (fd_ >= 0) ::close(fd_);
}

Result<JournalWriter> JournalWriter::create(const std::string& path) {
    const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
    if (fd < 0) return disk_error("make", path, errno);
    JournalWriter writer(path, fd);
    if (const auto synced = sync_directory(std::filesystem::path(path).parent_path()); !synced) return synced.error();
    return writer;
}

Status JournalWriter::append(const nlohmann::json& line) {
    if (broken_) return fail("'" + path_ + "' could not be restored after a failed write: nothing more is added to it");
    // Text from outside may not be UTF-8; it is replaced, not thrown at.
    const std::string text = line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
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
        broken_ = ftruncate(fd_, size_) != 0;
        return disk_error("write", path_, error);
    }
    size_ += int64_t(text.size());
    return Done{};
}

namespace {

std::optional<TargetEntry> target_entry(const nlohmann::json& line, const std::string& event) {
    TargetEntry entry;
    entry.camera = line.at("camera").get<uint32_t>();
    entry.index = line.at("index").get<uint32_t>();
    if (event == "missing") {
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

}  // namespace ols
