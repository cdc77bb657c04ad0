// SPDX-License-Identifier: MIT
// A file system of a chosen size, for what full disks do: a tmpfs in a mount namespace of a child process.
#pragma once

#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <string>

namespace ols::test {

// What a child returns that may not mount: the test skips.
inline constexpr int no_mount = 77;

// The exit status of `work` in a child process.
inline int in_process(const std::function<int()>& work) {
    const pid_t pid = fork();
    if (pid == 0) _exit(work());
    int status = 0;
    waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// The exit status of `work` in a child process to which `folder` is an empty disk of `bytes`; no_mount where that needs rights
// that this process has not.
inline int on_small_disk(const std::string& folder, int64_t bytes, const std::function<int()>& work) {
    return in_process([&] {
        if (unshare(CLONE_NEWNS) != 0 && unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return no_mount;
        if (mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) return no_mount;
        const std::string size = "size=" + std::to_string(bytes);
        if (mount("disk", folder.c_str(), "tmpfs", 0, size.c_str()) != 0) return no_mount;
        return work();
    });
}

}  // namespace ols::test
