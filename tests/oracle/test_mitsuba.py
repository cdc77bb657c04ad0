# SPDX-License-Identifier: MIT
# The virtual stage against Mitsuba 3, an independent renderer: the same mesh under single lamps.
import os
import pathlib
import subprocess

import numpy as np
import pytest

mitsuba = pytest.importorskip("mitsuba", reason="pip install mitsuba to compare with it")

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGESIM = ROOT / "build/host/bin/stagesim"
HEAD = pathlib.Path(os.environ.get("OLS_ASSETS", ROOT / ".cache/assets")) / "head.obj"
WIDTH, HEIGHT, FOV_DEG, ALBEDO = 160, 120, 16, 0.5

# From above, upper left, right, straight ahead, lower left: five of the stage's 156 lamps.
LAMPS = (15, 45, 62, 71, 115)


def read_mesh():
    """Positions and triangles of the head; its quads become two triangles each, as stagesim makes them."""
    positions, triangles = [], []
    for line in HEAD.read_text(encoding="ascii").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            positions.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(w) - 1 for w in words[1:]]
            triangles += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
    return np.array(positions), np.array(triangles)


def angle_weighted_normals(positions, triangles):
    """Both renderers get these normals, so that neither's own way of making them matters."""
    normals = np.zeros_like(positions)
    corners = positions[triangles]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-30)
    for i in range(3):
        a, b = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
        lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        angle = np.arccos(np.clip((a * b).sum(1) / np.maximum(lengths, 1e-30), -1, 1))
        np.add.at(normals, triangles[:, i], faces * angle[:, None])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def write_obj(path, positions, normals, triangles):
    lines = [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in positions]
    lines += [f"vn {x:.7f} {y:.7f} {z:.7f}" for x, y, z in normals]
    lines += ["f " + " ".join(f"{v}//{v}" for v in t + 1) for t in triangles]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    if not HEAD.exists():
        pytest.skip("make assets brings the head")
    folder = tmp_path_factory.mktemp("mitsuba")
    positions, triangles = read_mesh()
    write_obj(folder / "head.obj", positions, angle_weighted_normals(positions, triangles), triangles)
    (folder / "scene.toml").write_text(
        f'samples = 16\n[[material]]\nname = "clay"\nalbedo = [{ALBEDO}, {ALBEDO}, {ALBEDO}]\n'
        '[[object]]\nmesh = "head.obj"\nmaterial = "clay"\n')
    (folder / "stage.toml").write_text(
        f"[[camera]]\nwidth = {WIDTH}\nheight = {HEIGHT}\nvertical_fov_deg = {FOV_DEG}\n")
    return folder


def lamp_direction(lamp):
    """Vertices and edge midpoints of a once-subdivided icosahedron, top down, each ring from +z towards +x."""
    golden = (1 + 5 ** 0.5) / 2
    corners = np.array([(0, s, t * golden) for s in (1, -1) for t in (1, -1)])
    corners = np.concatenate([np.roll(corners, i, axis=1) for i in range(3)])
    corners /= np.linalg.norm(corners[0])
    # Turn one corner to +y, and another of its neighbours into the half plane x = 0, z > 0.
    up = corners[0]
    near = corners[np.argsort(-corners @ up)[1]]
    forward = near - up * (near @ up)
    forward /= np.linalg.norm(forward)
    corners = corners @ np.stack([np.cross(up, forward), up, forward]).T
    points = corners
    for _ in range(2):
        distance = np.linalg.norm(points[:, None] - points[None], axis=2)
        shortest = distance[distance > 1e-6].min()
        i, j = np.nonzero(np.triu((distance > 1e-6) & (distance < 1.2 * shortest)))
        middle = points[i] + points[j]
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
    azimuth = np.round(np.arctan2(points[:, 0], points[:, 2]) % (2 * np.pi), 6) % round(2 * np.pi, 6)
    order = np.lexsort((azimuth, -np.round(points[:, 1], 6)))
    return points[order][lamp]


def render_stagesim(folder, lamp):
    out = folder / f"stagesim_{lamp}.exr"
    subprocess.run([STAGESIM, "render", folder / "scene.toml", "--stage", folder / "stage.toml", "--lamps", str(lamp),
                    "--disable-effect", "beam", "-o", out], check=True)
    return np.array(mitsuba.Bitmap(str(out)))[:, :, 0]


def render_mitsuba(folder, lamp):
    look_at = mitsuba.ScalarTransform4f().look_at(origin=[0, 0, 1.6], target=[0, 0, 0], up=[0, 1, 0])
    scene = mitsuba.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},  # direct light alone
        "sensor": {"type": "perspective", "fov": FOV_DEG, "fov_axis": "y", "to_world": look_at,
                   "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "pixel_format": "luminance",
                            "component_format": "float32", "rfilter": {"type": "box"}},
                   "sampler": {"type": "stratified", "sample_count": 64, "seed": lamp}},
        # Intensity pi at 1 m: a white surface facing the lamp at the centre then has radiance 1, which is r = 1.
        "lamp": {"type": "point", "position": [float(v) for v in lamp_direction(lamp)], "intensity": np.pi},
        "head": {"type": "obj", "filename": str(folder / "head.obj"),
                 "bsdf": {"type": "diffuse", "reflectance": ALBEDO}},
    })
    return np.array(mitsuba.render(scene)).reshape(HEIGHT, WIDTH)


def away_from_edges(image):
    """Pixels whose neighbours differ little: no shadow edge, no silhouette."""
    padded = np.pad(image, 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))
    low, high = windows.min(axis=(2, 3)), windows.max(axis=(2, 3))
    return high - low < 0.25 * high


@pytest.mark.parametrize("lamp", LAMPS)
def test_a_single_lamp_gives_mitsubas_picture_outside_shadow_edges(work, lamp):
    mitsuba.set_variant("scalar_rgb")
    ours, theirs = render_stagesim(work, lamp), render_mitsuba(work, lamp)
    inside = away_from_edges(theirs) & (theirs > 0.02)
    assert inside.sum() > 300, "the lamp lights too little to compare"
    difference = np.abs(ours - theirs)[inside].mean() / theirs[inside].mean()
    bias = (ours[inside].mean() - theirs[inside].mean()) / theirs[inside].mean()
    whole = np.abs(ours - theirs).mean() / theirs.mean()
    print(f"lamp {lamp}: mean difference {difference:.3%}, bias {bias:+.3%}, edges included {whole:.3%}")
    assert difference < 0.005
    assert abs(bias) < 0.001
