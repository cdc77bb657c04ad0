# SPDX-License-Identifier: MIT
# Stages and scenes as strangers write them, through the programs: rendered right, or refused with file, line, key and range.
import json
import math
import os
import pathlib
import subprocess

import numpy as np
import OpenEXR
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = ROOT / "build/host/bin"
SCENE = ROOT / "tools/stagesim/scenes/card.toml"
SMALL = "[[camera]]\nwidth = 16\nheight = 16\n"
BALL = '[[material]]\nname = "m"\n[[object]]\nmaterial = "m"\nsphere = { radius_m = 0.1 }\n'
MESH = '[[material]]\nname = "m"\n[[object]]\nmaterial = "m"\nmesh = "m.obj"\n'
SQUARE = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n"


def run(*command, code=0):
    done = subprocess.run([BIN / command[0], *map(str, command[1:])], capture_output=True, text=True, timeout=60)
    assert done.returncode == code, (done.returncode, done.stdout, done.stderr)
    return done.stdout if code == 0 else done.stderr


def pixels(path):
    channels = OpenEXR.File(str(path)).channels()
    return channels["RGB"].pixels if "RGB" in channels else channels["Y"].pixels


def render(folder, scene, stage=SMALL, code=0, out="out.exr"):
    (folder / "scene.toml").write_text(scene)
    (folder / "stage.toml").write_text(stage)
    return run("stagesim", "render", folder / "scene.toml", "--stage", folder / "stage.toml", "--all-lamps", "-o", folder / out, code=code)


