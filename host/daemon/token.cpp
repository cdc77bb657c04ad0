// SPDX-License-Identifier: MIT
// Making, reading and comparing.
#include "daemon/token.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <iterator>

namespace ols {

namespace {

constexpr size_t token_bytes = 32, token_letters_min = 32, token_letters_max = 256;

Error token_error(const std::string& path, const char* what) {
    return fail(fmt::format("the token file '{}' cannot be {}: {}", path, what, std::strerror(errno)));
}

Result<std::string> make_token(const std::string& path) {
    uint8_t bytes[token_bytes];
    if (getrandom(bytes, sizeof bytes, 0) != ssize_t(sizeof bytes)) return fail("the system gives no random numbers");
    std::string token;
    for (const uint8_t byte : bytes) fmt::format_to(std::back_inserter(token), "{:02x}", byte);
    const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0640);
    if (fd < 0) return token_error(path, "made");
    token += '\n';
    const bool is_written = ::write(fd, token.data(), token.size()) == ssize_t(token.size());
    ::close(fd);
    if (!is_written) return token_error(path, "written");
    token.pop_back();
    return token;
}

}  // namespace

Result<std::string> token_of_file(const std::string& path) {
    const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0 && errno == ENOENT) return make_token(path);
    if (fd < 0) return token_error(path, "read");
    struct stat facts {};
    char text[token_letters_max + 2];
    const bool has_facts = fstat(fd, &facts) == 0 && S_ISREG(facts.st_mode);
    const ssize_t got = has_facts ? ::read(fd, text, sizeof text) : -1;
    ::close(fd);
    if (got < 0) return token_error(path, "read");
    if (facts.st_mode & 0007)
        return fail(fmt::format(
            "everybody may use the token file '{}': `chmod 640` it, or remove it and a new one is made", path));
    std::string token(text, size_t(got));
    while (!token.empty() && (token.back() == '\n' || token.back() == '\r')) token.pop_back();
    if (token.size() < token_letters_min || token.size() > token_letters_max)
        return fail(
            fmt::format("the token file '{}' holds no secret of {} to {} letters: remove it, and a new one is made",
                        path, token_letters_min, token_letters_max));
    return token;
}

bool is_token(const std::string& shown, const std::string& token) {
    volatile uint8_t difference = shown.size() == token.size() ? 0 : 1;
    for (size_t i = 0; i < shown.size(); ++i) difference = difference | uint8_t(shown[i] ^ token[i % token.size()]);
    return difference == 0;
}

}  // namespace ols
