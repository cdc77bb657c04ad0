// SPDX-License-Identifier: MIT
// Durable files with plain system calls: the order of write, fsync, rename, fsync of the directory is the point.
#include "archive/disk.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <libdeflate.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <utility>

#include "archive/archive_file.hpp"

namespace ols {

Error disk_error(const std::string& action, const std::string& path, int error_number) {
    std::string remedy;
    if (error_number == ENOSPC || error_number == EDQUOT) remedy = ": free space there or choose another disk";
    if (error_number == EIO || error_number == EROFS)
        remedy = ": the disk fails: check it and its cable, or choose another disk";
    if (error_number == EFBIG) remedy = ": the file system or a limit (ulimit -f) allows no larger file";
    return fail("cannot " + action + " '" + path + "': " + std::strerror(error_number) + remedy);
}

Status sync_directory(const std::string& path) {
    const std::string name = path.empty() ? "." : path;
    const int fd = ::open(name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return disk_error("open directory", name, errno);
    const int error = fsync(fd) == 0 ? 0 : errno;
    ::close(fd);
    // Some network and FUSE file systems cannot sync directories; there is nothing more to be had from those.
    if (error != 0 && error != EINVAL) return disk_error("sync directory", name, error);
    return Done{};
}

Status rename_durably(const std::string& from, const std::string& to) {
    if (rename(from.c_str(), to.c_str()) != 0) return disk_error("rename a finished file to", to, errno);
    return sync_directory(std::filesystem::path(to).parent_path());
}

namespace {

// 0, or the error number of the write that failed.
int write_all(int fd, const std::string& text) {
    for (size_t done = 0; done < text.size();) {
        const ssize_t n = ::write(fd, text.data() + done, text.size() - done);
        if (n > 0)
            done += size_t(n);
        else if (n < 0 && errno != EINTR)
            return errno;
    }
    return 0;
}

}  // namespace

Status write_file_durably(const std::string& path, const std::string& text) {
    auto file = ReservedFile::create(path, 0);
    if (!file) return file.error();
    return file->write(path, text);
}

int reserve_room(int fd, int64_t size, int64_t bytes) {
    if (bytes == 0 || fallocate(fd, FALLOC_FL_KEEP_SIZE, size, bytes) == 0) return 0;
    // Full disks only; others cannot do it, or a limit of the process forbids what may never be needed.
    return errno == ENOSPC || errno == EDQUOT || errno == EIO ? errno : 0;
}

ReservedFile::ReservedFile(ReservedFile&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
ReservedFile::~ReservedFile() {
    if (fd_ >= 0) ::close(fd_);
}

Result<ReservedFile> ReservedFile::create(const std::string& path, int64_t bytes) {
    const std::string name = path + unfinished_suffix;
    ReservedFile file(::open(name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (file.fd_ < 0) return disk_error("write", path, errno);
    if (const int error = reserve_room(file.fd_, 0, bytes); error != 0) {
        unlink(name.c_str());
        return disk_error("set room aside for", path, error);
    }
    return file;
}

Status ReservedFile::write(const std::string& path, const std::string& text) {
    const std::string name = path + unfinished_suffix;
    int error = write_all(fd_, text);
    if (error == 0 && ftruncate(fd_, off_t(text.size())) != 0) error = errno;  // the room that is left is given back
    if (error == 0 && fsync(fd_) != 0) error = errno;
    if (::close(std::exchange(fd_, -1)) != 0 && error == 0) error = errno;
    if (error != 0) {
        unlink(name.c_str());
        return disk_error("write", path, error);
    }
    return rename_durably(name, path);
}

std::string hex_of(uint32_t crc32) {
    return fmt::format("{:08x}", crc32);
}

std::optional<uint32_t> crc32_from_hex(std::string_view digits) {
    if (digits.size() != 8 || digits.find_first_not_of("0123456789abcdef") != digits.npos) return std::nullopt;
    uint32_t crc32 = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), crc32, 16);
    return crc32;
}

uint32_t crc32_of(uint32_t before, const void* bytes, size_t count) {
    return libdeflate_crc32(before, bytes, count);
}

Checksum checksum_text(const std::string& text) {
    return {text.size(), crc32_of(0, text.data(), text.size())};
}

Result<Checksum> checksum_file(const std::string& path) {
    const std::filesystem::path place = path;
    const auto file = ArchiveFile::open(place.parent_path().empty() ? "." : place.parent_path(), place.filename());
    if (!file) return file.error();
    return file->checksum();
}

}  // namespace ols
