# SPDX-License-Identifier: MIT
"""Relighting against Mitsuba 3, an independent renderer: the same shape under a whole environment map, and relit by `rf` from 156
single-lamp pictures.

Lamps stand for a map as far as 156 directions can. What they cannot resolve is measured apart: Mitsuba also renders the map
after each lamp's cell was given its mean radiance. Skipped where mitsuba is not installed
(`.venv/bin/pip install mitsuba`); the head comes from `make assets` or the folder OLS_ASSETS."""
import os
from pathlib import Path

import numpy as np
import pytest
from pictures import MAP_HEIGHT, ROOT, cell_means, ingested, read_exr, run, sky, stage_lamps, write_exr

mi = pytest.importorskip("mitsuba", reason="mitsuba is not installed: .venv/bin/pip install mitsuba")
mi.set_variant("scalar_rgb")

ASSETS = Path(os.environ.get("OLS_ASSETS", ROOT / ".cache/assets"))
SIZE = 48

SPHERE = {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [1, 1, 1]}}}


def render(shape, half_width, light, samples, seed=0):
    """What an orthographic camera on +Z sees, direct light only, box filter: scene-linear SIZE x SIZE x 3."""
    view = mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
    view = view @ mi.ScalarTransform4f().scale([half_width, half_width, 1])
    film = {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    sensor = {"type": "orthographic", "to_world": view, "film": film}
    sensor["sampler"] = {"type": "stratified", "sample_count": samples, "seed": seed}
    # One emitter sample is enough for a single lamp; a map is sampled by its radiance.
    integrator = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0 if light["type"] == "directional" else 1}
    integrator["hide_emitters"] = True
    scene = {"type": "scene", "integrator": integrator, "sensor": sensor, "shape": shape, "light": light}
    return np.array(mi.render(mi.load_dict(scene), spp=samples, seed=seed)).astype(np.float64)


def map_light(rgb):
    return {"type": "envmap", "bitmap": mi.Bitmap(rgb.astype(np.float32))}


def lamp_light(direction):
    """A lamp of irradiance pi on a facing surface, so that a white Lambertian surface shows r = max(0, n.l)."""
    light = {"type": "directional", "direction": [float(-v) for v in direction]}
    light["irradiance"] = {"type": "rgb", "value": [np.pi] * 3}
    return light


@pytest.fixture(scope="module")
def lamps(tmp_path_factory):
    return stage_lamps(tmp_path_factory.mktemp("lamps"))


def archive_of(shape, half_width, lamps, folder, samples):
    """Mitsuba photographs every lamp alone; stagectl takes the pictures in as any photographs."""
    pictures = [render(shape, half_width, lamp_light(lamp), samples, seed) for seed, lamp in enumerate(lamps)]
    return ingested(folder, lamps, pictures)


def relit(archive, rgb, folder, *options):
    write_exr(folder / "map.exr", rgb)
    run("rf", "relight", archive, "--env", folder / "map.exr", "--float", "-o", folder / "relit.exr", *options)
    return read_exr(folder / "relit.exr", "RGB")


class Truth:
    """Two independent renderings, so that Mitsuba's own noise drops out of what is measured against them."""

    def __init__(self, shape, half_width, rgb, samples=96):
        self.a, self.b = (render(shape, half_width, map_light(rgb), samples, seed) for seed in (1, 2))
        self.mean = (self.a + self.b) / 2

    def rms_difference(self, got, inside):
        """Relative to the mean: the errors against two pictures of independent noise multiply to the square of what is
        common to both, which is the true difference."""
        square = ((got - self.a) * (got - self.b))[inside].mean()
        return np.sqrt(max(square, 0)) / self.mean[inside].mean()

    def bias(self, got, inside):
        return (got - self.mean)[inside].mean() / self.mean[inside].mean()


@pytest.fixture(scope="module")
def sphere_take(lamps, tmp_path_factory):
    return archive_of(SPHERE, 1.0, lamps, tmp_path_factory.mktemp("sphere"), samples=16)


def sphere_inside():
    axis = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    return axis[None, :] ** 2 + axis[:, None] ** 2 < 0.95**2


@pytest.mark.parametrize("with_sun", [False, True])
def test_a_sphere_under_a_sky_is_mitsubas_sphere(sphere_take, tmp_path, lamps, with_sun):
    rgb = sky(with_sun)
    got, inside = relit(sphere_take, rgb, tmp_path), sphere_inside()
    full, at_lamps = Truth(SPHERE, 1.0, rgb), Truth(SPHERE, 1.0, cell_means(rgb, lamps))
    print(f"rms {full.rms_difference(got, inside):.4f} bias {full.bias(got, inside):+.4f}, of the map at lamp resolution "
          f"rms {at_lamps.rms_difference(got, inside):.4f} bias {at_lamps.bias(got, inside):+.4f}")
    # A hard sun is moved to its lamp, up to 10.8 degrees; that is what lamps cannot resolve.
    assert (at_lamps if with_sun else full).rms_difference(got, inside) < 0.01


@pytest.mark.parametrize("u, v", [(0.02, 0.3), (0.25, 0.5), (0.4, 0.2), (0.5, 0.5), (0.62, 0.65), (0.75, 0.5), (0.9, 0.4)])
def test_one_bright_texel_lights_the_same_side_as_in_mitsuba(sphere_take, tmp_path, u, v):
    rgb = np.zeros((MAP_HEIGHT, 2 * MAP_HEIGHT, 3))
    rgb[int(v * MAP_HEIGHT), int(u * 2 * MAP_HEIGHT)] = 1000
    truth, got = render(SPHERE, 1.0, map_light(rgb), samples=16), relit(sphere_take, rgb, tmp_path)

    def centroid(image):
        axis = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
        weight = image[..., 0] / image[..., 0].sum()
        return np.array([(weight * axis[None, :]).sum(), (weight * axis[:, None]).sum()])

    # A lamp stands at most 10.8 degrees from what it is lit for.
    assert np.abs(centroid(truth) - centroid(got)).max() < np.radians(10.9)


@pytest.mark.skipif(not (ASSETS / "head.obj").exists(), reason="no head.obj: run `make assets`")
def test_the_head_under_a_real_map_is_mitsubas_head(lamps, tmp_path):
    shape = mi.load_dict({"type": "obj", "filename": str(ASSETS / "head.obj"), "bsdf": {"type": "twosided", "bsdf": SPHERE["bsdf"]}})
    take = archive_of(shape, 0.16, lamps, tmp_path / "head", samples=16)
    for name in ("courtyard", "sunset"):
        path = next(ASSETS.rglob(f"{name}.exr"))
        rgb = np.clip(read_exr(path, "RGB"), 0, None)
        rgb = rgb.reshape(MAP_HEIGHT, rgb.shape[0] // MAP_HEIGHT, 2 * MAP_HEIGHT, -1, 3).mean(axis=(1, 3))
        got, full, at_lamps = relit(take, rgb, tmp_path), Truth(shape, 0.16, rgb), Truth(shape, 0.16, cell_means(rgb, lamps))
        inside = render(shape, 0.16, {"type": "constant"}, samples=16)[..., 0] > 0.05
        print(f"{name}: rms {full.rms_difference(got, inside):.4f} bias {full.bias(got, inside):+.4f}, of the map at lamp "
              f"resolution rms {at_lamps.rms_difference(got, inside):.4f} bias {at_lamps.bias(got, inside):+.4f}")
        assert full.rms_difference(got, inside) < 0.02