def half_sphere(count):
    """Directions spread evenly over the half towards the camera."""
    z = (np.arange(count) + 0.5) / count
    angle = np.arange(count) * math.pi * (3 - math.sqrt(5))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def write_lp(path, directions):
    path.write_text(f"{len(directions)}\n" + "".join(f"l{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(directions)))


@pytest.fixture
def many(tmp_path):
    """A stage of more lamps than a chain drives, without a matte board's."""
    write_lp(tmp_path / "many.lp", half_sphere(400))
    (tmp_path / "stage.toml").write_text('[lamps]\nlp = "many.lp"\n[[camera]]\nwidth = 16\nheight = 16\nvignetting = 0\ncfa = "rgb"\n')
    return tmp_path


def test_more_lamps_than_a_chain_drives_are_rendered_each_and_ingested_at_once(many):
    folder = many / "olat"
    run("stagesim", "render", SCENE, "--stage", many / "stage.toml", "--olat", "-o", folder)
    directions = half_sphere(400)
    listed = [line.split() for line in (folder / "lights.lp").read_text().splitlines()[1:]]
    assert [name for name, *_ in listed] == [f"lamp_{i:03}.exr" for i in range(400)]
    assert np.allclose([list(map(float, xyz)) for _, *xyz in listed], directions, atol=1e-8)
    # The card faces +z, its centre has all lamps at 1 m, on their beams' axes: Lambert's cosine is all that differs.
    centre = np.array([pixels(folder / f"lamp_{i:03}.exr")[7:9, 7:9].mean() for i in range(0, 400, 13)])
    cosines = directions[::13, 2]
    assert np.allclose(centre / centre[-1], cosines / cosines[-1], rtol=0.02, atol=1e-4)
    run("stagectl", "ingest", folder, "--lights", folder / "lights.lp", "-o", many / "take.rfa")
    assert json.loads(run("rf", "info", many / "take.rfa", "--json"))["lamps"] == 400


def test_lights_of_the_default_stage_are_ingested_at_once(tmp_path):
    (tmp_path / "stage.toml").write_text(SMALL)
    report = json.loads(run("stagesim", "render", SCENE, "--stage", tmp_path / "stage.toml", "--olat", "-o", tmp_path / "olat", "--json"))
    assert report["lights"] == str(tmp_path / "olat/lights.lp")
    run("stagectl", "ingest", tmp_path / "olat", "--lights", report["lights"], "-o", tmp_path / "take.rfa")
    assert json.loads(run("rf", "info", tmp_path / "take.rfa", "--json"))["lamps"] == 156


def test_more_lamps_than_a_chain_drives_are_not_played(many):
    for command in (("stagesim", "run", SCENE, "--work", many / "work", "--stage"),
                    ("stagectl", "sequence", "--basis", "single", "--stage")):
        assert "a board's chain drives 256" in run(*command, many / "stage.toml", code=1)
    (many / "stage.toml").write_text('[lamps]\nlp = "many.lp"\n[chain]\nbits = 256\n')
    assert "stage.toml:" in run("stagesim", "render", SCENE, "--stage", many / "stage.toml", "--lamps", "0", "-o", many / "o.exr", code=1)


STAGES = [
    ("[[camera]]\nposition_m = [0, 0, 1]\nlook_at_m = [0, 0, 1]\n", ":3: camera.look_at_m is where the camera stands"),
    ("[[camera]]\nposition_m = [1e308, 0, 1]\n", ":2: camera.position_m must be a list of three numbers from -1000 to 1000"),
    ("[[camera]]\nlook_at_m = [0, -1e308, 0]\n", ":2: camera.look_at_m must be a list of three numbers"),
    ("[[camera]]\nup = [0, 0, 1]\n", ":2: camera.up is parallel to the view"),
    ("[[camera]]\nup = [0, 0, -1e-5]\n", ":2: camera.up is parallel to the view"),
    ("[[camera]]\nup = [0, 0, 0]\n", ":2: camera.up must be longer"),
    ("[[camera]]\nup = [0, nan, 0]\n", ":2: camera.up must be a list of three numbers"),
    ("[[camera]]\nup = [0, 1]\n", ":2: camera.up must be a list of three numbers"),
    ("[[camera]]\nposition_m = [0, inf, 0]\n", ":2: camera.position_m must be a list of three numbers"),
    ("[[camera]]\nwidth = 1000000\n", ":2: camera.width must be a whole number from 8 to 16384"),
    ("[[camera]]\nwidth = 4294967312\n", ":2: camera.width must be a whole number from 8 to 16384"),
    ("[[camera]]\nwidth = 16384\nheight = 16384\n", "16384 x 16384 pixels of 1 samples may take"),
    ("[[camera]]\nvertical_fov_deg = 180\n", ":2: camera.vertical_fov_deg must be a number from 0.1 to 170"),
    ("[[camera]]\nwidth = 16\nwidth = 17\n", ":3: "),
    ("[lamps]\nradius_m = nan\n", ":2: lamps.radius_m must be a number from"),
    ("[lamps]\nradius_m = 0\n", ":2: lamps.radius_m must be a number from"),
    ("[lamps]\nbeam_exponent = -inf\n", ":2: lamps.beam_exponent must be a number from"),
    ("[[lamps.matte]]\nposition_m = [1e308, 1e308, 1e308]\n", ":2: lamps.matte.position_m must be a list of three numbers"),
    ("[chain]\nbits = 2147483648\n", ":2: chain.bits must be a whole number from 1 to 256"),
    ("[[camera]]\n" * 65, ":1: camera has 65 tables and may have 64"),
    ("[{", ":1: "),
    ("{a=" * 60_000, ":1: nests deeper than"),
    ("x = " + "[" * 60_000, ":1: nests deeper than"),
    ("\xff", "stage.toml:1: "),
]


@pytest.mark.parametrize("stage, why", STAGES)
def test_a_stage_that_cannot_be_is_refused(tmp_path, stage, why):
    (tmp_path / "scene.toml").write_text("samples = 1\n" + BALL)
    (tmp_path / "stage.toml").write_bytes(stage.encode("latin-1"))
    error = run("stagesim", "render", tmp_path / "scene.toml", "--stage", tmp_path / "stage.toml", "--lamps", "0", "-o",
                tmp_path / "o.exr", code=1)
    assert why in error and len(error) < 1000
    assert not (tmp_path / "o.exr").exists()
    if "samples" not in why:
        assert why in run("stagectl", "sequence", "--basis", "single", "--stage", tmp_path / "stage.toml", code=1)


SCENES = [
    (BALL + "position_m = [1e308, 0, 0]\n", ":6: object.position_m must be a list of three numbers"),
    (BALL.replace("0.1", "nan"), ":5: object.sphere.radius_m must be a number from"),
    (BALL.replace("sphere = { radius_m = 0.1 }", "quad = { normal = [0, 0, 0] }"), ":5: object.quad.normal must be longer"),
    (BALL.replace("sphere = { radius_m = 0.1 }", "quad = { up = [0, 0, 2] }"), "object.quad.up is parallel to normal"),
    ("samples = 1000000\n" + BALL, ":1: samples must be a whole number from"),
    ("seed = -1\n" + BALL, ":1: seed must be a whole number from 0 to"),
    ("seed = 1.5\n" + BALL, ":1: seed must be a whole number from 0 to"),
    ("[clock]\noffset_ns = 9223372036854775807\n" + BALL, ":2: clock.offset_ns must be a whole number from 0 to"),
    (BALL + "[[object.motion]]\ntime_us = 1e300\n", ":7: object.motion.time_us must be a number from 0 to"),
    (BALL + "[board]\ncenter_m = [-0.25, 0.32, -0.35]\n", "move one of them"),
    ('[[material]]\nname = "m"\nalbedo = [0.5, nan, 0.5]\n' + BALL, ":3: material.albedo must be a list of three numbers from 0 to 1"),
    (MESH.replace("m.obj", ""), ":5: object.mesh cannot be used: the path of the mesh is empty"),
    (MESH.replace("m.obj", "."), "it is a folder, not a file"),
    (MESH.replace("m.obj", "pipe"), "it is a pipe, not a file"),
    (MESH.replace("m.obj", "/dev/urandom"), "it is a device, not a file"),
    (MESH + "scale = 0\n", ":6: object.scale must be a number from"),
    (MESH + "rotation_axis = [0, 0, 0]\n", ":6: object.rotation_axis must be longer"),
    (MESH + "position_m = [5000, 0, 0]\n", "m, more than 1000 m from the stage's centre"),
    (MESH + 'masks = "vertex_colors"\n', ":6: object.masks names vertex colours, and the mesh has none"),
    (MESH + 'masks = "colours"\n', ":6: object.masks"),
    (MESH + '[[object.expression]]\ntarget = ""\n', "the path of the target is empty"),
]


@pytest.mark.parametrize("scene, why", SCENES)
def test_a_scene_that_cannot_be_is_refused(tmp_path, scene, why):
    (tmp_path / "m.obj").write_text(SQUARE)
    os.mkfifo(tmp_path / "pipe")
    assert why in render(tmp_path, scene, code=1)
    assert not (tmp_path / "out.exr").exists()


def test_a_mesh_far_off_makes_the_picture_of_one_nearby(tmp_path):
    (tmp_path / "m.obj").write_text("v -.03 -.02 0\nv .05 -.01 0\nv .01 .04 .01\nf 1 2 3\n")
    render(tmp_path, MESH, out="near.exr")
    (tmp_path / "m.obj").write_text("v 999999.97 -1000000.02 1e6\nv 1000000.05 -1000000.01 1e6\nv 1000000.01 -999999.96 1000000.01\nf 1 2 3\n")
    render(tmp_path, MESH + "position_m = [-1e6, 1e6, -1e6]\n", out="far.exr")
    near, far = pixels(tmp_path / "near.exr"), pixels(tmp_path / "far.exr")
    assert near.max() > 0.1 and np.abs(near - far).max() < 1e-3 * near.max()


def test_a_concave_polygon_shows_what_lies_in_its_notch(tmp_path):
    # An arrow whose notch is the centre: a fan of its first corner would cover it.
    (tmp_path / "m.obj").write_text("v 0 .05 0\nv -.2 -.2 0\nv 0 .2 0\nv .2 -.2 0\nf 2 1 4 3\n")
    render(tmp_path, MESH, stage="[[camera]]\nwidth = 64\nheight = 64\n")
    picture = pixels(tmp_path / "out.exr").max(axis=2)
    size = 2 * 1.6 * math.tan(math.radians(8)) / 64  # of a pixel, on the plane
    # The point (0, y) is in row 31.5 - y / size.
    assert (picture[32:, 30:34] == 0).all() and (picture[int(31.5 - 0.12 / size), 30:34] > 0).all()


def test_vertex_colours_are_masks_only_where_the_scene_says_so(tmp_path):
    plain = SQUARE.splitlines()
    skin = MESH.replace('name = "m"\n', 'name = "m"\ntype = "skin"\n', 1)
    (tmp_path / "m.obj").write_text(SQUARE)
    render(tmp_path, skin, out="plain.exr")
    (tmp_path / "m.obj").write_text("\n".join(line + " 1 0.5 0.25" if line[0] == "v" else line for line in plain))
    render(tmp_path, skin, out="coloured.exr")
    render(tmp_path, skin + 'masks = "vertex_colors"\n', out="masked.exr")
    plain, coloured, masked = (pixels(tmp_path / f"{name}.exr") for name in ("plain", "coloured", "masked"))
    assert (plain == coloured).all() and not (plain == masked).all()


def test_what_of_a_mesh_is_not_used_is_said_once(tmp_path):
    (tmp_path / "m.obj").write_text("mtllib a.mtl\nvt 0 0\nvt 1 1\nusemtl a\n" + SQUARE)
    (tmp_path / "scene.toml").write_text(MESH)
    done = subprocess.run([BIN / "stagesim", "render", tmp_path / "scene.toml", "--lamps", "0", "-o", tmp_path / "o.exr"],
                          capture_output=True, text=True, check=True)
    for what in ("2 texture coordinates", "1 materials (usemtl)", "1 material files"):
        assert done.stderr.count(what) == 1, done.stderr


@pytest.mark.parametrize("option", ["--at-us", "--png-gain"])
@pytest.mark.parametrize("value", ["nan", "inf", "1e300", "x"])
def test_numbers_of_the_command_line_have_ranges(tmp_path, option, value):
    done = subprocess.run([BIN / "stagesim", "render", SCENE, "--lamps", "0", "-o", tmp_path / "o.exr", option, value],
                          capture_output=True, text=True)
    assert done.returncode not in (0, 1) and done.returncode > 0 and option in done.stderr, done


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"weights": 1}', '{"weights": [1e300]}', '{"weights": ["1"]}', '{"weights": [[1, 2]]}',
                                  '{"weights": [1], "unit": "W"}', '{"weights": ' + json.dumps([1] * 163) + "}", "[" * 100_000, "\xff"])
