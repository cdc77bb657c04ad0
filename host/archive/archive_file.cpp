// SPDX-License-Identifier: MIT
// Opening with openat, step by step from the archive's folder, so that no link is followed.
#include "archive/archive_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>
#include <vector>

namespace ols {

namespace fs = std::filesystem;

namespace {

// A descriptor that is closed at the end.
class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    Descriptor(const Descriptor&) = delete;
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    int get() const { return fd_; }
    int release() { return std::exchange(fd_, -1); }
    void reset(int fd) {
        if (fd_ >= 0) ::close(fd_);
        fd_ = fd;
    }

  private:
    int fd_;
};

Error cannot_open(const std::string& path, int error) {
    if (error == ENOENT) return fail("'" + path + "' is gone");
    if (error == EMFILE || error == ENFILE)
        return fail("cannot read '" + path + "': too many files are open: raise the limit (ulimit -n)");
    return disk_error("read", path, error);
}

Error not_a(const char* wanted, const std::string& path, unsigned mode) {
    return fail(fmt::format("'{}' is {}, not {} of the archive's own folder: it is left alone", path, entry_kind(mode),
                            wanted));
}

}  // namespace

const char* entry_kind(unsigned mode) {
    switch (mode & S_IFMT) {
        case S_IFREG: return "a file";
        case S_IFDIR: return "a folder";
        case S_IFLNK: return "a link";
        case S_IFIFO: return "a pipe";
        case S_IFSOCK: return "a socket";
        default: return "a device";
    }
}

ArchiveFile::ArchiveFile(std::string path, int fd, uint64_t size) : path_(std::move(path)), fd_(fd), size_(size) {}
ArchiveFile::ArchiveFile(ArchiveFile&& other) noexcept
    : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)), size_(other.size_) {}
ArchiveFile::~ArchiveFile() {
    if (fd_ >= 0) ::close(fd_);
}

Result<ArchiveFile> ArchiveFile::open(const fs::path& root, const std::string& name) {
    // The archive itself may be named by a link.
    Descriptor folder(::open(root.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    if (folder.get() < 0) return cannot_open(root.string(), errno);
    fs::path walked = root;
    const fs::path relative = name;
    for (const fs::path& step : relative.parent_path()) {
        walked /= step;
        struct stat info {};
        if (fstatat(folder.get(), step.c_str(), &info, AT_SYMLINK_NOFOLLOW) != 0)
            return cannot_open(walked.string(), errno);
        if (!S_ISDIR(info.st_mode)) return not_a("a folder", walked.string(), info.st_mode);
        const int below = openat(folder.get(), step.c_str(), O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        if (below < 0) return cannot_open(walked.string(), errno);
        folder.reset(below);
    }
    const std::string path = (root / name).string(), last = relative.filename().string();
    struct stat info {};
    // Looked at before it is opened, which can act on a device, and after, for it may have changed.
    if (fstatat(folder.get(), last.c_str(), &info, AT_SYMLINK_NOFOLLOW) != 0) return cannot_open(path, errno);
    if (!S_ISREG(info.st_mode)) return not_a("a file", path, info.st_mode);
    Descriptor file(openat(folder.get(), last.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
    if (file.get() < 0 || fstat(file.get(), &info) != 0) return cannot_open(path, errno);
    if (!S_ISREG(info.st_mode)) return not_a("a file", path, info.st_mode);
    return ArchiveFile(path, file.release(), uint64_t(info.st_size));
}

Result<size_t> ArchiveFile::read(uint64_t offset, void* out, size_t bytes) const {
    size_t done = 0;
    while (done < bytes) {
        const ssize_t n = pread(fd_, static_cast<char*>(out) + done, bytes - done, off_t(offset + done));
        if (n == 0) break;
        if (n < 0 && errno != EINTR) return disk_error("read", path_, errno);
        if (n > 0) done += size_t(n);
    }
    return done;
}

Result<std::string> ArchiveFile::text(uint64_t bytes_max) const {
    if (size_ > bytes_max)
        return fail(
            fmt::format("'{}' has {} bytes; no such file of an archive has more than {}", path_, size_, bytes_max));
    std::string text(size_t(size_), '\0');
    const auto read_bytes = read(0, text.data(), text.size());
    if (!read_bytes) return read_bytes.error();
    text.resize(*read_bytes);
    return text;
}

Result<Checksum> ArchiveFile::checksum() const {
    std::vector<char> buffer(1 << 18);  // what the processor's cache holds
    Checksum sum;
    for (;;) {
        const auto n = read(sum.bytes, buffer.data(), buffer.size());
        if (!n) return n.error();
        sum.crc32 = crc32_of(sum.crc32, buffer.data(), *n);
        sum.bytes += *n;
        if (*n < buffer.size()) return sum;
    }
}

std::string difference(const std::string& name, const Checksum& found, const Checksum& expected) {
    if (found.bytes != expected.bytes)
        return fmt::format("{}: has {} bytes, the journal says {}", name, found.bytes, expected.bytes);
    if (found.crc32 != expected.crc32)
        return fmt::format("{}: has CRC-32 {:08x}, the journal says {:08x}: its bytes have changed", name, found.crc32,
                           expected.crc32);
    return "";
}

}  // namespace ols
