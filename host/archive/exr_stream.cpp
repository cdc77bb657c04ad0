// SPDX-License-Identifier: MIT
// ExrStream: buffered pwrite that remembers its first error.
#include "archive/exr_stream.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "archive/disk.hpp"

namespace ols {

constexpr size_t buffer_bytes = 1 << 20;

ExrStream::ExrStream(const std::string& path) : Imf::OStream(path.c_str()), path_(path) {
    fd_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (fd_ < 0) error_ = errno;
}

ExrStream::~ExrStream() {
    if (fd_ >= 0) ::close(fd_);
}

void ExrStream::flush() {
    uint64_t offset = position_ - buffered_.size();
    for (size_t done = 0; done < buffered_.size() && error_ == 0;) {
        const ssize_t n = pwrite(fd_, buffered_.data() + done, buffered_.size() - done, off_t(offset + done));
        if (n > 0)
            done += size_t(n);
        else if (n < 0 && errno != EINTR)
            error_ = errno;
    }
    buffered_.clear();
}

void ExrStream::write(const char bytes[], int count) {
    buffered_.insert(buffered_.end(), bytes, bytes + count);
    position_ += uint64_t(count);
    if (buffered_.size() >= buffer_bytes) flush();
    if (error_ != 0) throw std::runtime_error(std::strerror(error_));
}

void ExrStream::seekp(uint64_t position) {
    if (position == position_) return;
    flush();
    position_ = position;
}

Status ExrStream::finish() {
    flush();
    if (error_ == 0 && fsync(fd_) != 0) error_ = errno;
    if (fd_ >= 0 && ::close(fd_) != 0 && error_ == 0) error_ = errno;
    fd_ = -1;
    if (error_ != 0) return disk_error("write", path_, error_);
    return Done{};
}

}  // namespace ols
