# SPDX-License-Identifier: MIT
# Environment maps made and given to rf; colour spaces by textbook arithmetic.
import json
import pathlib
import subprocess

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
REC709 = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290))


def write(path, data):
    path.write_bytes(data)
    return path


def rf(*command, limit_gb=4):
    limit = limit_gb << 30
    done = subprocess.run(["prlimit", f"--as={limit}", BIN / "rf", *map(str, command)], capture_output=True, text=True, timeout=60)
    assert done.returncode in (0, 1), (done.returncode, done.stderr)
    return done


def weights(path, *options):
    """What each lamp gives, and what was said."""
    done = rf("weights", "--env", path, "--json", *options)
    assert done.returncode == 0, done.stderr
    return np.array([lamp["irradiance"] for lamp in json.loads(done.stdout)["lamps"]]), done.stderr


def refused(path, *words, verb="compare", limit_gb=4):
    command = ("weights", "--env", path) if verb == "weights" else ("compare", path, path)
    done = rf(*command, limit_gb=limit_gb)
    assert done.returncode == 1, (done.stdout, done.stderr)
    for word in (path.name, *words):
        assert word in done.stderr, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


def to_xyz(space):
    """Columns are the primaries' XYZ; they add up to the white of luminance 1."""
    red, green, blue, white = (np.array([x, y, 1 - x - y]) for x, y in space)
    ends = np.stack([red, green, blue], 1)
    return ends * np.linalg.solve(ends, white / white[1])


def adapted(source, target):
    """Bradford, from one white point to another."""
    cone = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
    xyz = [np.array([x / y, 1, (1 - x - y) / y]) for x, y in (source, target)]
    return np.linalg.inv(cone) @ np.diag((cone @ xyz[1]) / (cone @ xyz[0])) @ cone


def to_rec709(space):
    return np.linalg.inv(to_xyz(REC709)) @ adapted(space[3], REC709[3]) @ to_xyz(space)
