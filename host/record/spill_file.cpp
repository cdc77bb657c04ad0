// SPDX-License-Identifier: MIT
// Records in a nameless file, by pwrite and pread.
#include "record/spill_file.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "image/nameless_file.hpp"

namespace ols {

namespace {

// 0, or the error number.
int write_at(int fd, std::span<const std::byte> bytes, uint64_t offset) {
    while (!bytes.empty()) {
        const ssize_t n = ::pwrite(fd, bytes.data(), bytes.size(), off_t(offset));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return n < 0 ? errno : ENOSPC;
        bytes = bytes.subspan(size_t(n));
        offset += uint64_t(n);
    }
    return 0;
}

int read_at(int fd, std::span<std::byte> bytes, uint64_t offset) {
    while (!bytes.empty()) {
        const ssize_t n = ::pread(fd, bytes.data(), bytes.size(), off_t(offset));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return n < 0 ? errno : EIO;  // the file is shorter than what was written
        bytes = bytes.subspan(size_t(n));
        offset += uint64_t(n);
    }
    return 0;
}

}  // namespace

Result<std::shared_ptr<SpillFile>> SpillFile::create(const std::string& folder, uint64_t bytes_max) {
    const int fd = open_nameless_file(folder);
    if (fd < 0)
        return fail(fmt::format("no frames can be spilled to '{}': {}; choose a folder on a disk that may be written",
                                folder, std::strerror(errno)));
    return std::shared_ptr<SpillFile>(new SpillFile(fd, folder, bytes_max));
}

SpillFile::~SpillFile() {
    ::close(fd_);
}

bool SpillFile::has_room(uint64_t bytes) const {
    const std::lock_guard lock(mutex_);
    if (!problem_.empty()) return false;
    const auto free = free_.find(bytes);
    return (free != free_.end() && !free->second.empty()) || bytes_max_ == 0 || end_ + bytes <= bytes_max_;
}

Error SpillFile::disk_failed(const std::string& action, int error) const {
    const std::lock_guard lock(mutex_);
    std::string why = fmt::format("{} '{}', with {} MB there: {}", action, folder_, end_ >> 20, std::strerror(error));
    why += error == ENOSPC || error == EDQUOT ? "; free space there, or spill to a larger disk"
                                              : "; check that disk and its cable, or spill to another";
    if (problem_.empty()) problem_ = why;
    return fail(why);
}

std::optional<uint64_t> SpillFile::take_room(uint64_t bytes) {
    const std::lock_guard lock(mutex_);
    if (!problem_.empty()) return std::nullopt;
    std::vector<uint64_t>& free = free_[bytes];
    const auto earliest = std::ranges::min_element(free);
    if (earliest == free.end()) {
        if (bytes_max_ > 0 && end_ + bytes > bytes_max_) return std::nullopt;
        end_ += bytes;
        return end_ - bytes;
    }
    const uint64_t offset = std::exchange(*earliest, free.back());
    free.pop_back();
    return offset;
}

Result<SpillFile::Place> SpillFile::write(std::span<const std::byte> bytes) {
    const auto offset = take_room(bytes.size());
    if (!offset) return fail("no more frames are spilled");
    const Place place{*offset, bytes.size(), XXH3_64bits(bytes.data(), bytes.size())};
    const int error = write_at(fd_, bytes, place.offset);
    if (error == 0) return place;
    give_back(place);
    return disk_failed("frames cannot be spilled to", error);
}

Status SpillFile::read(const Place& place, std::span<std::byte> into) const {
    if (const int error = read_at(fd_, into, place.offset); error != 0)
        return disk_failed("spilled frames cannot be read from", error);
    if (XXH3_64bits(into.data(), into.size()) != place.hash) {
        const std::lock_guard lock(mutex_);
        const std::string why =
            fmt::format("the disk at '{}' gave other samples than were written to it: do not trust it", folder_);
        if (problem_.empty()) problem_ = why;
        return fail(why);
    }
    return Done{};
}

void SpillFile::give_back(const Place& place) {
    const std::lock_guard lock(mutex_);
    free_[place.bytes].push_back(place.offset);
}

std::string SpillFile::problem() const {
    const std::lock_guard lock(mutex_);
    return problem_;
}

}  // namespace ols
