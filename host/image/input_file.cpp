// SPDX-License-Identifier: MIT
// The kind is looked at before a file is opened: opening a pipe waits for whoever writes to it, and a device may act on it.
#include "image/input_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

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

Result<std::ifstream> open_input(const std::string& path) {
    struct stat state {};
    if (stat(path.c_str(), &state) != 0)
        return fail(fmt::format("'{}' is not there: check the path ({})", path, std::strerror(errno)));
    if (!S_ISREG(state.st_mode)) return fail(fmt::format("'{}' is {}: name a file", path, kind_of(state.st_mode)));
    std::ifstream stream(path, std::ios::binary);
    if (!stream) return fail("cannot open '" + path + "': check that you may read it");
    return stream;
}

std::string kind_of_bytes(std::string_view bytes) {
    using namespace std::string_view_literals;
    constexpr std::pair<std::string_view, const char*> kinds[] = {
        {"\x76\x2f\x31\x01"sv, "an OpenEXR file"},
        {"#?"sv, "a Radiance file"},
        {"\x89PNG"sv, "a PNG picture"},
        {"\xff\xd8\xff"sv, "a JPEG picture"},
        {"II*\0"sv, "a TIFF or raw picture"},
        {"MM\0*"sv, "a TIFF or raw picture"},
        {"PF"sv, "a PFM picture"},
        {"GIF8"sv, "a GIF picture"},
        {"BM"sv, "a BMP picture"},
        {"PK\x03\x04"sv, "a ZIP archive"},
        {"<"sv, "a page of text"},
    };
    if (bytes.empty()) return "empty";
    for (const auto& [start, kind] : kinds)
        if (bytes.starts_with(start)) return kind;
    return "no file of a kind known here";
}

Result<std::string> read_input(const std::string& path, const std::string& what, uint64_t most_bytes) {
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
