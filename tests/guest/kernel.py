# SPDX-License-Identifier: MIT
"""The guest's kernel: Debian's, downloaded and unpacked (not installed), two modules that Debian does not build, and an initramfs.

All of it lies in .cache/guest/VERSION-RECIPE and is made once. Modules that need Debian's own sources are built with its headers.
"""
import functools
import hashlib
import json
import lzma
import os
import pathlib
import re
import shutil
import stat
import struct
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CACHE = ROOT / ".cache/guest"
INIT = HERE / "inside/init.c"

# What the initramfs loads to reach the host's files, and what tests may ask for besides (with all that these depend on).
AT_BOOT = ["virtio_pci", "9pnet_virtio", "9p", "overlay", "virtio_net", "vhci-hcd"]
WANTED = AT_BOOT + ["vcan", "vxcan", "can-raw", "can-isotp", "vivid", "configfs", "videodev", "videobuf2-v4l2"]

# Of Debian's kernel source. irq_sim.c is built into the kernel or not at all, so gpio-sim.ko brings it along.
GPIO_SOURCES = ["drivers/gpio/gpio-sim.c", "drivers/gpio/gpiolib.h", "kernel/irq/irq_sim.c"]

KBUILD = "obj-m := gpio-sim.o v4l2loopback.o\ngpio-sim-y := gpio-sim-main.o irq_sim.o\n"


class Missing(Exception):
    """The guest cannot be made here; the text says what to do."""


def run(command, **options):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)
    if done.returncode:
        raise Missing(f"{' '.join(str(part) for part in command)}: {done.stderr.strip()[-2000:] or done.stdout[-2000:]}")
    return done.stdout


def recipe():
    """Changes when what is made from the packages changes."""
    return hashlib.sha256(pathlib.Path(__file__).read_bytes() + INIT.read_bytes()).hexdigest()[:16]


def versions_of(package):
    """The versions of a package that apt can download, the newest first."""
    listed = subprocess.run(["apt-cache", "madison", package], capture_output=True, text=True)
    return [line.split("|")[1].strip() for line in listed.stdout.splitlines() if "Packages" in line]


def newest_kernel():
    """(ABI, version) of the newest kernel whose headers and source can be downloaded in the very same version."""
    names = run(["apt-cache", "pkgnames", "linux-image-6.1.0-"]).split()
    abis = sorted((int(found[1]) for found in (re.fullmatch(r"linux-image-6\.1\.0-(\d+)-amd64", name) for name in names)
                   if found), reverse=True)
    sources = versions_of("linux-source-6.1")
    for number in abis:
        abi = f"6.1.0-{number}"
        version = (versions_of(f"linux-image-{abi}-amd64") or [None])[0]
        if version in sources and all(version in versions_of(f"linux-headers-{abi}-{kind}") for kind in ("amd64", "common")):
            return abi, version
    raise Missing("apt knows no linux-image-6.1.0-*-amd64 with headers and source of the same version: run apt-get update "
                  "with Debian 12's main and security repositories")


def download(folder, packages):
    folder.mkdir(parents=True, exist_ok=True)
    run(["apt-get", "download", "-q", *packages], cwd=folder)


def unpacked_kernel(image):
    """vmlinux out of a bzImage (Documentation/x86/boot.rst: setup_sects, payload_offset, payload_length)."""
    setup_sectors = image[0x1F1] or 4
    offset, length = struct.unpack_from("<II", image, 0x248)
    begin = (setup_sectors + 1) * 512 + offset
    payload = image[begin : begin + length]
    if payload[:6] != b"\xfd7zXZ\0":
        raise Missing("the kernel image is not packed with xz as Debian 12's are")
    return lzma.LZMADecompressor().decompress(payload)


def module_depends(path):
    """What a module's own .modinfo section says that it needs."""
    found = re.search(rb"\0depends=([^\0]*)\0", path.read_bytes())
    return [name.decode() for name in found[1].split(b",") if name] if found else []


def same_name(name):
    return name.replace("-", "_")


def take_modules(tree, folder):
    """Copies the wanted modules and what they need; returns {name: {"file", "depends"}}."""
    every = {same_name(path.stem): path for path in tree.rglob("*.ko")}
    index, wanted = {}, [same_name(name) for name in WANTED]
    while wanted:
        name = wanted.pop()
        if name in index:
            continue
        if name not in every:
            raise Missing(f"this kernel has no module {name}")
        depends = [same_name(one) for one in module_depends(every[name])]
        index[name] = {"file": every[name].name, "depends": depends}
        wanted += depends
        shutil.copy(every[name], folder)
    return index


def take_gpio_sources(package, folder):
    """Three files out of Debian's kernel source."""
    tar = subprocess.Popen(["dpkg-deb", "--fsys-tarfile", package], stdout=subprocess.PIPE)
    inner = subprocess.Popen(["tar", "xO", "./usr/src/linux-source-6.1.tar.xz"], stdin=tar.stdout, stdout=subprocess.PIPE)
    names = [f"linux-source-6.1/{name}" for name in GPIO_SOURCES]
    run(["tar", "xJ", "--transform", "s|.*/||", "-C", folder, *names], stdin=inner.stdout)
    if inner.wait() or tar.wait():
        raise Missing(f"cannot unpack {package}")
    (folder / "gpio-sim.c").rename(folder / "gpio-sim-main.c")


def edit(path, pattern, replacement):
    text, count = re.subn(pattern, replacement, path.read_text())
    if count == 0:
        raise Missing(f"{path.name} is not what it was: nothing matches {pattern!r}")
    path.write_text(text)


