// SPDX-License-Identifier: MIT
// PlaneSpool with pread and pwrite.
#include "photographs/plane_spool.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <utility>

#include "archive/disk.hpp"

namespace ols {

PlaneSpool::PlaneSpool(std::string directory, int fd, int width, int height)
    : directory_(std::move(directory)), fd_(fd), width_(width), height_(height) {}
PlaneSpool::PlaneSpool(PlaneSpool&& other) noexcept
    : directory_(std::move(other.directory_)),
      fd_(std::exchange(other.fd_, -1)),
      width_(other.width_),
      height_(other.height_) {}
PlaneSpool::~PlaneSpool() {
    if (fd_ >= 0) ::close(fd_);
}

Result<PlaneSpool> PlaneSpool::create(const std::string& directory, int width, int height) {
    // Named for a moment: not every file system has O_TMPFILE.
    std::string name = directory + "/.spool_XXXXXX";
    const int fd = mkostemp(name.data(), O_CLOEXEC);
    if (fd < 0) return disk_error("put pictures aside in", directory, errno);
    unlink(name.c_str());
    return PlaneSpool(directory, fd, width, height);
}

Status PlaneSpool::write(int plane, std::span<const float> samples) {
    const size_t bytes = samples.size_bytes();
    const off_t start = off_t(plane) * off_t(width_) * height_ * off_t(sizeof(float));
    const char* data = reinterpret_cast<const char*>(samples.data());
    for (size_t done = 0; done < bytes;) {
        const ssize_t n = pwrite(fd_, data + done, bytes - done, start + off_t(done));
        if (n > 0)
            done += size_t(n);
        else if (n < 0 && errno != EINTR)
            return disk_error("put pictures aside in", directory_, errno);
    }
    return Done{};
}

Status PlaneSpool::read(int plane, const Box& box, float* out) const {
    for (int y = 0; y < box.height; ++y) {
        const off_t sample = (off_t(plane) * height_ + box.y + y) * width_ + box.x;
        char* data = reinterpret_cast<char*>(out + size_t(y) * box.width);
        const size_t bytes = size_t(box.width) * sizeof(float);
        for (size_t done = 0; done < bytes;) {
            const ssize_t n = pread(fd_, data + done, bytes - done, sample * off_t(sizeof(float)) + off_t(done));
            if (n > 0)
                done += size_t(n);
            else if (n == 0 || errno != EINTR)
                return disk_error("read pictures put aside in", directory_, errno);
        }
    }
    return Done{};
}

}  // namespace ols
