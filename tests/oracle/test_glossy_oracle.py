# SPDX-License-Identifier: MIT
"""What 156 lamps make of gloss: a sphere of rough plastic under a sky, as its closed form in numpy, and relit by `rf` from its
single-lamp pictures. docs/relighting.md states the figures; `pytest -s tests/oracle/test_glossy_oracle.py` prints them.

The material is a microfacet coating of refractive index 1.49 over a diffuse base (Walter et al., "Microfacet Models for Refraction
through Rough Surfaces", EGSR 2007, equations 20, 22, 25, 27, 33, 34; the base is lit through the smooth boundary, as in Mitsuba's
`roughplastic`)."""
import re

import numpy as np
import pytest
from pictures import ROOT, cell_means, ingested, read_exr, run, sky, stage_lamps, texels, write_exr

SIZE = 32
ETA = 1.49
BASE = 0.5
ROTATIONS_DEG = range(0, 360, 45)  # whole texels
MATERIALS = {"matte": None, "Beckmann 0.25": ("beckmann", 0.25), "GGX 0.25": ("ggx", 0.25), "GGX 0.1": ("ggx", 0.1)}


def fresnel(cosine):
    """Reflectance of the boundary for unpolarised light from outside (eq. 22)."""
    g = np.sqrt(ETA**2 - 1 + cosine**2)
    parallel = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    return 0.5 * ((g - cosine) / (g + cosine)) ** 2 * (1 + parallel**2)


def inner_fresnel_mean():
    """Diffuse light from inside that the boundary throws back: 1 - (1 - mean from outside) / eta^2."""
    cosine = (np.arange(100_000) + 0.5) / 100_000
    return 1 - (1 - (2 * cosine * fresnel(cosine)).mean()) / ETA**2


def distribution(kind, alpha, cosine):
    tangent2 = 1 / cosine**2 - 1
    if kind == "beckmann":
        return np.exp(-tangent2 / alpha**2) / (np.pi * alpha**2 * cosine**4)  # eq. 25
    return alpha**2 / (np.pi * cosine**4 * (alpha**2 + tangent2) ** 2)  # eq. 33


def shadowing(kind, alpha, cosine):
    tangent = np.sqrt(1 / cosine**2 - 1)
    if kind == "ggx":
        return 2 / (1 + np.sqrt(1 + (alpha * tangent) ** 2))  # eq. 34
    a = np.minimum(1 / np.maximum(alpha * tangent, 1e-9), 1.6)
    return np.where(a < 1.6, (3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2), 1)  # eq. 27


def reflected(material, normals, to_light):
    """f cos for every normal (n, 3) and light (m, 3), seen from +Z: (n, m)."""
    cos_light, cos_view = np.clip(normals @ to_light.T, 1e-6, 1), normals[:, 2:]
    lit = (normals @ to_light.T > 0).astype(float)
    if material is None:
        return lit * cos_light / np.pi
    half = to_light + (0, 0, 1)
    half /= np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
    cos_half = np.clip(normals @ half.T, 1e-6, 1)
    gloss = distribution(*material, cos_half) * shadowing(*material, cos_light) * shadowing(*material, cos_view)
    gloss *= fresnel(np.clip(half[:, 2], 0, 1)) / (4 * cos_light * cos_view)
    base = BASE / np.pi / ETA**2 / (1 - BASE * inner_fresnel_mean()) * (1 - fresnel(cos_light)) * (1 - fresnel(cos_view))
    return lit * cos_light * (gloss + base)


def sphere():
    """Normals of the pixels that lie well within a sphere of radius 1, and where those are in the picture."""
    axis = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    x, y = np.meshgrid(axis, -axis)
    inside = x**2 + y**2 < 0.95**2
    return np.stack([x, y, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))], axis=-1)[inside], inside


def rotated(rgb, degrees):
    """As `rf relight --rotate`: light from +Z moves towards +X, which is left of the middle."""
    return np.roll(rgb, -round(degrees / 360 * rgb.shape[1]), axis=1)


def documented():
    """Rows of the page's table: {material: [(least, most) of each column, in %]}."""
    text = (ROOT / "docs/relighting.md").read_text()
    rows = re.findall(r"^\| (?:white|plastic), ([^|]+) \|(.+)\|$", text, re.MULTILINE)
    return {name: [tuple(map(float, re.findall(r"[\d.]+", cell))) for cell in cells.split("|")] for name, cells in rows}


@pytest.fixture(scope="module")
def lamps(tmp_path_factory):
    return stage_lamps(tmp_path_factory.mktemp("lamps"))


def test_the_material_is_reciprocal_and_gives_back_no_more_light_than_it_gets():
    directions, steradians = texels()
    directions, steradians = directions.reshape(3, -1).T, steradians.ravel()
    normal = np.array([[np.sin(0.6), 0, np.cos(0.6)]])
    for material in MATERIALS.values():
        seen = reflected(material, normal, directions)[0]
        assert 0.2 < (seen * steradians).sum() <= 1 + 1e-3
    # Light from the camera's side, seen along a direction, and the other way round: turned so that +Z is the camera again.
    light = np.array([[0.0, np.sin(0.9), np.cos(0.9)]])
    turn = np.array([[1, 0, 0], [0, np.cos(0.9), -np.sin(0.9)], [0, np.sin(0.9), np.cos(0.9)]])
    for material in list(MATERIALS.values())[1:]:
        there = reflected(material, normal, light)[0, 0] / (normal @ light.T)[0, 0]
        back = reflected(material, normal @ turn.T, np.array([[0, 0, 1.0]]) @ turn.T)[0, 0] / normal[0, 2]
        assert there == pytest.approx(back, rel=1e-9)


@pytest.mark.parametrize("name", MATERIALS)
def test_gloss_under_lamps_errs_as_the_page_says(name, lamps, tmp_path):
    normals, inside = sphere()
    directions, steradians = texels()
    transport = reflected(MATERIALS[name], normals, directions.reshape(3, -1).T)
    by_lamp = np.pi * reflected(MATERIALS[name], normals, lamps)  # under a lamp of irradiance pi
    pictures = np.zeros((len(lamps), SIZE, SIZE, 3))
    pictures[:, inside] = by_lamp.T[..., None]
    take = ingested(tmp_path, lamps, pictures, "--float")

    def truth(rgb):
        return transport @ (rgb * steradians[..., None]).reshape(-1, 3)

    errors = {"sky": [], "sun": [], "sun at lamp resolution": []}
    for light, degrees in [("sky", 0)] + [("sun", degrees) for degrees in ROTATIONS_DEG]:
        rgb = sky(with_sun=light == "sun")
        write_exr(tmp_path / "map.exr", rgb)
        run("rf", "relight", take, "--env", tmp_path / "map.exr", "--rotate", degrees, "--float", "-o", tmp_path / "relit.exr")
        relit, rgb = read_exr(tmp_path / "relit.exr", "RGB")[inside], rotated(rgb, degrees)

        def error(expected):
            return 100 * np.sqrt(((relit - expected) ** 2).mean()) / expected.mean()

        errors[light].append(error(truth(rgb)))
        if light == "sun":
            errors["sun at lamp resolution"].append(error(truth(cell_means(rgb, lamps))))
    for column, values in errors.items():
        print(f"{name:14} {column:24} {min(values):5.1f} to {max(values):5.1f} %, mean {np.mean(values):.1f} %")
    for (column, values), stated in zip(errors.items(), documented()[name], strict=True):
        assert stated == pytest.approx((min(values), max(values))[: len(stated)], abs=0.06), column