def edit_sources(folder):
    # irq_to_desc is not exported to modules; the exported function does the same by number.
    edit(folder / "irq_sim.c", r"handle_simple_irq\(irq_to_desc\((\w+)\)\)", r"generic_handle_irq(\1)")
    # The kernel's Y10 and Y12 are stored in 16 bits; Bayer formats above 8 bits are missing.
    formats = folder / "v4l2loopback_formats.h"
    edit(formats, r"(V4L2_PIX_FMT_Y1[02],\s*\.depth = )1[02]", r"\g<1>16")
    more = "".join(f'\t{{ .name = "Bayer {order} {bits}", .fourcc = V4L2_PIX_FMT_S{order}{bits}, .depth = 16, .flags = 0 }},\n'
                   for order in ("RGGB", "GRBG", "GBRG", "BGGR") for bits in (10, 12, 16))
    edit(formats, r"(/\* bayer formats \*/\n)", lambda found: found[1] + more)


def build_modules(work, abi):
    """gpio-sim.ko and v4l2loopback.ko; returns the folder they are in."""
    headers = work / f"usr/src/linux-headers-{abi}-amd64"
    (headers / "Makefile").write_text(f"include {work}/usr/src/linux-headers-{abi}-common/Makefile\n")
    folder = work / "own"
    folder.mkdir()
    take_gpio_sources(next(work.glob("linux-source-6.1_*.deb")), folder)
    for path in work.glob("usr/src/v4l2loopback-*/*.[ch]"):
        shutil.copy(path, folder)
    edit_sources(folder)
    (folder / "Kbuild").write_text(KBUILD)
    run(["make", "-s", "-C", headers, f"M={folder}", "CC=gcc-12", "modules"])
    return folder


def archive_entry(number, name, mode, data=b"", device=(0, 0)):
    """One file of a cpio archive of the format "newc" (Documentation/driver-api/early-userspace/buffer-format.rst)."""
    fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(name) + 1, 0)
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
    return head + bytes(-len(head) % 4) + data + bytes(-len(data) % 4)


def initramfs(init, modules):
    """`init`, the modules that it loads in the order in which it must, and the console."""
    files = [("dev", stat.S_IFDIR | 0o755, b"", (0, 0)), ("dev/console", stat.S_IFCHR | 0o600, b"", (5, 1)),
             ("init", stat.S_IFREG | 0o755, init, (0, 0)), ("modules", stat.S_IFDIR | 0o755, b"", (0, 0))]
    files += [(f"modules/{n:02}", stat.S_IFREG | 0o644, data, (0, 0)) for n, data in enumerate(modules)]
    entries = [archive_entry(n, *file) for n, file in enumerate(files)]
    return b"".join(entries) + archive_entry(0, "TRAILER!!!", 0)


def in_order(index, names):
    """`names` and all they need, what is needed first."""
    order = []
    for name in map(same_name, names):
        for one in in_order(index, index[name]["depends"]) + [name]:
            if one not in order:
                order.append(one)
    return order


def make(work, abi, version):
    """All that a boot needs, in `work`: vmlinux, initramfs, modules/ and modules/index.json."""
    download(work, [f"linux-image-{abi}-amd64={version}", f"linux-headers-{abi}-amd64={version}",
                    f"linux-headers-{abi}-common={version}", f"linux-source-6.1={version}", "linux-kbuild-6.1",
                    "v4l2loopback-dkms"])
    for package in work.glob("*.deb"):
        if not package.name.startswith("linux-source"):
            run(["dpkg-deb", "-x", package, work])
    (work / "vmlinux").write_bytes(unpacked_kernel((work / f"boot/vmlinuz-{abi}-amd64").read_bytes()))
    modules = work / "modules"
    modules.mkdir()
    index = take_modules(work / "lib/modules", modules)
    for path in build_modules(work, abi).glob("*.ko"):
        shutil.copy(path, modules)
        index[same_name(path.stem)] = {"file": path.name, "depends": [same_name(one) for one in module_depends(path)]}
    (modules / "index.json").write_text(json.dumps(index, indent=1))
    run(["gcc", "-std=c11", "-Wall", "-Werror", "-O1", "-static", "-o", work / "init", INIT])
    early = [(modules / index[name]["file"]).read_bytes() for name in in_order(index, AT_BOOT)]
    (work / "initramfs").write_bytes(initramfs((work / "init").read_bytes(), early))


@functools.cache
def kernel():
    """The folder with vmlinux, initramfs and modules/; makes it when there is none."""
    ready = sorted(CACHE.glob(f"6.1.0-*-{recipe()}"))
    if ready:
        return ready[-1]
    for tool in ("apt-get", "apt-cache", "dpkg-deb", "gcc-12", "make"):
        if shutil.which(tool) is None:
            raise Missing(f"{tool} is missing: the guest's kernel is Debian 12's; run `make setup` there")
    abi, version = newest_kernel()
    print(f"guest: getting Debian's kernel {abi} ({version}), some 220 MB, and building its modules", flush=True)
    work = CACHE / f"making-{os.getpid()}"
    try:
        make(work, abi, version)
        place = CACHE / f"{abi}-{recipe()}"
        finished = work / "finished"
        finished.mkdir()
        for name in ("vmlinux", "initramfs", "modules"):
            (work / name).rename(finished / name)
        if not place.exists():  # another run may have been as quick
            finished.rename(place)
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return place


if __name__ == "__main__":
    print(kernel())
