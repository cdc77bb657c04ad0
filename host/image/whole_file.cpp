// SPDX-License-Identifier: MIT
// Written beside, then renamed: POSIX renames within a folder at once.
#include "image/whole_file.hpp"

#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace ols {

Status write_whole_file(const std::string& path, const std::function<Status(const std::string& temporary)>& write) {
    const std::string temporary = path + ".part" + std::to_string(getpid());
    Status done = write(temporary);
    std::error_code error;
    if (done) std::filesystem::rename(temporary, path, error);
    if (error) done = fail("cannot write '" + path + "': " + error.message());
    if (!done) std::filesystem::remove(temporary, error);
    return done;
}

Status write_whole_file(const std::string& path, std::string_view bytes) {
    return write_whole_file(path, [&](const std::string& temporary) -> Status {
        std::ofstream file(temporary, std::ios::binary);
        file.write(bytes.data(), std::streamsize(bytes.size()));
        file.close();
        if (!file) return fail("cannot write '" + path + "': check that the folder exists and has space");
        return Done{};
    });
}

}  // namespace ols
