"""A measure like the spatio-temporal edge difference (Váša and Skala 2011), straightforward from the definition in crates/core/src/sted.rs.

Measures the captures of benches/codec.py. Tests hold the program's own implementation against this one: run as a script, it reads a capture
as JSON and prints spatial part, temporal part and total.
"""

import json
import math
import sys

import numpy as np

RINGS, WINDOW, DT, WEIGHT = 1, 5, 0.01, 1.0


def edges_of(faces):
    """Each edge of some polygons once."""
    sides = {tuple(sorted((face[k - 1], face[k]))) for face in faces for k in range(len(face))}
    return np.array(sorted(side for side in sides if side[0] != side[1]), np.int64).reshape(-1, 2)


def neighbourhoods(edges, points, rings):
    """Pairs (vertex, edge) of all edges that have an end less than `rings` edges from the vertex."""
    if rings == 1:
        return edges.T.ravel(), np.tile(np.arange(len(edges)), 2)
    near = np.eye(points, dtype=bool)
    joined = np.eye(points, dtype=bool)
    joined[edges[:, 0], edges[:, 1]] = joined[edges[:, 1], edges[:, 0]] = True
    for _ in range(1, rings):
        near = near @ joined
    return np.nonzero(near[:, edges[:, 0]] | near[:, edges[:, 1]])


class Sted:
    """Of captures with these faces; keeps what belongs to the mesh alone."""

    def __init__(self, faces, points, diagonal, rings=RINGS, window=WINDOW, dt=DT, weight=WEIGHT):
        self.points, self.window, self.dt, self.weight = points, window, dt * diagonal, weight
        self.edges = edges_of(faces)
        self.vertex, self.edge = neighbourhoods(self.edges, points, rings)

    def spatial(self, captured, decoded):
        total, count = 0.0, 0
        for p, q in zip(captured, decoded):
            long, found = (np.linalg.norm(x[self.edges[:, 0]] - x[self.edges[:, 1]], axis=1) for x in (p, q))
            difference = np.divide(long - found, long, out=np.zeros_like(long), where=long != 0)
            at = lambda values: np.bincount(self.vertex, values[self.edge], self.points)
            weight = at(long)
            counted = weight != 0
            weight = np.where(counted, weight, 1)
            mean = at(long * difference) / weight
            squares = long[self.edge] * (difference[self.edge] - mean[self.vertex]) ** 2
            deviation = np.sqrt(np.bincount(self.vertex, squares, self.points) / weight)
            total += deviation[counted].sum()
            count += counted.sum()
        return total / count if count else math.nan

    def temporal(self, captured, decoded):
        if len(captured) < 2:
            return None
        steps, found = (np.sqrt(np.square(np.diff(x, axis=0)).sum(2) + self.dt**2) for x in (captured, decoded))
        difference = (steps - found) / steps
        run = min(self.window - 1, len(steps))
        total, count = 0.0, 0
        for first in range(len(steps) - run + 1):
            t, x = steps[first : first + run], difference[first : first + run]
            mean = (t * x).sum(0) / t.sum(0)
            deviation = np.sqrt((t * (x - mean) ** 2).sum(0) / t.sum(0))
            total += deviation.sum()
            count += len(deviation)
        return total / count

    def __call__(self, captured, decoded):
        """Spatial part, temporal part (none of a single frame) and STED of frames × points × 3."""
        captured, decoded = (np.asarray(x, np.float64) for x in (captured, decoded))
        spatial, temporal = self.spatial(captured, decoded), self.temporal(captured, decoded)
        return spatial, temporal, spatial if temporal is None else math.hypot(spatial, self.weight * temporal)


if __name__ == "__main__":
    given = json.load(sys.stdin)
    captured, decoded = (np.array(given.pop(key)) for key in ("captured", "decoded"))
    captured, decoded = (frames.reshape(len(frames), -1, 3) for frames in (captured, decoded))
    sted = Sted(given.pop("faces"), captured.shape[1], **given)
    print(*(repr(float(x)) for x in sted(captured, decoded)))
