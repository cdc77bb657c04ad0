// SPDX-License-Identifier: MIT
// pread(2) until all is there.
#include "recordings/shared_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "image/input_file.hpp"

namespace ols {

Result<SharedFile> SharedFile::open(const std::string& path) {
    if (const auto checked = open_input(path); !checked.ok()) return checked.error();
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat state {};
    if (descriptor < 0 || fstat(descriptor, &state) != 0) {
        const int error = errno;
        if (descriptor >= 0) close(descriptor);
        return fail(fmt::format("cannot open '{}': {}", path, std::strerror(error)));
    }
    return SharedFile(path, descriptor, uint64_t(state.st_size));
}

SharedFile::~SharedFile() {
    if (descriptor_ >= 0) close(descriptor_);
}

bool SharedFile::read(uint64_t offset, std::span<std::byte> to) const {
    if (offset > size_ || to.size() > size_ - offset) return false;
    for (size_t done = 0; done < to.size();) {
        const ssize_t got = pread(descriptor_, to.data() + done, to.size() - done, off_t(offset + done));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        done += size_t(got);
    }
    return true;
}

}  // namespace ols
