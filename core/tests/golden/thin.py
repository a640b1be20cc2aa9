"""Mean value coordinates in thin cages to 150 digits: writes thin.txt, which the conformance suite compares rows with.

    python3 -m pip install mpmath==1.4.1
    python3 core/tests/golden/thin.py

Positions are written so that they read back as the very same doubles. A cage is `cage NAME VERTICES FACES` and then one
vertex or face a line; each of its points is a line `point X Y Z` and a line `row` with one value for each vertex.
"""

import math
import pathlib
import random

from mpmath import atan2, mp, mpf, sqrt

mp.dps = 150
THICKNESSES = [1e-3, 1e-6]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def barycentric(numerators, indices, count):
    """Coordinates of a point on the cage, from weights of the corners of what it lies on."""
    row = [mpf(0)] * count
    for index, value in zip(indices, numerators):
        row[index] = value / sum(numerators)
    return row


def coordinates(vertices, faces, x):
    """One row of Phi: Ju, Schaefer and Warren 2005, from the mean vectors of the faces."""
    r = [[mpf(v[k]) - mpf(x[k]) for k in range(3)] for v in vertices]
    lengths = [sqrt(dot(p, p)) for p in r]
    if 0 in lengths:
        return barycentric([mpf(1)], [lengths.index(0)], len(r))
    weights = [mpf(0)] * len(r)
    for face in faces:
        normals, factors = [], []
        for i in range(3):
            a, b = face[(i + 1) % 3], face[(i + 2) % 3]
            normal, cosine = cross(r[a], r[b]), dot(r[a], r[b])
            sine = sqrt(dot(normal, normal))
            if sine == 0 and cosine < 0:
                return barycentric([lengths[b], lengths[a]], [a, b], len(r))
            normals.append(normal)
            factors.append(atan2(sine, cosine) / sine if sine else 1 / cosine)
        mean = [sum(factors[i] * normals[i][k] for i in range(3)) / 2 for k in range(3)]
        numerators = [dot(mean, n) for n in normals]
        det = dot(r[face[0]], normals[0])
        if abs(det) > mpf(10) ** -130:
            for i in range(3):
                weights[face[i]] += numerators[i] / det
        elif dot(mean, mean) > 1:
            return barycentric(numerators, face, len(r))
    return [w / sum(weights) for w in weights]


def box(x, y, z):
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    vertices = [[x * (a - 0.5), y * (b - 0.5), z * (c - 0.5)] for c in (0, 1) for a, b in corners]
    sides = [f for i in range(4) for f in ((i, (i + 1) % 4, (i + 1) % 4 + 4), (i, (i + 1) % 4 + 4, i + 4))]
    return vertices, [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), *sides]


def tetrahedron(*vertices):
    faces = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    volume = sum(dot(vertices[a], cross(vertices[b], vertices[c])) for a, b, c in faces)
    return [list(map(float, v)) for v in vertices], faces if volume > 0 else [(a, c, b) for a, b, c in faces]


def turned(cage):
    """A cage along no axis, somewhere else."""
    s, c = math.sin(0.7), math.cos(0.7)
    vertices = [[c * v[0] - s * v[1] + 0.3, s * v[0] + c * v[1] - 1.7, v[2]] for v in cage[0]]
    return [[v[0], c * v[1] - s * v[2], s * v[1] + c * v[2] + 0.9] for v in vertices], cage[1]


def cages():
    for t in THICKNESSES:
        yield f"plate-{t:g}", box(1, 1, t)
        yield f"turned-rod-{t:g}", turned(box(1, t, t))
        yield f"needle-{t:g}", tetrahedron([0, 0, 0], [t, 0, 0], [0, t, 0], [0.3 * t, 0.3 * t, 1])
        yield f"sliver-{t:g}", turned(tetrahedron([-1, 0, -t], [1, 0, -t], [0, -1, t], [0, 1, t]))
    yield "rod-0.0001", box(1, 1e-4, 1e-4)


def points(name, vertices, faces):
    """Inside, far outside, beside the planes of faces; on faces, edges and vertices, and close to them."""
    source = random.Random(name)
    size = math.dist(*([f(v[k] for v in vertices) for k in range(3)] for f in (min, max)))

    def mixed(corners, weights):
        return [sum(w * c[k] for w, c in zip(weights, corners)) / sum(weights) for k in range(3)]

    def moved(p, distance):
        d = [source.gauss(0, 1) for _ in range(3)]
        return [a + distance * b / math.hypot(*d) for a, b in zip(p, d)]

    yield from ([mixed(vertices, [source.random() for _ in vertices]) for _ in range(2)])
    yield from (moved(vertices[0], size * r) for r in (0.01, 1, 10))
    for corners in (1, 2, 3):
        face = [vertices[v] for v in source.choice(faces)]
        on = mixed(face[:corners], [source.random() + 0.1 for _ in range(corners)])
        yield on
        yield from (moved(on, size * 10**e) for e in (-12, -8, source.choice([-11, -10, -9]), -4))
        beyond = mixed(face, [2.5, -0.7, -0.3])
        yield moved(beyond, size * 10 ** source.choice([-12, -9, -6]))
    if name == "rod-0.0001":
        yield [-2, 9e-5, -1e-4]
    if name == "plate-0.001":
        yield [-1, 0, 0.0009999]


def main():
    lines = []
    for name, (vertices, faces) in cages():
        lines.append(f"cage {name} {len(vertices)} {len(faces)}")
        lines += [" ".join(map(repr, map(float, v))) for v in vertices]
        lines += [" ".join(map(str, f)) for f in faces]
        for x in points(name, vertices, faces):
            lines.append("point " + " ".join(map(repr, map(float, x))))
            lines.append("row " + " ".join(format(float(w), ".15g") for w in coordinates(vertices, faces, x)))
    pathlib.Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