def test_weights_that_cannot_be_are_refused(tmp_path, text):
    (tmp_path / "w.json").write_bytes(text.encode("latin-1"))
    said = run("stagesim", "render", SCENE, "--weights", tmp_path / "w.json", "-o", tmp_path / "o.exr", code=1)
    assert ("w.json' must hold" if text[:1] in ("[", "{") and len(text) < 10_000 else "w.json' is damaged") in said
    (tmp_path / "w.json").unlink()
    os.mkfifo(tmp_path / "w.json")
    assert "is a pipe" in run("stagesim", "render", SCENE, "--weights", tmp_path / "w.json", "-o", tmp_path / "o.exr", code=1)


def test_weights_are_those_of_the_file(tmp_path):
    (tmp_path / "stage.toml").write_text(SMALL)
    weights = [0] * 60 + [2, [0, 0.5, 1]]
    (tmp_path / "w.json").write_text(json.dumps({"weights": weights}))
    for name, light in (("both", ("--weights", tmp_path / "w.json")), ("a", ("--lamps", "60")), ("b", ("--lamps", "61"))):
        run("stagesim", "render", SCENE, "--stage", tmp_path / "stage.toml", *light, "-o", tmp_path / f"{name}.exr")
    both, a, b = (pixels(tmp_path / f"{name}.exr") for name in ("both", "a", "b"))
    assert both.max() > 0 and np.allclose(both, 2 * a + np.array([0, 0.5, 1]) * b, rtol=1e-5)
