// SPDX-License-Identifier: MIT
// The guest's first process: loads the modules of the initramfs, mounts the host's files over 9p (read-only, with a
// layer in memory above), and becomes the program that the kernel's command line names behind "--".
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

// Ends the guest: QEMU exits, and what it was is on the console.
static void give_up(const char* what, const char* name) {
    printf("guest: cannot %s %s: %s\n", what, name, strerror(errno));
    fflush(stdout);
    sync();
    reboot(RB_POWER_OFF);
    exit(1);
}

static void load_modules(void) {
    struct dirent** files;
    const int count = scandir("/modules", &files, NULL, alphasort);
    for (int n = 0; n < count; n++) {
        if (files[n]->d_name[0] == '.') continue;
        char path[300];
        snprintf(path, sizeof path, "/modules/%s", files[n]->d_name);
        const int fd = open(path, O_RDONLY | O_CLOEXEC);
        if (fd < 0 || (syscall(SYS_finit_module, fd, "", 0) != 0 && errno != EEXIST)) give_up("load", path);
        close(fd);
    }
}

static void mount_at(const char* kind, const char* place, unsigned long flags, const char* options) {
    mkdir(place, 0755);
    if (mount(kind, place, kind, flags, options) != 0) give_up("mount", place);
}

static void mount_root(void) {
    mount_at("tmpfs", "/layer", 0, "");
    mkdir("/layer/upper", 0755);
    mkdir("/layer/work", 0755);
    mkdir("/host", 0755);
    if (mount("host", "/host", "9p", MS_RDONLY, "trans=virtio,version=9p2000.L,msize=512000,cache=loose") != 0)
        give_up("mount", "the host's files");
    mount_at("overlay", "/root", 0, "lowerdir=/host,upperdir=/layer/upper,workdir=/layer/work");
    mount_at("proc", "/root/proc", 0, "");
    mount_at("sysfs", "/root/sys", 0, "");
    mount_at("devtmpfs", "/root/dev", 0, "");
    mount_at("devpts", "/root/dev/pts", 0, "");
    mount_at("tmpfs", "/root/dev/shm", 0, "");
    mount_at("tmpfs", "/root/run", 0, "");
}

int main(int argc, char** argv) {
    (void)argc;
    load_modules();
    mount_root();
    if (chroot("/root") != 0 || chdir("/") != 0) give_up("enter", "/root");
    setenv("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", 1);
    setenv("HOME", "/root", 1);
    execv(argv[1], argv + 1);
    give_up("run", argv[1] ? argv[1] : "nothing: the command line names no program");
}
