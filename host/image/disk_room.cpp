// SPDX-License-Identifier: MIT
// statfs(2): blocks are counted in fragments, f_frsize.
#include "image/disk_room.hpp"

#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/statfs.h>

#include <cerrno>
#include <cstring>

namespace ols {

Result<DiskRoom> room_of(const std::string& folder) {
    struct statfs file_system {};
    struct stat entry {};
    if (::statfs(folder.c_str(), &file_system) != 0 || ::stat(folder.c_str(), &entry) != 0)
        return fail(fmt::format("the disk of '{}' cannot be asked for its room: {}: check that the folder is there",
                                folder, std::strerror(errno)));
    if (!S_ISDIR(entry.st_mode)) return fail(fmt::format("'{}' is no folder", folder));
    return DiskRoom{uint64_t(file_system.f_bavail) * uint64_t(file_system.f_frsize),
                    file_system.f_type == TMPFS_MAGIC || file_system.f_type == RAMFS_MAGIC, uint64_t(entry.st_dev)};
}

}  // namespace ols
