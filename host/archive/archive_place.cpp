// SPDX-License-Identifier: MIT
// Making an archive beside its name, and swapping it in.
#include "archive/archive_place.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>

#include "archive/disk.hpp"
#include "archive/journal.hpp"
#include "archive/manifest.hpp"
#include "archive/target_file.hpp"

namespace ols {

namespace fs = std::filesystem;

namespace {

// Opens a folder for flock; -1 with errno.
int open_folder(const fs::path& folder) {
    return ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

// Whether a file or folder is one that an archive consists of, finished or not, by its path relative to the archive. Links and
// pipes are none.
bool belongs_to_archive(std::string relative, const fs::file_status& status) {
    unsigned folder_camera = 0;
    if (fs::is_directory(status))
        return std::sscanf(relative.c_str(), "cam%u", &folder_camera) == 1 &&
               relative == fmt::format("cam{}", folder_camera);
    if (!fs::is_regular_file(status)) return false;
    // What is not finished ends with ".part", and where image/whole_file.hpp writes it with a number, too.
    const size_t part = relative.rfind(unfinished_suffix);
    if (part != std::string::npos &&
        relative.find_first_not_of("0123456789-", part + std::strlen(unfinished_suffix)) == std::string::npos)
        relative.resize(part);
    unsigned camera = 0, index = 0;
    if (std::sscanf(relative.c_str(), "cam%u/target_%u", &camera, &index) == 2)
        return relative == target_file_name(camera, index);
    return relative == manifest_name || relative == lights_name || relative == journal_name;
}

Status check_for_strangers(const fs::path& folder) {
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(folder, error))
        if (!belongs_to_archive(entry.path().lexically_relative(folder).generic_string(), entry.symlink_status(error)))
            return fail("'" + entry.path().string() + "' is not part of an archive: move it before overwriting '" +
                        folder.string() + "'");
    if (error) return fail("cannot look into '" + folder.string() + "': " + error.message());
    return Done{};
}

bool holds_targets(const fs::path& folder) {
    std::error_code error;
    for (const auto& entry : fs::recursive_directory_iterator(folder, error))
        if (entry.path().extension() == ".exr") return true;
    return false;
}

// Device and inode; what is not there is like nothing else.
std::optional<std::pair<dev_t, ino_t>> identity_of(int result, const struct stat& info) {
    if (result != 0) return std::nullopt;
    return std::pair(info.st_dev, info.st_ino);
}
auto folder_identity(int fd) {
    struct stat info {};
    return identity_of(fstat(fd, &info), info);
}
auto folder_identity(const fs::path& folder) {
    struct stat info {};
    return identity_of(lstat(folder.c_str(), &info), info);
}

Status remove_folder(const fs::path& folder) {
    std::error_code error;
    fs::remove_all(folder, error);
    if (error) return fail("cannot remove '" + folder.string() + "': " + error.message());
    return Done{};
}

}  // namespace

FolderLock::FolderLock(FolderLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
FolderLock& FolderLock::operator=(FolderLock&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
}
FolderLock::~FolderLock() {
    if (fd_ >= 0) ::close(fd_);
}

Result<FolderLock> FolderLock::take(const fs::path& folder) {
    FolderLock lock;
    lock.fd_ = open_folder(folder);
    if (lock.fd_ < 0) return disk_error("open", folder.string(), errno);
    if (flock(lock.fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
        return fail("'" + folder.string() +
                    "' is being recorded by another program: wait until it ends, or choose another name");
    return lock;
}

bool is_being_written(const fs::path& folder) {
    const int fd = open_folder(folder);
    if (fd < 0) return false;
    const bool is_held = flock(fd, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    ::close(fd);
    return is_held;
}

ArchivePlace::ArchivePlace(ArchivePlace&& other) noexcept
    : root_(std::move(other.root_)),
      folder_(std::move(other.folder_)),
      lock_(std::move(other.lock_)),
      replaced_lock_(std::move(other.replaced_lock_)),
      replaces_(other.replaces_),
      is_ours_(std::exchange(other.is_ours_, false)),
      was_placed_(other.was_placed_) {}

ArchivePlace::~ArchivePlace() {
    std::error_code ignored;
    if (is_ours_) fs::remove_all(folder_, ignored);
}

Result<ArchivePlace> ArchivePlace::make_beside(const fs::path& path, bool overwrite) {
    ArchivePlace place;
    place.root_ = path.lexically_normal();
    if (!place.root_.has_filename()) place.root_ = place.root_.parent_path();  // "take.rfa/"
    place.folder_ = place.root_.parent_path() / ("." + place.root_.filename().string() + ".recording");
    std::error_code error;
    place.replaces_ = fs::exists(fs::symlink_status(place.root_, error));
    if (place.replaces_ && !overwrite)
        return fail("'" + place.root_.string() + "' exists: choose another name or overwrite it");
    if (place.replaces_)
        if (const auto held = place.hold_what_is_replaced(); !held) return held.error();
    if (const auto made = place.make_folder(); !made) return made.error();
    return place;
}

Status ArchivePlace::hold_what_is_replaced() {
    std::error_code error;
    if (fs::is_symlink(root_, error))
        return fail("'" + root_.string() + "' is a symbolic link: give the archive's own name to overwrite it");
    if (!fs::exists(root_ / journal_name, error))
        return fail("'" + root_.string() + "' exists and is not an archive: remove it yourself or choose another name");
    auto lock = FolderLock::take(root_);
    if (!lock) return lock.error();
    replaced_lock_ = std::move(*lock);
    return check_for_strangers(root_);
}

Status ArchivePlace::make_folder() {
    std::error_code error;
    const bool is_left = !fs::create_directory(folder_, error) && !error;
    if (error)
        return fail("cannot make '" + root_.string() + "': " + error.message() +
                    "; the folder it lies in must exist and be writable");
    auto lock = FolderLock::take(folder_);
    if (!lock) return lock.error();
    if (is_left) {
        if (holds_targets(folder_))
            return fail("'" + folder_.string() +
                        "' holds targets that an interrupted swap or a take that found its name taken left: rename it "
                        "to keep them, or remove it");
        if (const auto checked = check_for_strangers(folder_); !checked) return checked;
        for (const auto& entry : fs::directory_iterator(folder_, error)) fs::remove_all(entry.path(), error);
        if (error) return fail("cannot empty '" + folder_.string() + "': " + error.message());
    }
    lock_ = std::move(*lock);
    is_ours_ = true;
    return Done{};
}

// Removes what was replaced, if it still is what was looked at in the beginning.
Status ArchivePlace::remove_replaced(const fs::path& folder) {
    const auto looked_at = folder_identity(replaced_lock_.fd()), there = folder_identity(folder);
    if (looked_at != there)
        return fail("'" + folder.string() + "' is another folder than '" + root_.string() +
                    "' was when the recording began: it is kept; look into it");
    if (const auto checked = check_for_strangers(folder); !checked) return checked;
    return remove_folder(folder);
}

Status ArchivePlace::take() {
    if (was_placed_) return Done{};
    is_ours_ = false;
    const auto rename_as = [&](unsigned flags) {
        return renameat2(AT_FDCWD, folder_.c_str(), AT_FDCWD, root_.c_str(), flags) == 0;
    };
    const fs::path beside = folder_;
    const auto can_not = [] { return errno == EINVAL || errno == ENOSYS; };
    const auto kept_beside = [&](int error_number) {
        return disk_error("rename '" + beside.string() + "', where the recording stays, to", root_.string(),
                          error_number);
    };
    if (replaces_ && !rename_as(RENAME_EXCHANGE)) {
        if (!can_not()) return kept_beside(errno);
        // Not every file system can exchange: the old one goes aside first. A crash in between leaves both.
        const fs::path aside = root_.string() + ".replaced";
        if (rename(root_.c_str(), aside.c_str()) != 0)
            return disk_error("put '" + root_.string() + "' aside as", aside.string(), errno);
        if (!rename_as(0)) {
            const int error_number = errno;
            [[maybe_unused]] const int back = rename(aside.c_str(), root_.c_str());
            return kept_beside(error_number);
        }
        folder_ = root_, was_placed_ = true;
        if (auto synced = sync_directory(root_.parent_path().string()); !synced) return synced;
        return remove_replaced(aside);
    }
    // A plain rename replaces nothing but an empty folder.
    if (!replaces_ && !rename_as(RENAME_NOREPLACE) && !(can_not() && rename_as(0))) return kept_beside(errno);
    folder_ = root_, was_placed_ = true;
    if (auto synced = sync_directory(root_.parent_path().string()); !synced) return synced;
    return replaces_ ? remove_replaced(beside) : Status(Done{});
}

}  // namespace ols
