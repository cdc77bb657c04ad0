// SPDX-License-Identifier: MIT
// Opens without waiting (a pipe without a writer would), looks at what it got, then reads.
#include "image/bounded_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace ols {

namespace {

class Descriptor {
  public:
    explicit Descriptor(int number) : number_(number) {}
    ~Descriptor() {
        if (number_ >= 0) close(number_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    int number() const { return number_; }

  private:
    int number_;
};

const char* kind_of(mode_t mode) {
    if (S_ISDIR(mode)) return "a folder";
    if (S_ISFIFO(mode)) return "a pipe";
    if (S_ISSOCK(mode)) return "a socket";
    return "a device";
}

}  // namespace

Result<std::string> read_bounded_file(const std::string& path, const std::string& what, uint64_t most_bytes) {
    if (path.empty()) return fail(fmt::format("the path of the {} is empty: name a file", what));
    const auto refused = [&](const std::string& why) {
        return fail(fmt::format("cannot open {} '{}': {}", what, path, why));
    };
    if (path.find('\0') != path.npos) return refused("a path holds no zero byte");
    struct stat state {};
    // Devices may act on being opened.
    if (stat(path.c_str(), &state) != 0) return refused(fmt::format("{}; check the path", std::strerror(errno)));
    if (!S_ISREG(state.st_mode)) return refused(fmt::format("it is {}, not a file", kind_of(state.st_mode)));
    const Descriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    if (file.number() < 0 || fstat(file.number(), &state) != 0)
        return refused(fmt::format("{}; check its permissions", std::strerror(errno)));
    if (!S_ISREG(state.st_mode)) return refused(fmt::format("it is {}, not a file", kind_of(state.st_mode)));
    if (uint64_t(state.st_size) > most_bytes)
        return refused(fmt::format("it has {} bytes, and a {} has at most {}", state.st_size, what, most_bytes));
    std::string bytes(size_t(state.st_size), '\0');
    size_t done = 0;
    while (done < bytes.size()) {
        const ssize_t got = read(file.number(), bytes.data() + done, bytes.size() - done);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return refused(std::strerror(errno));
        if (got == 0) break;
        done += size_t(got);
    }
    bytes.resize(done);
    return bytes;
}

}  // namespace ols
