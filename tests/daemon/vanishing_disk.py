# SPDX-License-Identifier: MIT
"""vanishing_disk.py FOLDER MOUNT MOOD PROGRAM...: the program, with a disk at MOUNT that keeps its files in FOLDER (FUSE, of the kernel's
linux/fuse.h, 7.31) and is as the file MOOD says: "gone" fails every call with EIO, "broken" those that write, "still" lets these wait."""
import ctypes
import errno
import os
import select
import signal
import struct
import sys

LIBC = ctypes.CDLL(None, use_errno=True)
PR_SET_PDEATHSIG = 1
LOOKUP, FORGET, GETATTR, SETATTR, MKDIR, UNLINK, RMDIR, RENAME, OPEN, READ = 1, 2, 3, 4, 9, 10, 11, 12, 14, 15
WRITE, STATFS, RELEASE, FSYNC, FLUSH, INIT, OPENDIR, READDIR, RELEASEDIR, FSYNCDIR = 16, 17, 18, 20, 25, 26, 27, 28, 29, 30
CREATE, INTERRUPT, DESTROY, BATCH_FORGET, RENAME2 = 35, 36, 38, 42, 45
NO_REPLY = {FORGET, INTERRUPT, BATCH_FORGET}
NEVER_FAIL = NO_REPLY | {INIT, RELEASE, RELEASEDIR, DESTROY}
CHANGES = {SETATTR, MKDIR, UNLINK, RMDIR, RENAME, RENAME2, CREATE, WRITE, FSYNC, FSYNCDIR}
WAITS = {WRITE, FSYNC}
WRITE_MAX = 1 << 20
BIG_WRITES, MAX_PAGES = 1 << 5, 1 << 22
DIRECT_IO = 1
SET_MODE, SET_SIZE = 1, 8


def called(result):
    if result != 0:
        raise OSError(ctypes.get_errno(), "")
    return b""


