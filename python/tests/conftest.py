"""Captures for the tests: a bending, breathing tube with a cage around it."""

from types import SimpleNamespace

import numpy as np
import pytest


def tube(rings, around, radius, ends):
    """Vertices and quads of a tube along y, with triangles that close its ends."""
    heights = np.linspace(-ends, ends, rings)
    angles = 2 * np.pi * np.arange(around) / around
    points = np.array([[radius * np.cos(a), y, -radius * np.sin(a)] for y in heights for a in angles])
    quads = [
        [r * around + a, r * around + (a + 1) % around, (r + 1) * around + (a + 1) % around, (r + 1) * around + a]
        for r in range(rings - 1)
        for a in range(around)
    ]
    points = np.vstack([points, [[0, -ends, 0], [0, ends, 0]]])
    bottom, top = len(points) - 2, len(points) - 1
    last = (rings - 1) * around
    caps = [[bottom, (a + 1) % around, a] for a in range(around)]
    caps += [[top, last + a, last + (a + 1) % around] for a in range(around)]
    return points, quads, caps


def bend(points, t):
    """A bend about z that grows with the height, a breath, and a wrinkle that no cage follows."""
    angle = 0.6 * np.sin(t) * points[:, 1]
    x, y, z = (points * (1 + 0.05 * np.sin(2 * t))).T
    bent = np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z], axis=1)
    return bent + 0.01 * np.sin(20 * points[:, [1]] + t)


@pytest.fixture(scope="session")
def small():
    points, quads, caps = tube(16, 24, 0.5, 1.0)
    vertices, cage_quads, cage_caps = tube(5, 8, 0.65, 1.2)
    cage_faces = [t for a, b, c, d in cage_quads for t in ([a, b, c], [a, c, d])] + cage_caps
    frames = np.stack([bend(points, t) for t in np.linspace(0, 2.5, 10)])
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    return SimpleNamespace(
        rest=points, faces=quads + caps, frames=frames, cage=(vertices, np.array(cage_faces)), diagonal=diagonal
    )
