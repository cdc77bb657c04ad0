// SPDX-License-Identifier: MIT
// Finding the BOOTSEL drive and copying to it.
#include "device/boot_drive.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace ols {

namespace {

// The boot ROM's file is some 60 bytes.
bool is_boot_drive(const std::string& path) {
    const std::string name = path + "/INFO_UF2.TXT";
    std::error_code missing;
    if (!std::filesystem::is_regular_file(name, missing)) return false;
    char text[1024] = {};
    std::ifstream(name).read(text, sizeof text - 1);
    std::istringstream info(text);
    for (std::string line; std::getline(info, line);)
        if (line.starts_with("Board-ID: RPI-RP2")) return true;
    return false;
}

// /proc/mounts writes a space as \040 (fstab(5)).
std::string unescaped(const std::string& path) {
    std::string text;
    for (size_t n = 0; n < path.size(); n++) {
        if (path.compare(n, 4, "\\040") == 0) {
            text += ' ';
            n += 3;
        } else {
            text += path[n];
        }
    }
    return text;
}

Error write_failed(const std::string& path) {
    return fail(
        fmt::format("cannot write to '{}': {}. The board may have no complete firmware now: hold BOOTSEL while "
                    "plugging it in and run the same command again",
                    path, std::strerror(errno)));
}

}  // namespace

std::string find_boot_drive() {
    std::ifstream mounts("/proc/mounts");
    for (std::string line; std::getline(mounts, line);) {
        std::istringstream fields(line);
        std::string device, path, type;
        fields >> device >> path >> type;
        if (type == "vfat" && is_boot_drive(unescaped(path))) return unescaped(path);
    }
    return {};
}

Status write_boot_drive(const std::string& path, std::span<const uint8_t> uf2) {
    if (!is_boot_drive(path))
        return fail("'" + path +
                    "' is not the drive of an RP2040 in BOOTSEL mode: it has no INFO_UF2.TXT that says so");
    const std::string file = path + "/stage.uf2";
    // Neither waits for the other end of a pipe nor follows a link to something else.
    const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW, 0644);
    if (fd < 0) return write_failed(file);
    while (!uf2.empty()) {
        const ssize_t written = ::write(fd, uf2.data(), uf2.size());
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) break;
        uf2 = uf2.subspan(size_t(written));
    }
    const bool whole = uf2.empty() && ::fsync(fd) == 0;
    Status status = whole ? Status(Done{}) : Status(write_failed(file));
    ::close(fd);
    return status;
}

}  // namespace ols