class Disk:
    """The calls, each by the folder's own files. A node is a file that the kernel knows of, held by an O_PATH descriptor."""

    def __init__(self, folder):
        root = os.open(folder, os.O_PATH | os.O_DIRECTORY)
        self.nodes = {1: [root, 1, None]}  # descriptor, how often it was looked up, device and inode
        self.known = {}  # device and inode: node
        self.listings = {}
        self.next = 2

    def path(self, node):
        return f"/proc/self/fd/{self.nodes[node][0]}"

    @staticmethod
    def attributes(s):
        times = [int(t) for t in (s.st_atime, s.st_mtime, s.st_ctime)]
        parts = [t % 1_000_000_000 for t in (s.st_atime_ns, s.st_mtime_ns, s.st_ctime_ns)]
        rest = [s.st_mode, s.st_nlink, s.st_uid, s.st_gid, s.st_rdev, s.st_blksize, 0]
        return struct.pack("<6Q10I", s.st_ino, s.st_size, s.st_blocks, *times, *parts, *rest)

    def entry(self, parent, name):
        fd = os.open(name, os.O_PATH | os.O_NOFOLLOW, dir_fd=self.nodes[parent][0])
        s = os.fstat(fd)
        node = self.known.get((s.st_dev, s.st_ino))
        if node:
            os.close(fd)
        else:
            node, self.next = self.next, self.next + 1
            self.nodes[node] = [fd, 0, (s.st_dev, s.st_ino)]
            self.known[s.st_dev, s.st_ino] = node
        self.nodes[node][1] += 1
        return struct.pack("<QQQQII", node, 0, 0, 0, 0, 0) + self.attributes(s)  # nothing of it may be cached

    def forget(self, node, times):
        self.nodes[node][1] -= times
        if self.nodes[node][1] <= 0:
            fd, _, key = self.nodes.pop(node)
            del self.known[key]
            os.close(fd)

    def present(self, node):
        return struct.pack("<QII", 0, 0, 0) + self.attributes(os.fstat(self.nodes[node][0]))

    @staticmethod
    def opened(fd):
        return struct.pack("<QII", fd, DIRECT_IO, 0)

    def rename(self, node, to, flags, names):
        old, new = names.split(b"\0")[:2]
        from_fd, to_fd = self.nodes[node][0], self.nodes[to][0]
        return called(LIBC.renameat2(from_fd, old, to_fd, new, flags))

    def set_attributes(self, node, body):
        valid, _, _, size, _, _, _, _, _, _, _, mode = struct.unpack_from("<IIQQQQQQIIII", body)
        if valid & SET_SIZE:
            os.truncate(self.path(node), size)
        if valid & SET_MODE:
            os.chmod(self.path(node), mode & 0o7777)
        return self.present(node)

    def create(self, node, body):
        flags, mode, umask, _ = struct.unpack_from("<IIII", body)
        name = body[16:-1]
        fd = os.open(name, flags & ~os.O_APPEND | os.O_CREAT, mode & ~umask, dir_fd=self.nodes[node][0])
        return self.entry(node, name) + self.opened(fd)

    def list_folder(self, body):
        fh, offset, size = struct.unpack_from("<QQI", body)
        out = b""
        for at, name in enumerate(self.listings[fh][offset:], offset + 1):
            one = struct.pack("<QQII", 1, at, len(name), 0) + name
            one += bytes(-len(one) % 8)
            if len(out) + len(one) > size:
                break
            out += one
        return out

    def open_folder(self, node):
        fd = os.open(self.path(node), os.O_RDONLY)
        self.listings[fd] = [b".", b".."] + [os.fsencode(name) for name in os.listdir(fd)]
        return struct.pack("<QII", fd, 0, 0)

    def room(self, node):
        s = os.statvfs(self.path(node))
        return struct.pack("<5Q4I24x", s.f_blocks, s.f_bfree, s.f_bavail, s.f_files, s.f_ffree, s.f_bsize, 255, s.f_frsize, 0)

    def close(self, fh):
        self.listings.pop(fh, None)
        os.close(fh)
        return b""

    def start(self, body):
        _, _, ahead, flags = struct.unpack_from("<IIII", body)
        flags &= BIG_WRITES | MAX_PAGES
        return struct.pack("<IIIIHHIIHH32x", 7, 31, ahead, flags, 16, 12, WRITE_MAX, 1, WRITE_MAX // 4096, 0)

    def forget_many(self, body):
        for at in range(struct.unpack_from("<I", body)[0]):
            self.forget(*struct.unpack_from("<QQ", body, 8 + 16 * at))

    def make_folder(self, node, body):
        mode, umask = struct.unpack_from("<II", body)
        os.mkdir(body[8:-1], mode & ~umask, dir_fd=self.nodes[node][0])
        return self.entry(node, body[8:-1])

    def remove(self, node, name, how):
        how(name, dir_fd=self.nodes[node][0])
        return b""

    def open(self, node, body):
        flags = struct.unpack_from("<I", body)[0]
        return self.opened(os.open(self.path(node), flags & ~(os.O_APPEND | os.O_NOFOLLOW | os.O_CREAT)))

    @staticmethod
    def read(body):
        fh, offset, size = struct.unpack_from("<QQI", body)
        return os.pread(fh, size, offset)

    @staticmethod
    def write(body):
        fh, offset = struct.unpack_from("<QQ", body)
        return struct.pack("<II", os.pwrite(fh, body[40:], offset), 0)

    def call(self, code, node, body):
        number = struct.unpack_from("<Q", body)[0] if len(body) >= 8 else 0  # with which most begin
        calls = {
            INIT: lambda: self.start(body),
            LOOKUP: lambda: self.entry(node, body[:-1]),
            FORGET: lambda: self.forget(node, number),
            BATCH_FORGET: lambda: self.forget_many(body),
            GETATTR: lambda: self.present(node),
            SETATTR: lambda: self.set_attributes(node, body),
            MKDIR: lambda: self.make_folder(node, body),
            UNLINK: lambda: self.remove(node, body[:-1], os.unlink),
            RMDIR: lambda: self.remove(node, body[:-1], os.rmdir),
            RENAME: lambda: self.rename(node, number, 0, body[8:]),
            RENAME2: lambda: self.rename(node, number, struct.unpack_from("<I", body, 8)[0], body[16:]),
            OPEN: lambda: self.open(node, body),
            CREATE: lambda: self.create(node, body),
            READ: lambda: self.read(body),
            WRITE: lambda: self.write(body),
            STATFS: lambda: self.room(node),
            RELEASE: lambda: self.close(number),
            RELEASEDIR: lambda: self.close(number),
            OPENDIR: lambda: self.open_folder(node),
            READDIR: lambda: self.list_folder(body),
        }
        if code in (FSYNC, FSYNCDIR, FLUSH, DESTROY, INTERRUPT):
            return b""
        if code not in calls:
            raise OSError(errno.ENOSYS, "")  # the kernel does without
        return calls[code]()


def mood_in(path):
    try:
        with open(path) as file:
            return file.read()
    except FileNotFoundError:
        return ""


def answer(channel, disk, request, mood):
    _, code, unique, node = struct.unpack_from("<IIQQ", request)
    error, out = 0, b""
    try:
        if (mood == "gone" and code not in NEVER_FAIL) or (mood == "broken" and code in CHANGES):
            raise OSError(errno.EIO, "")
        out = disk.call(code, node, request[40:])
    except OSError as problem:
        error, out = -problem.errno, b""
    if code in NO_REPLY:
        return
    try:
        os.write(channel, struct.pack("<IiQ", 16 + len(out), error, unique) + out)
    except OSError as problem:
        if problem.errno != errno.ENOENT:  # who asked was killed
            raise


def serve(channel, folder, mood_path):
    disk, waiting = Disk(folder), []
    while True:
        mood = mood_in(mood_path)
        if waiting and mood != "still":
            for request in waiting:
                answer(channel, disk, request, mood)
            waiting = []
        if not select.select([channel], [], [], 0.02 if waiting else None)[0]:
            continue
        request = os.read(channel, WRITE_MAX + 4096)
        mood = mood_in(mood_path)
        if mood == "still" and struct.unpack_from("<I", request, 4)[0] in WAITS:
            waiting.append(request)
        else:
            answer(channel, disk, request, mood)


def main(folder, mount, mood_path, *program):
    channel = os.open("/dev/fuse", os.O_RDWR)
    options = f"fd={channel},rootmode=40000,user_id={os.geteuid()},group_id={os.getegid()},default_permissions"
    called(LIBC.mount(b"vanishing", os.fsencode(mount), b"fuse", 0, options.encode()))
    program_end, disk_end = os.pipe()
    program_id = os.getpid()
    if os.fork() > 0:
        os.close(channel)
        os.close(disk_end)
        os.read(program_end, 1)
        os.execv(program[0], program)  # with this process' id, by which it is ended
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() == program_id:
        os.close(disk_end)
        os.umask(0)
        os.setsid()
        serve(channel, folder, mood_path)


if __name__ == "__main__":
    main(*sys.argv[1:])
