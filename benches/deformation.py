"""Deformation transfer between meshes whose triangles correspond, and what a pose does to a mesh.

The measures are those of `crates/shape/src/quality/frame.rs`, written a second time so that the program does not judge itself.
"""

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree


def diagonal(points):
    return np.linalg.norm(np.ptp(points, axis=0))


def normals(points, faces):
    """Area vectors: normals twice as long as the areas of the triangles."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def nearest_rotations(matrices):
    u, _, v = np.linalg.svd(matrices)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ v))[..., None]
    return u @ v


def aligned(points, onto, scale=False):
    """Points after the rotation and translation, and the scale, that bring them closest to others, and that similarity as a 4 × 4 matrix."""
    here, there = points.mean(0), onto.mean(0)
    covariance = (onto - there).T @ (points - here)
    rotation = nearest_rotations(covariance)
    size = np.trace(rotation.T @ covariance) / ((points - here) ** 2).sum() if scale else 1.0
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = size * rotation, there - size * rotation @ here
    return moved(points, matrix), matrix


def moved(points, matrix):
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def mean_error(pose, truth):
    return np.linalg.norm(aligned(pose, truth)[0] - truth, axis=1).mean()


class Gradients:
    """Deformation gradients of triangles (Sumner and Popović 2004), faces × 3 × 3."""

    def __init__(self, rest, faces):
        self.faces = faces
        bases = self._bases(rest)
        self.flat = np.abs(np.linalg.det(bases)) < 1e-18 * diagonal(rest) ** 3
        bases[self.flat] = np.eye(3)
        self.inverse = np.linalg.inv(bases)
        self.areas = np.linalg.norm(normals(rest, faces), axis=1) * ~self.flat
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        owner = np.tile(np.arange(len(faces)), 3)
        order = np.lexsort((edges[:, 1], edges[:, 0]))
        shared = np.flatnonzero((edges[order][1:] == edges[order][:-1]).all(axis=1))
        one, other = owner[order][shared], owner[order][shared + 1]
        ones = np.ones(2 * len(one))
        beside = sparse.csr_matrix((ones, (np.r_[one, other], np.r_[other, one])), shape=(len(faces),) * 2) + sparse.identity(len(faces))
        weighted = beside @ sparse.diags(self.areas + 1e-30)
        self.means = sparse.diags(1 / np.asarray(weighted.sum(axis=1)).ravel()) @ weighted

    def _bases(self, points):
        a, b, c = (points[self.faces[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        return np.stack([b - a, c - a, normal / np.sqrt(np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30))], axis=2)

    def __call__(self, pose):
        gradients = self._bases(pose) @ self.inverse
        gradients[self.flat] = np.eye(3)
        return gradients

    def smoothed(self, gradients, passes):
        rows = gradients.reshape(-1, 9)
        for _ in range(passes):
            rows = self.means @ rows
        return rows.reshape(-1, 3, 3)


class Poisson:
    """The mesh whose gradients come closest to given ones; its mean stays where it is at rest."""

    def __init__(self, rest, faces):
        corners = rest[faces]
        area = normals(rest, faces)
        double = np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-14 * diagonal(rest) ** 2)
        hats = [np.cross(area / double, corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3]) / double for k in range(3)]
        rows = 3 * np.arange(len(faces))
        every = [(hats[i][:, k], rows + k, faces[:, i]) for i in range(3) for k in range(3)]
        values, row, column = (np.concatenate(part) for part in zip(*every))
        gradient = sparse.csr_matrix((values, (row, column)), shape=(3 * len(faces), len(rest)))
        self.divergence = (gradient.T @ sparse.diags(np.repeat(double[:, 0] / 2, 3))).tocsr()
        laplacian = (self.divergence @ gradient).tocsc()
        self.hold = 1e-8 * laplacian.diagonal().mean()
        self.factor = splu((laplacian + self.hold * sparse.identity(len(rest))).tocsc())
        self.rest = rest

    def __call__(self, gradients):
        return self.factor.solve(self.divergence @ gradients.transpose(0, 2, 1).reshape(-1, 3) + self.hold * self.rest)


def under(points, directions, surface, faces):
    """The triangles of a surface that lie nearest to points and face their way."""
    reach = 0.05 * diagonal(surface)
    tree = cKDTree(np.c_[surface[faces].mean(axis=1), reach * unit(normals(surface, faces))])
    return tree.query(np.c_[points, reach * directions])[1]


def triangles_under(target, target_faces, surface, faces):
    """For each triangle of the target, the one of a surface that lies on it."""
    return under(target[target_faces].mean(axis=1), unit(normals(target, target_faces)), surface, faces)


class DeformationTransfer:
    """Each triangle of the target does what the triangle of the source does that corresponds to it."""

    def __init__(self, source, faces, target, target_faces, corresponding):
        self.gradients, self.poisson = Gradients(source, faces), Poisson(target, target_faces)
        self.corresponding, self.source, self.target = corresponding, source, target

    def __call__(self, pose):
        shape = self.poisson(self.gradients(pose)[self.corresponding])
        return shape - shape.mean(0) + self.target.mean(0) + pose.mean(0) - self.source.mean(0)


class Quality:
    """Shares of the area that are folded (against their surroundings' rotation) and stretched (twice as long or half as long in a direction), and the volume over
    that at rest."""

    SURROUNDINGS = 12

    def __init__(self, rest, faces):
        self.rest, self.faces, self.gradients = rest, faces, Gradients(rest, faces)
        self.normals = unit(normals(rest, faces))

    def __call__(self, pose):
        gradients, areas, before = self.gradients(pose), self.gradients.areas, self.normals
        turned = nearest_rotations(self.gradients.smoothed(gradients, self.SURROUNDINGS))
        folded = np.einsum("ni,nij,nj->n", normals(pose, self.faces), turned, before) < 0
        in_plane = gradients - np.einsum("nij,nj,nk->nik", gradients, before, before)
        stretches = np.linalg.svd(in_plane, compute_uv=False)
        stretched = (stretches[:, 0] > 2) | (stretches[:, 1] < 0.5)
        share = lambda chosen: 100 * areas[chosen].sum() / areas.sum()
        return share(folded), share(stretched), volume(pose, self.faces) / volume(self.rest, self.faces)


def volume(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def trembling(frames):
    """Mean length of the second differences over time."""
    return np.linalg.norm(frames[2:] - 2 * frames[1:-1] + frames[:-2], axis=2).mean()
