# SPDX-License-Identifier: MIT
"""Runs a program under what stagectl.service lets it do, as far as that can be had without systemd as process 1: the system calls of
its SystemCallFilter= (seccomp(2)), and no memory that is both written and executed (PR_SET_MDWE, Linux 6.3)."""
import ctypes
import pathlib
import re
import shutil
import struct
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
UNIT = ROOT / "host/packaging/stagectl.service.in"
NUMBERS = pathlib.Path("/usr/include/x86_64-linux-gnu/asm/unistd_64.h")

# linux/prctl.h, linux/seccomp.h, linux/filter.h, linux/audit.h
PR_SET_SECCOMP, PR_SET_NO_NEW_PRIVS, PR_SET_MDWE, PR_GET_MDWE = 22, 38, 65, 66
SECCOMP_MODE_FILTER, RET_ALLOW, RET_KILL = 2, 0x7FFF0000, 0x80000000
LOAD_WORD, JUMP_IF_EQUAL, RETURN, ARCH_X86_64 = 0x20, 0x15, 0x06, 0xC000003E


def directives(name):
    return re.findall(rf"^{name}=(.*)$", UNIT.read_text(), re.MULTILINE)


def calls_of(group):
    """Names in a group of systemd's, groups in it included."""
    listing = subprocess.run(["systemd-analyze", "syscall-filter", group], capture_output=True, text=True, check=True).stdout
    names = set()
    for word in listing.split("\n")[1:]:
        word = word.strip()
        if word.startswith("@"):
            names |= calls_of(word)
        elif word and not word.startswith("#"):
            names.add(word)
    return names


def allowed_calls():
    """Numbers of the calls that the unit allows: systemd.exec(5), a later line with ~ takes calls away, @default stays."""
    allowed = calls_of("@default")
    for line in directives("SystemCallFilter"):
        listed = set().union(*(calls_of(word) if word.startswith("@") else {word} for word in line.lstrip("~").split()))
        allowed = allowed - (listed - calls_of("@default")) if line.startswith("~") else allowed | listed
    numbers = dict(re.findall(r"#define __NR_(\w+) (\d+)", NUMBERS.read_text()))
    return sorted(int(numbers[name]) for name in allowed if name in numbers)


def filter_program():
    """A call that is not allowed ends the program, so that none goes unnoticed."""

    def step(code, value, if_true=0, if_false=0):
        return struct.pack("HBBI", code, if_true, if_false, value)

    steps = [step(LOAD_WORD, 4), step(JUMP_IF_EQUAL, ARCH_X86_64, 1, 0), step(RETURN, RET_KILL), step(LOAD_WORD, 0)]
    for number in allowed_calls():
        steps += [step(JUMP_IF_EQUAL, number, 0, 1), step(RETURN, RET_ALLOW)]
    return steps + [step(RETURN, RET_KILL)]


def why_not():
    """What this machine lacks for it; else empty."""
    if not shutil.which("systemd-analyze"):
        return "no systemd-analyze"
    if not NUMBERS.exists():
        return "not x86-64"
    if ctypes.CDLL(None).prctl(PR_GET_MDWE, 0, 0, 0, 0) < 0:
        return "a kernel before 6.3"
    return ""


def run(command, **options):
    libc = ctypes.CDLL(None, use_errno=True)
    steps = filter_program()
    code = ctypes.create_string_buffer(b"".join(steps))
    program = ctypes.create_string_buffer(struct.pack("HxxxxxxQ", len(steps), ctypes.addressof(code)))

    def confine():
        for arguments in (
            (PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0),
            (PR_SET_MDWE, 1, 0, 0, 0),
            (PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.c_void_p(ctypes.addressof(program)), 0, 0),
        ):
            if libc.prctl(*arguments) != 0:
                raise OSError(ctypes.get_errno(), f"prctl {arguments[0]}")

    return subprocess.run(command, preexec_fn=confine, capture_output=True, text=True, timeout=300, **options)
