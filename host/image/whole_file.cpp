// SPDX-License-Identifier: MIT
// Written beside, then renamed: POSIX renames within a folder at once.
#include "image/whole_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "exceptions.hpp"

namespace ols {

namespace {

namespace fs = std::filesystem;

Error cannot_write(const std::string& path, int error) {
    std::string remedy;
    if (error == ENOENT || error == ENOTDIR) remedy = ": check that the folder exists";
    if (error == EACCES || error == EPERM || error == EROFS) remedy = ": choose a folder in which you may write";
    if (error == ENOSPC || error == EDQUOT) remedy = ": free space there or choose another disk";
    if (error == EFBIG) remedy = ": the file system or a limit (ulimit -f) allows no larger file";
    return fail("cannot write '" + path + "': " + std::strerror(error) + remedy);
}

const char* what_stands_there(const fs::file_status& status) {
    switch (status.type()) {
        case fs::file_type::directory: return "a folder";
        case fs::file_type::block:
        case fs::file_type::character: return "a device";
        case fs::file_type::fifo: return "a pipe";
        case fs::file_type::socket: return "a socket";
        default: return "no file";
    }
}

// The archive that a place lies in, empty for none.
fs::path archive_around(const fs::path& place) {
    std::error_code error;
    fs::path folder = fs::weakly_canonical(fs::absolute(place, error).parent_path(), error);
    while (!folder.empty()) {
        if (fs::exists(folder / journal_name, error) && fs::exists(folder / manifest_name, error)) return folder;
        if (folder == folder.parent_path()) break;
        folder = folder.parent_path();
    }
    return {};
}

Status check_outside_archives(const std::string& path, const fs::path& place) {
    const fs::path archive = archive_around(place);
    if (archive.empty()) return Done{};
    return fail("cannot write '" + path + "': it lies in the archive '" + archive.string() +
                "', which an output would damage: choose another folder");
}

// Tries names beside the place until `make` makes one that nothing had; the errno of another failure is left.
template <typename Make>
std::string reserve_beside(const fs::path& place, Make make) {
    constexpr size_t longest = 200;  // names end at 255 bytes
    const std::string stem = place.filename().string().substr(0, longest) + ".part" + std::to_string(getpid()) + "-";
    for (int n = 0;; ++n) {
        const std::string name = (place.parent_path() / (stem + std::to_string(n))).string();
        if (make(name)) return name;
        if (errno != EEXIST) return "";
    }
}

bool make_file(const std::string& name) {
    const int fd = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    return fd >= 0 && ::close(fd) == 0;
}

bool make_folder(const std::string& name) {
    return mkdir(name.c_str(), 0777) == 0;
}

// Writes to a file, syncs and closes it; 0 or the first errno.
int write_and_sync(const std::string& name, std::string_view bytes) {
    const int fd = ::open(name.c_str(), O_WRONLY | O_CLOEXEC);
    if (fd < 0) return errno;
    int error = 0;
    while (!bytes.empty() && error == 0) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n >= 0)
            bytes.remove_prefix(size_t(n));
        else if (errno != EINTR)
            error = errno;
    }
    // EINVAL: some file systems cannot sync.
    if (error == 0 && fsync(fd) != 0 && errno != EINVAL) error = errno;
    if (::close(fd) != 0 && error == 0) error = errno;
    return error;
}

}  // namespace

Result<fs::path> output_place(const std::string& path) {
    std::error_code error;
    fs::path place = path;
    if (fs::is_symlink(fs::symlink_status(place, error))) {
        place = fs::canonical(path, error);
        if (error)
            return fail("cannot write '" + path +
                        "': it is a link that leads nowhere: remove it or choose another name");
    }
    const auto status = fs::status(place, error);
    if (fs::exists(status) && !fs::is_regular_file(status))
        return fail("cannot write '" + path + "': " + what_stands_there(status) +
                    " stands there, and only files are replaced: choose another name");
    if (const Status outside = check_outside_archives(path, place); !outside) return outside.error();
    return place;
}

Result<fs::path> new_folder_place(const std::string& path) {
    fs::path place = path;
    if (!place.has_filename()) place = place.parent_path();  // "lamps/"
    std::error_code error;
    if (fs::exists(fs::symlink_status(place, error)))
        return fail("'" + place.string() + "' exists: choose a new folder");
    if (const Status outside = check_outside_archives(path, place); !outside) return outside.error();
    return place;
}

Status write_whole_file(const std::string& path, const std::function<Status(const std::string& temporary)>& write) {
    const auto place = output_place(path);
    if (!place) return place.error();
    const std::string temporary = reserve_beside(*place, make_file);
    if (temporary.empty()) return cannot_write(path, errno);
    Status done = guarded("cannot write '" + path + "'", [&] { return write(temporary); });
    if (done)
        if (const int error = write_and_sync(temporary, {}); error != 0) done = cannot_write(path, error);
    if (done && rename(temporary.c_str(), place->c_str()) != 0) done = cannot_write(path, errno);
    if (!done) unlink(temporary.c_str());
    return done;
}

Status write_whole_file(const std::string& path, std::string_view bytes) {
    return write_whole_file(path, [&](const std::string& temporary) -> Status {
        if (const int error = write_and_sync(temporary, bytes); error != 0) return cannot_write(path, error);
        return Done{};
    });
}

Status make_whole_folder(const std::string& path, const std::function<Status(const std::string& temporary)>& fill) {
    const auto place = new_folder_place(path);
    if (!place) return place.error();
    const std::string temporary = reserve_beside(*place, make_folder);
    if (temporary.empty()) return cannot_write(path, errno);
    Status done = guarded("cannot write '" + path + "'", [&] { return fill(temporary); });
    // A folder that came to stand there meanwhile stays, unless it is empty.
    if (done && rename(temporary.c_str(), place->c_str()) != 0) done = cannot_write(path, errno);
    std::error_code ignored;
    if (!done) fs::remove_all(temporary, ignored);
    return done;
}

}  // namespace ols
