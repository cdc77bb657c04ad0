// SPDX-License-Identifier: MIT
// The kernel's side of a V4L2 device.
#include "device/v4l2_device.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>

#include "steady_clock.hpp"

namespace ols {

namespace {

class KernelDevice : public V4l2Device {
  public:
    explicit KernelDevice(int fd) : fd_(fd) {}
    ~KernelDevice() override { ::close(fd_); }
    KernelDevice(const KernelDevice&) = delete;
    KernelDevice& operator=(const KernelDevice&) = delete;

    int ioctl(unsigned long request, void* argument) override {
        int answer = 0;
        do answer = ::ioctl(fd_, request, argument);
        while (answer < 0 && errno == EINTR);
        return answer < 0 ? errno : 0;
    }
    short poll(int timeout_ms) override {
        pollfd ready{fd_, POLLIN, 0};
        return ::poll(&ready, 1, timeout_ms) > 0 ? ready.revents : short(0);
    }
    std::byte* map(size_t bytes, uint32_t offset) override {
        void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd_, off_t(offset));
        return memory == MAP_FAILED ? nullptr : static_cast<std::byte*>(memory);
    }
    void unmap(std::byte* memory, size_t bytes) override { ::munmap(memory, bytes); }
    uint64_t now_ns() const override { return steady_ns(); }

  private:
    int fd_;
};

std::string devices_there_are() {
    std::string names;
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator("/dev", none)) {
        const std::string name = entry.path().filename();
        if (name.starts_with("video")) names += (names.empty() ? "" : ", ") + entry.path().string();
    }
    return names.empty() ? "this machine has no /dev/video*: is the camera plugged in, its driver loaded (dmesg)?"
                         : "there are " + names + "; `v4l2-ctl --list-devices` says which is which";
}

}  // namespace

Result<std::shared_ptr<V4l2Device>> open_v4l2_device(const std::string& path) {
    const int fd = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd >= 0) return std::shared_ptr<V4l2Device>(std::make_shared<KernelDevice>(fd));
    const int error = errno;
    const std::string cannot = fmt::format("cannot open the camera '{}': {}", path, std::strerror(error));
    if (error == EACCES || error == EPERM) return fail(cannot + ": sudo usermod -aG video $USER, and log in again");
    if (error == EBUSY) return fail(cannot + ": end the other program that uses it (fuser -v " + path + ")");
    return fail(cannot + ": " + devices_there_are());
}

std::string fourcc_text(uint32_t fourcc) {
    std::string text;
    for (int n = 0; n < 4; ++n) {
        const char letter = char(fourcc >> 8 * n & (n == 3 ? 0x7f : 0xff));  // bit 31: big-endian (videodev2.h)
        text += letter >= ' ' && letter < 127 ? letter : '.';
    }
    text.erase(std::find_if(text.rbegin(), text.rend(), [](char c) { return c != ' '; }).base(), text.end());
    return fourcc >> 31 ? text + "-BE" : text;
}

}  // namespace ols
