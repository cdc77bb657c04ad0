# SPDX-License-Identifier: MIT
"""Catmull-Clark subdivision of quad and triangle meshes whose vertices carry any number of values."""


def _mean(rows):
    return [sum(column) / len(rows) for column in zip(*rows)]


def _edges(faces):
    """Edge (low, high) -> the faces on it."""
    edges = {}
    for index, face in enumerate(faces):
        for a, b in zip(face, face[1:] + face[:1]):
            edges.setdefault((a, b) if a < b else (b, a), []).append(index)
    return edges


def catmull_clark(vertices, faces):
    """One step (Catmull and Clark 1978; borders as cubic B-spline curves). Returns new vertices and quads.

    `vertices` are lists of floats of one length (position first, whatever follows is smoothed alike), `faces` lists of
    vertex indices.
    """
    edges = _edges(faces)
    face_points = [_mean([vertices[v] for v in face]) for face in faces]
    edge_points, edge_index = [], {}
    for edge, around in edges.items():
        rows = [vertices[edge[0]], vertices[edge[1]]]
        if len(around) == 2:
            rows += [face_points[f] for f in around]
        edge_index[edge] = len(vertices) + len(edge_points)
        edge_points.append(_mean(rows))

    moved = _moved_vertices(vertices, faces, edges, face_points)
    first_face_point = len(vertices) + len(edge_points)
    quads = []
    for f, face in enumerate(faces):
        for i, v in enumerate(face):
            after, before = face[(i + 1) % len(face)], face[i - 1]
            quads.append([v, edge_index[min(v, after), max(v, after)], first_face_point + f,
                          edge_index[min(v, before), max(v, before)]])
    return moved + edge_points + face_points, quads


def _moved_vertices(vertices, faces, edges, face_points):
    faces_at, middles_at, border_at = {}, {}, {}
    for f, face in enumerate(faces):
        for v in face:
            faces_at.setdefault(v, []).append(f)
    for (a, b), around in edges.items():
        middle = _mean([vertices[a], vertices[b]])
        for v in (a, b):
            middles_at.setdefault(v, []).append(middle)
            if len(around) != 2:
                border_at.setdefault(v, []).append(middle)
    moved = []
    for v, old in enumerate(vertices):
        if v not in faces_at:
            moved.append(old)
        elif v in border_at:
            middle = _mean(border_at[v])
            moved.append([(m + o) / 2 for m, o in zip(middle, old)])
        else:
            n = len(faces_at[v])
            around, middle = _mean([face_points[f] for f in faces_at[v]]), _mean(middles_at[v])
            moved.append([(q + 2 * r + (n - 3) * s) / n for q, r, s in zip(around, middle, old)])
    return moved
