// SPDX-License-Identifier: MIT
// Appending to journals.
#include "archive/journal.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <utility>

#include "image/json_object.hpp"

namespace ols {

nlohmann::json to_json(const Checksum& sum) {
    return {{"bytes", sum.bytes}, {"crc32", hex_of(sum.crc32)}};
}

std::string chain_text(uint32_t crc32) {
    return ",\"chain\":\"" + hex_of(crc32) + "\"}";
}

namespace {

// Some hundred short lines: targets that a full disk took, one by one or in runs, and the end.
constexpr int64_t room_set_aside = 64 << 10;

}  // namespace

JournalWriter::JournalWriter(JournalWriter&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), size_(other.size_), crc32_(other.crc32_), broken_(other.broken_) {}
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
    return append(json_line(line), room_set_aside);
}

Status JournalWriter::append_reserved(const nlohmann::json& line) {
    return append(json_line(line), 0);
}

Status JournalWriter::append(std::string text, int64_t left_aside) {
    text.pop_back();  // the brace that the chain closes
    text += chain_text(crc32_of(crc32_, text.data(), text.size())) + "\n";
    if (broken_)
        return fail(fmt::format("{} could not be restored after a failed write: it is left alone", journal_name));
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
    crc32_ = crc32_of(crc32_, text.data(), text.size());
    return Done{};
}

}  // namespace ols
