"""Green coordinates of points inside a triangle cage in numpy, Lipman, Levin and Cohen-Or 2008."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy.sparse as sp

# Points per work item: the edge- and face-sized temporaries should stay in a core's L2 cache.
CHUNK = 64


def unit_normals(vertices, triangles):
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1)[:, None]


class Green:
    """Closed form in one logarithm per edge and one arctangent per face, without a division by the distance to a face.

    Seen from x, a face has the solid angle W, and x has the height h over its plane (positive inside) and at its foot
    there barycentric coordinates t_i. With L_k = ln((r + s + l) / (r + s - l)) / l over edge k of length l, whose ends
    are r and s away, the integrals of the paper over the face of double area A are
        4 pi psi   = A (t_0 L_0 + t_1 L_1 + t_2 L_2) - h W
        4 pi phi_i = t_i W - h grad t_i . sum_k l_k u_k L_k
    for outward edge normals u_k in the plane. From sum_k l_k u_k = 0 and sum_i t_i = 1 follows the shorter form used here.
    """

    def __init__(self, vertices, triangles):
        self.vertices = vertices
        faces = len(triangles)
        ends = np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]])
        edges, inverse = np.unique(np.sort(ends.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
        # opposite[i] is the edge across from corner i of every face.
        self.opposite = np.ascontiguousarray(inverse.reshape(3, -1))
        self.corner = np.ascontiguousarray(triangles.T)
        self.first, self.second = (np.ascontiguousarray(c) for c in edges.T)
        self.length2 = ((vertices[self.first] - vertices[self.second]) ** 2).sum(1)[:, None]
        self.length = np.sqrt(self.length2)

        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        sides = [c - b, a - c, b - a]
        normals = np.cross(sides[2], -sides[1])
        double_area = np.linalg.norm(normals, axis=1)
        normals /= double_area[:, None]
        gradients = [np.cross(normals, side) / double_area[:, None] for side in sides[:2]]
        # Rows of t_0, t_1 and h as affine functions of x.
        linear = np.concatenate([*gradients, -normals])
        bases = np.concatenate([b, c, a])
        self.affine = np.column_stack([linear, -(linear * bases).sum(1)])
        self.double_area = double_area[:, None]
        # l_k u_k = side_k x n.
        across = [np.cross(side, normals) for side in sides[:2]]
        self.bend = [[(g * u).sum(1)[:, None] for u in across] for g in gradients]
        self.gather = sp.csr_array(
            (np.ones(3 * faces), (triangles.T.ravel(), np.arange(3 * faces))), shape=(len(vertices), 3 * faces)
        )

    def evaluate(self, points, threads):
        """Coordinates of the vertices and then of the unit normals of the faces, n x (m + f), column-major."""
        m = len(self.vertices)
        transposed = np.empty((m + len(self.double_area), len(points)))

        def work(start):
            stop = min(start + CHUNK, len(points))
            self._chunk(points[start:stop], transposed[:m, start:stop], transposed[m:, start:stop])

        # numpy's loops run without the interpreter's lock, so threads do help.
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, range(0, len(points), CHUNK)))
        return transposed.T

    def _chunk(self, points, phi, psi):
        count, faces = len(points), len(psi)
        distance2 = np.zeros(phi.shape)
        for axis in range(3):
            step = self.vertices[:, axis, None] - points[None, :, axis]
            step *= step
            distance2 += step
        distance = np.sqrt(distance2)
        # Products of the vectors to the ends of an edge, and L / 4 pi.
        product = distance2[self.first]
        product += distance2[self.second]
        product -= self.length2
        product *= 0.5
        way = distance[self.first]
        way += distance[self.second]
        less = way - self.length
        way += self.length
        np.maximum(less, 1e-300, out=less)
        way /= less
        logarithm = np.log(way, out=way)
        logarithm *= 0.25 / np.pi / self.length

        bottom = None
        for corner, edge in zip(self.corner, self.opposite):
            r = distance[corner]
            term = product[edge]
            term *= r
            if bottom is None:
                bottom, volume = term, r
            else:
                bottom += term
                volume *= r
        bottom += volume
        homogeneous = np.concatenate([points.T, np.ones((1, count))])
        t0, t1, height = (self.affine @ homogeneous).reshape(3, faces, count)
        angle = np.multiply(height, self.double_area, out=volume)
        np.arctan2(angle, bottom, out=angle)
        angle *= 0.5 / np.pi

        last = logarithm[self.opposite[2]]
        ways = [logarithm[edge] for edge in self.opposite[:2]]
        for l in ways:
            l -= last
        weights = np.empty((3, faces, count))
        np.copyto(weights[2], angle)
        for w, t, (g0, g1) in zip(weights, (t0, t1), self.bend):
            np.multiply(ways[0], g0, out=w)
            w += np.multiply(ways[1], g1, out=bottom)
            w *= height
            np.subtract(np.multiply(t, angle, out=bottom), w, out=w)
            weights[2] -= w
        phi[...] = self.gather @ weights.reshape(3 * faces, count)
        for t, l in zip((t0, t1), ways):
            last += np.multiply(t, l, out=l)
        last *= self.double_area
        angle *= height
        np.subtract(last, angle, out=psi)


def green_row(point, vertices, triangles):
    """Coordinates of one point as the pseudocode of the paper writes them, to check the fast form against."""
    phi, psi = np.zeros(len(vertices)), np.zeros(len(triangles))
    for f, (face, normal) in enumerate(zip(triangles, unit_normals(vertices, triangles))):
        v = vertices[face] - point
        foot = (v[0] @ normal) * normal
        signs = [np.sign(np.cross(v[i] - foot, v[(i + 1) % 3] - foot) @ normal) for i in range(3)]
        own = [triangle_integral(foot, v[i], v[(i + 1) % 3], np.zeros(3)) for i in range(3)]
        other = [triangle_integral(np.zeros(3), v[(i + 1) % 3], v[i], np.zeros(3)) for i in range(3)]
        whole = -abs(np.dot(signs, own))
        psi[f] = -whole
        walls = [np.cross(v[(i + 1) % 3], v[i]) for i in range(3)]
        walls = [wall / np.linalg.norm(wall) for wall in walls]
        w = normal * whole + sum(i * wall for i, wall in zip(other, walls))
        for i in range(3):
            wall = walls[(i + 1) % 3]
            phi[face[i]] += (wall @ w) / (wall @ v[i])
    return np.concatenate([phi, psi])


def triangle_integral(p, first, second, x):
    """The paper's GCTriInt: minus the integral of 1 / 4 pi |y - x| over the triangle p, first, second; x is above p."""
    cosine = lambda a, b: (a @ b) / np.linalg.norm(a) / np.linalg.norm(b)
    alpha = np.arccos(np.clip(cosine(second - first, p - first), -1, 1))
    beta = np.arccos(np.clip(cosine(first - p, second - p), -1, 1))
    squared = ((p - first) @ (p - first)) * np.sin(alpha) ** 2
    height2 = (p - x) @ (p - x)
    height = np.sqrt(height2)

    def part(theta):
        s, c = np.sin(theta), np.cos(theta)
        angle = 2 * height * np.arctan(height * c / np.sqrt(squared + s * s * height2))
        below = height2 * (1 + c) + squared + np.sqrt(squared * squared + squared * height2 * s * s)
        ratio = 2 * np.sqrt(squared) * s * s / (1 - c) ** 2 * (1 - 2 * height2 * c / below)
        return -np.sign(s) / 2 * (angle + np.sqrt(squared) * np.log(ratio))

    return -abs(part(np.pi - alpha) - part(np.pi - alpha - beta) - height * beta) / (4 * np.pi)
