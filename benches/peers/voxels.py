"""Harmonic coordinates on a voxel grid in numpy and scipy, Joshi, Meyer, DeRose, Green and Sanocki 2007."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy.sparse as sp

# Right-hand sides solved together: a task's vectors should stay in the processor's cache.
COLUMNS = 16
# Residual over right-hand side at which conjugate gradients end: far below the error of the grid.
TOLERANCE = 1e-5
# Nodes inside but closer to the cage than this fraction of a cell carry boundary values, as do those outside.
NEAR = 0.5


class VoxelHarmonic:
    """Laplace's equation by finite differences: nodes near the cage or outside it have the hat functions' values at the
    nearest point of the cage, the other ones follow by conjugate gradients, and points are interpolated trilinearly.
    """

    def __init__(self, vertices, triangles, cells):
        self.vertices, self.triangles = vertices, triangles
        low, high = vertices.min(0), vertices.max(0)
        self.step = (high - low).max() / cells
        # Not in line with the cage's vertices, so that no ray along the grid hits an edge.
        self.origin = low - self.step * np.array([1.31, 1.37, 1.29])
        self.shape = tuple(np.ceil((high - self.origin) / self.step).astype(int) + 2)

    def evaluate(self, points, threads):
        """Coordinates, n x m, column-major."""
        nodes = int(np.prod(self.shape))
        distance, face, weights = self._nearest()
        inside = self._inside().ravel()
        unknown = inside & (distance > NEAR * self.step)
        fixed = ~unknown & (face >= 0)
        self.unknowns = int(unknown.sum())
        # Neighbours differ in parity, so that the odd unknowns can be eliminated.
        where = np.flatnonzero(unknown)
        parity = np.sum(np.unravel_index(where, self.shape), axis=0) % 2
        where, odd = where[np.argsort(1 - parity, kind="stable")], int(parity.sum())
        number = np.full(nodes, -1)
        number[where] = np.arange(self.unknowns)
        number[fixed] = np.arange(int(fixed.sum()))
        rows = np.repeat(np.arange(int(fixed.sum())), 3)
        values = (weights[fixed].ravel(), (rows, self.triangles[face[fixed]].ravel()))
        hats = sp.csr_array(values, shape=(int(fixed.sum()), len(self.vertices)))

        strides = [self.shape[1] * self.shape[2], self.shape[2], 1]
        beside = np.concatenate([where + s for stride in strides for s in (stride, -stride)])
        of = np.tile(np.arange(self.unknowns), 6)
        free = unknown[beside]
        ones = np.ones(len(beside), dtype=np.float32)
        adjacency = sp.csr_array((ones[free], (of[free], number[beside[free]])), shape=(self.unknowns, self.unknowns))
        across = adjacency[:odd, odd:].tocsr()
        back = across.T.tocsr()
        reach = sp.csr_array((ones[~free], (of[~free], number[beside[~free]])), shape=(self.unknowns, hats.shape[0]))
        sides = (reach @ hats).astype(np.float32).tocsc()
        corners, shares = self._corners(points)
        at = np.repeat(np.arange(len(points)), 8)
        free = unknown[corners]

        def picked(kind, count):
            return sp.csr_array((shares[kind], (at[kind], number[corners[kind]])), shape=(len(points), count))

        from_unknown, from_fixed = picked(free, self.unknowns), (picked(~free, hats.shape[0]) @ hats).tocsc()
        phi = np.empty((len(points), len(self.vertices)), order="F")
        self.iterations = 0

        def work(start):
            columns = slice(start, min(start + COLUMNS, phi.shape[1]))
            found, iterations = solve(across, back, sides[:, columns].toarray())
            phi[:, columns] = from_unknown @ found + from_fixed[:, columns].toarray()
            self.iterations = max(self.iterations, iterations)

        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, range(0, phi.shape[1], COLUMNS)))
        return phi

    def _nearest(self):
        """Of every node near the cage: its distance, the nearest face (elsewhere -1) and the barycentric coordinates there."""
        nodes = int(np.prod(self.shape))
        distance, face, weights = np.full(nodes, np.inf), np.full(nodes, -1), np.zeros((nodes, 3))
        for f, corners in enumerate(self.vertices[self.triangles]):
            # No corner of a cell that the cage meets is farther away than the cell's diagonal.
            first = np.maximum(np.floor((corners.min(0) - self.origin) / self.step).astype(int) - 1, 0)
            last = np.minimum(np.floor((corners.max(0) - self.origin) / self.step).astype(int) + 3, self.shape)
            axes = [np.arange(a, b) for a, b in zip(first, last)]
            grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            bary = nearest_in_triangle(self.origin + self.step * grid, corners)
            away = np.linalg.norm(self.origin + self.step * grid - bary @ corners, axis=1)
            index = np.ravel_multi_index(grid.T, self.shape)
            nearer = away < distance[index]
            index = index[nearer]
            distance[index], face[index], weights[index] = away[nearer], f, bary[nearer]
        return distance, face, weights

    def _inside(self):
        """Whether nodes are inside: the parity of the faces below them."""
        crossings = np.zeros(self.shape, dtype=np.int32)
        scaled = (self.vertices - self.origin) / self.step
        for a, b, c in scaled[self.triangles]:
            area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            if area == 0.0:
                continue
            low = np.ceil(np.minimum(np.minimum(a, b), c)).astype(int)
            high = np.floor(np.maximum(np.maximum(a, b), c)).astype(int) + 1
            x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
            s = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
            t = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
            hit = (s >= 0) & (t >= 0) & (s + t <= 1)
            z = a[2] + s[hit] * (b[2] - a[2]) + t[hit] * (c[2] - a[2])
            np.add.at(crossings, (x[hit], y[hit], np.ceil(z).astype(int)), 1)
        return crossings.cumsum(axis=2) % 2 == 1

    def _corners(self, points):
        """The nodes around each point, eight a point, and their trilinear weights."""
        place = (points - self.origin) / self.step
        base = np.floor(place).astype(int)
        part = place - base
        offsets = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        corners = np.ravel_multi_index(tuple((base[:, None] + offsets).transpose(2, 0, 1)), self.shape)
        shares = np.where(offsets[None] == 1, part[:, None], 1.0 - part[:, None]).prod(axis=2)
        return corners.ravel(), shares.ravel()


def nearest_in_triangle(points, corners):
    """Barycentric coordinates of the point of a triangle that is nearest to each of the points."""
    a, b, c = corners
    found = np.zeros((len(points), 3))
    least = np.full(len(points), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        side = corners[j] - corners[i]
        along = np.clip((points - corners[i]) @ side / (side @ side), 0.0, 1.0)
        away = ((points - corners[i] - along[:, None] * side) ** 2).sum(1)
        nearer = away < least
        least[nearer] = away[nearer]
        found[nearer] = 0.0
        found[nearer, i], found[nearer, j] = 1.0 - along[nearer], along[nearer]
    normal = np.cross(b - a, c - a)
    normal /= normal @ normal
    second, third = (points - a) @ np.cross(c - a, -normal), (points - a) @ np.cross(normal, b - a)
    over = (second >= 0) & (third >= 0) & (second + third <= 1)
    found[over] = np.column_stack([1.0 - second - third, second, third])[over]
    return found


def solve(across, back, sides):
    """The solutions for all columns of `sides`, which eliminating the odd unknowns leads to in half the iterations, and these.

    `across` has the even neighbours of odd nodes, `back` the odd ones of even nodes. Single precision will do, as
    the error of the grid is larger by orders of magnitude.
    """
    odd = across.shape[0]
    even, iterations = conjugate_gradients(lambda x: 36 * x - back @ (across @ x), 6 * sides[odd:] + back @ sides[:odd])
    return np.concatenate([(sides[:odd] + across @ even) / 6, even]), iterations


def conjugate_gradients(operator, sides):
    """The solutions for all columns of `sides`, each with steps of its own, and the iterations taken."""
    x = np.zeros_like(sides)
    residual = sides.copy()
    direction = residual.copy()
    square = np.einsum("ij,ij->j", residual, residual)
    enough = TOLERANCE**2 * square
    iterations = 0
    while (square > enough).any():
        moved = operator(direction)
        curvature = np.einsum("ij,ij->j", direction, moved)
        length = np.divide(square, curvature, out=np.zeros_like(square), where=curvature > 0)
        moved *= length
        residual -= moved
        x += np.multiply(direction, length, out=moved)
        before, square = square, np.einsum("ij,ij->j", residual, residual)
        direction *= np.divide(square, before, out=np.zeros_like(square), where=before > 0)
        direction += residual
        iterations += 1
    return x, iterations
