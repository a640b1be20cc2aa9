"""Times what a Python user can run today for each step of a cage encoding; prints one JSON document."""

import argparse
import ctypes
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy
import scipy.linalg as sl
import scipy.sparse as sp
import teneva

from green import Green, green_row, unit_normals
from voxels import VoxelHarmonic

# Points per work item of MVC: the few edge- and face-sized temporaries should stay in a core's L2 cache.
MVC_CHUNK = 128
# Frames per product where all frames at once would not fit in memory.
FRAME_BLOCK = 32
# Cells of the voxel grid along the cage's longest side, and of a finer one that shows what the error costs.
VOXELS, FINER_VOXELS = 64, 96
SPECTRUM = 20
LAMBDA = 1.0
# Bound of max |B|, where B = phi times the inverse of its handle rows.
MAXVOL_BOUND = 1.01


def read_obj(path):
    """Vertices (k x 3) and the fan triangles of the faces (f x 3) of an OBJ file."""
    vertices, triangles = [], []
    with open(path) as lines:
        for line in lines:
            if line.startswith("v "):
                vertices.append(line.split()[1:4])
            elif line.startswith("f "):
                count = len(vertices)
                corners = [int(c.split("/")[0]) for c in line.split()[1:]]
                corners = [c - 1 if c > 0 else count + c for c in corners]
                triangles += [(corners[0], a, b) for a, b in zip(corners[1:], corners[2:])]
    return np.array(vertices, dtype=float), np.array(triangles, dtype=np.int64).reshape(-1, 3)


def diagonal(points):
    return float(np.linalg.norm(np.ptp(points, axis=0)))


class MeanValue:
    """Mean value coordinates of points inside a triangle cage, Ju, Schaefer and Warren 2005.

    With a_e = sin^2(theta_e / 2) for the angle theta_e under which a point sees edge e, every dot product of the
    mean-vector form is a polynomial in the a_e. So one angle per edge and one determinant per face are all that is
    needed, and neither loses digits for small angles. Not meant for points on the cage's surface.
    """

    def __init__(self, vertices, triangles):
        self.vertices = vertices
        corners = np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]])
        pairs = np.sort(corners.reshape(-1, 2), axis=1)
        edges, inverse = np.unique(pairs, axis=0, return_inverse=True)
        # opposite[i] is the edge across from corner i of every face.
        self.opposite = np.ascontiguousarray(inverse.reshape(3, -1))
        self.first, self.second = (np.ascontiguousarray(c) for c in edges.T)
        self.length2 = ((vertices[self.first] - vertices[self.second]) ** 2).sum(1)[:, None]
        base = vertices[triangles[:, 0]]
        self.normals = np.cross(vertices[triangles[:, 1]] - base, vertices[triangles[:, 2]] - base)
        self.offsets = (self.normals * base).sum(1)[:, None]
        faces = len(triangles)
        self.gather = sp.csr_array(
            (np.ones(3 * faces), (triangles.T.ravel(), np.arange(3 * faces))), shape=(len(vertices), 3 * faces)
        )

    def evaluate(self, points, threads):
        """Coordinates, n x m, column-major."""
        transposed = np.empty((len(self.vertices), len(points)))
        starts = range(0, len(points), MVC_CHUNK)

        def work(start):
            stop = min(start + MVC_CHUNK, len(points))
            self._chunk(points[start:stop], transposed[:, start:stop])

        # numpy's loops run without the interpreter's lock, so threads do help.
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, starts))
        return transposed.T

    def _chunk(self, points, out):
        distance2 = np.zeros(out.shape)
        for axis in range(3):
            step = self.vertices[:, axis, None] - points[None, :, axis]
            step *= step
            distance2 += step
        distance = np.sqrt(distance2)
        near, far = distance[self.first], distance[self.second]
        product = near * far
        near -= far
        near *= near
        a = np.subtract(self.length2, near, out=near)
        a /= product
        a *= 0.25
        np.clip(a, 0.0, 1.0, out=a)
        # excess = theta / sin(theta) - 1
        sine = np.sqrt(a, out=far)
        excess = np.arcsin(sine)
        sine *= np.sqrt(1.0 - a)
        np.maximum(sine, 1e-300, out=sine)
        excess /= sine
        excess -= 1.0

        determinant = self.offsets - self.normals @ points.T
        scale = [product[e] for e in self.opposite]
        # A point in a face's plane gets nothing from that face; dividing rounding by rounding would give noise.
        flat = np.abs(determinant) < 1e-10 * np.sqrt(scale[0] * scale[1] * scale[2])
        determinant[flat] = np.inf
        determinant = np.reciprocal(determinant, out=determinant)

        x, y, z = (a[e] for e in self.opposite)
        f, g, h = (excess[e] for e in self.opposite)
        weights = np.empty((3,) + x.shape)
        half = 0.5 * (x + y + z)
        # Quarters of the wedge normals' dot products: c_x . c_y = 2 (z - x - y + 2 x y), c_x . c_x = 4 x (1 - x). The
        # part without an angle is summed by hand to x (y + z - x), since its terms nearly cancel.
        xy, yz, zx = x * y + z - half, y * z + x - half, z * x + y - half
        for i, (p, own, others) in enumerate(
            [(x, f, ((g, xy), (h, zx))), (y, g, ((h, yz), (f, xy))), (z, h, ((f, zx), (g, yz)))]
        ):
            w = weights[i]
            np.subtract(half, p, out=w)
            w += w
            w += own * (1.0 - p)
            w *= p
            for other, dot in others:
                w += other * dot
            w *= scale[i]
            w *= determinant
        total = self.gather @ weights.reshape(-1, weights.shape[2])
        np.divide(total, total.sum(axis=0), out=out)


def maxvol_teneva(phi):
    """The published package as it is; its iteration limit of 100 would stop short of the bound."""
    return teneva.maxvol(phi, MAXVOL_BOUND, 1_000_000)[0], None


def maxvol_lapack(phi):
    """The same algorithm without teneva's dense n x n permutation and without temporaries: rows and swaps."""
    lu, pivots, _ = sl.lapack.dgetrf(phi)
    n, m = phi.shape
    order = np.arange(n)
    for i, p in enumerate(pivots):
        order[i], order[p] = order[p], order[i]
    rows = order[:m].copy()
    square = np.asfortranarray(lu[:m])
    b = np.array(phi, order="F")
    b = sl.blas.dtrsm(1.0, square, b, side=1, lower=0, overwrite_b=1)
    b = sl.blas.dtrsm(1.0, square, b, side=1, lower=1, diag=1, overwrite_b=1)
    flat, swaps = b.ravel(order="K"), 0
    while True:
        j, i = divmod(int(sl.blas.idamax(flat)), n)
        pivot = b[i, j]
        if abs(pivot) <= MAXVOL_BOUND:
            return rows, swaps
        row, column = b[i].copy(), b[:, j].copy()
        row[j] -= 1.0
        sl.blas.dger(-1.0 / pivot, column, row, a=b, overwrite_a=1)
        rows[j] = i
        swaps += 1


def uniform_laplacian(triangles, m):
    adjacency = np.zeros((m, m))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        adjacency[triangles[:, a], triangles[:, b]] = 1.0
        adjacency[triangles[:, b], triangles[:, a]] = 1.0
    return np.eye(m) - adjacency / np.maximum(adjacency.sum(1, keepdims=True), 1.0)


def subspectral_operator(handles, laplacian):
    """The m x m matrix from handle positions to cage: data below the spectrum's tail, Laplacian within it."""
    u, sigma, vt = sl.svd(handles)
    split = len(sigma) - SPECTRUM
    low = u[:, :split].T / sigma[:split, None]
    bent = laplacian @ vt.T
    bent_low, bent_high = bent[:, :split], bent[:, split:]
    tail = sigma[split:]
    system = LAMBDA * bent_high.T @ bent_high + np.diag(tail**2)
    right = tail[:, None] * u[:, split:].T - LAMBDA * (bent_high.T @ bent_low) @ low
    high = sl.solve(system, right, assume_a="pos")
    return vt.T @ np.vstack([low, high])


def side_by_side(frames, rows=slice(None)):
    """Frames x points x 3 as a points x (3 frames) matrix in f64, so that all frames are one product."""
    picked = frames[:, rows].astype(np.float64)
    return picked.transpose(1, 0, 2).reshape(picked.shape[1], -1)


def invert_all(operator, handles):
    return operator @ handles


def measure_block(phi, cages, positions):
    """Per-frame L2 and L-infinity of phi * cages - positions; positions are frames x points x 3."""
    residual = phi @ cages
    shaped = residual.reshape(len(phi), -1, 3)
    shaped -= positions.transpose(1, 0, 2)
    residual *= residual
    squared = shaped.sum(axis=2)
    return np.sqrt(squared.mean(axis=0)), np.sqrt(squared.max(axis=0))


def invert_measure_batched(phi, operator, rows, frames):
    cages = invert_all(operator, side_by_side(frames, rows))
    l2, linf = np.empty(len(frames)), np.empty(len(frames))
    for s in range(0, len(frames), FRAME_BLOCK):
        e = min(s + FRAME_BLOCK, len(frames))
        l2[s:e], linf[s:e] = measure_block(phi, cages[:, 3 * s : 3 * e], frames[s:e])
    return cages, l2, linf


def invert_measure_per_frame(phi, operator, rows, frames):
    l2, linf = np.empty(len(frames)), np.empty(len(frames))
    cages = np.empty((len(operator), 3 * len(frames)))
    for t, frame in enumerate(frames):
        positions = frame.astype(np.float64)
        cage = operator @ positions[rows]
        residual = phi @ cage
        residual -= positions
        squared = np.einsum("ij,ij->i", residual, residual)
        l2[t], linf[t] = np.sqrt(squared.mean()), np.sqrt(squared.max())
        cages[:, 3 * t : 3 * t + 3] = cage
    return cages, l2, linf


def error_summary(l2, linf, scale):
    l2, linf = l2 / scale, linf / scale
    return {
        "l2_mean": float(l2.mean()),
        "l2_max": float(l2.max()),
        "linf_mean": float(linf.mean()),
        "linf_max": float(linf.max()),
    }


def pipeline(rest_path, cage_path, frames_path, threads, out_path):
    """From files to a file of compressed cages, with every frame's error: seconds of each part, and bytes written."""
    seconds, last = {}, time.perf_counter()

    def lap(name):
        nonlocal last
        now = time.perf_counter()
        seconds[name], last = now - last, now

    rest, _ = read_obj(rest_path)
    cage, triangles = read_obj(cage_path)
    frames = np.load(frames_path)
    lap("read")
    phi = MeanValue(cage, triangles).evaluate(rest, threads)
    lap("coordinates")
    rows, _ = maxvol_lapack(phi)
    lap("maxvol")
    operator = subspectral_operator(phi[rows], uniform_laplacian(triangles, len(cage)))
    lap("operator")
    cages, l2, linf = invert_measure_batched(phi, operator, rows, frames)
    lap("invert_measure")
    shaped = cages.reshape(len(cage), -1, 3).transpose(1, 0, 2).astype(np.float32)
    scale = diagonal(rest)
    np.savez_compressed(out_path, cages=shaped, triangles=triangles.astype(np.uint32), l2=l2 / scale, linf=linf / scale)
    lap("write")
    return seconds, os.path.getsize(out_path)


def timed(runs, work):
    """Best and median of `runs` after one warm-up, which is not counted, and the work's last result."""
    work()
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - start)
    return {"best": min(seconds), "median": float(np.median(seconds)), "runs": runs}, result


def per_frame(figures, frames):
    figures["best_per_frame"] = figures["best"] / frames
    figures["median_per_frame"] = figures["median"] / frames
    return figures


def keep_memory():
    """Lets glibc keep what is freed: new pages for every temporary array would take most of the time of some steps."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt:
        trim_threshold, mmap_threshold = -1, -3
        mallopt(trim_threshold, 1 << 30)
        mallopt(mmap_threshold, 1 << 25)


def blas_threads():
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        if os.environ.get(name):
            return int(os.environ[name])
    return len(os.sched_getaffinity(0))


class Session:
    """The inputs, and what later steps need from earlier ones, computed once and only when asked for."""

    def __init__(self, options):
        self.options = options
        self.runs = options.runs
        self.threads = blas_threads()
        self.rest, _ = read_obj(options.rest)
        self.cage, self.triangles = read_obj(options.cage)
        self.frames = np.load(options.frames)
        self.scale = diagonal(self.rest)
        self._kept = {}

    def keep(self, name, make):
        if name not in self._kept:
            self._kept[name] = make()
        return self._kept[name]

    def phi(self):
        return self.keep("phi", lambda: MeanValue(self.cage, self.triangles).evaluate(self.rest, self.threads))

    def rows(self):
        return self.keep("rows", lambda: maxvol_lapack(self.phi())[0])

    def operator(self):
        laplacian = uniform_laplacian(self.triangles, len(self.cage))
        return self.keep("operator", lambda: subspectral_operator(self.phi()[self.rows()], laplacian))

    def cages(self):
        return self.keep("cages", lambda: invert_all(self.operator(), side_by_side(self.frames, self.rows())))


def step_mvc(s):
    figures, phi = timed(s.runs, lambda: MeanValue(s.cage, s.triangles).evaluate(s.rest, s.threads))
    figures["affine_reproduction_error"] = affine_error(phi, s)
    return figures


def step_green(s):
    figures, phi = timed(s.runs, lambda: Green(s.cage, s.triangles).evaluate(s.rest, s.threads))
    figures["affine_reproduction_error"] = affine_error(phi, s, green_values(s))
    return figures


def step_harmonic(s):
    figures = harmonic_on(s, VOXELS)
    figures["finer"] = harmonic_on(s, FINER_VOXELS)
    return figures


def harmonic_on(s, cells):
    solver = VoxelHarmonic(s.cage, s.triangles, cells)
    # It takes seconds, so once is enough.
    figures, phi = timed(1, lambda: solver.evaluate(s.rest, s.threads))
    figures["affine_reproduction_error"] = affine_error(phi, s)
    figures["voxels"] = cells
    figures["unknowns"] = solver.unknowns
    return figures


def step_maxvol(s, method=maxvol_teneva):
    phi = s.phi()
    figures, (rows, swaps) = timed(s.runs, lambda: method(phi))
    figures["log_volume"] = float(np.linalg.slogdet(phi[rows])[1])
    fresh = sl.solve(phi[rows].T, phi.T)
    figures["max_entry"] = float(np.abs(fresh).max())
    if swaps is not None:
        figures["swaps"] = swaps
    return figures


def step_maxvol_lapack(s):
    return step_maxvol(s, maxvol_lapack)


def step_svd(s):
    square = s.phi()[s.rows()]
    figures, _ = timed(s.runs, lambda: sl.svd(square))
    figures["numpy"], _ = timed(s.runs, lambda: np.linalg.svd(square))
    return figures


def step_invert_batched(s):
    operator, handles = s.operator(), side_by_side(s.frames, s.rows())
    figures = per_frame(timed(s.runs, lambda: invert_all(operator, handles))[0], len(s.frames))
    gathering = timed(s.runs, lambda: invert_all(operator, side_by_side(s.frames, s.rows())))[0]
    figures["with_gather"] = per_frame(gathering, len(s.frames))
    return figures


def step_invert_measure(s):
    out = {}
    for name, work in (("loop", invert_measure_per_frame), ("batched", invert_measure_batched)):
        arguments = (s.phi(), s.operator(), s.rows(), s.frames)
        figures, (_, l2, linf) = timed(s.runs, lambda: work(*arguments))
        out[name] = per_frame(figures, len(s.frames))
        out[name]["error"] = error_summary(l2, linf, s.scale)
    return out


def step_decode(s):
    phi, cages, frames = s.phi(), s.cages(), len(s.frames)
    single = np.ascontiguousarray(cages.reshape(len(cages), -1, 3).transpose(1, 0, 2))
    out = {"loop": per_frame(timed(s.runs, lambda: [phi @ c for c in single] and None)[0], frames)}

    def batched():
        for b in range(0, 3 * frames, 3 * FRAME_BLOCK):
            phi @ cages[:, b : b + 3 * FRAME_BLOCK]

    out["batched"] = per_frame(timed(s.runs, batched)[0], frames)
    return out


def step_least_squares(s):
    """Not a rival of the service but its lower bound on the error: every point of every frame, by QR."""
    phi = s.phi()
    targets = side_by_side(s.frames)

    def solve():
        q, r = sl.qr(phi, mode="economic", check_finite=False)
        return sl.solve_triangular(r, q.T @ targets)

    figures, cages = timed(1, solve)
    l2, linf = measure_block(phi, cages, s.frames)
    figures["error"] = error_summary(l2, linf, s.scale)
    return figures


def step_pipeline(s):
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "cages.npz")
        o = s.options
        figures, (parts, size) = timed(s.runs, lambda: pipeline(o.rest, o.cage, o.frames, s.threads, path))
    figures["last_run"] = parts
    figures["bytes"] = size
    return per_frame(figures, len(s.frames))


STEPS = {
    "mvc": step_mvc,
    "green": step_green,
    "harmonic": step_harmonic,
    "maxvol": step_maxvol,
    "maxvol_lapack": step_maxvol_lapack,
    "svd": step_svd,
    "invert_batched": step_invert_batched,
    "invert_measure": step_invert_measure,
    "decode": step_decode,
    "least_squares": step_least_squares,
    "pipeline": step_pipeline,
}


def green_values(s):
    return np.concatenate([s.cage, unit_normals(s.cage, s.triangles)])


def affine_error(phi, s, values=None):
    reproduced = phi @ (s.cage if values is None else values)
    return float(np.linalg.norm(reproduced - s.rest, axis=1).max() / s.scale)


def mean_value_row(point, vertices, triangles):
    """Coordinates of one point by the mean-vector form as it is written in the paper, to check the fast form against."""
    offsets = vertices - point
    distances = np.linalg.norm(offsets, axis=1)
    units = offsets / distances[:, None]
    row = np.zeros(len(vertices))
    for face in triangles:
        u = units[face]
        wedges = np.cross(u[[1, 2, 0]], u[[2, 0, 1]])
        sines = np.linalg.norm(wedges, axis=1)
        angles = np.arctan2(sines, (u[[1, 2, 0]] * u[[2, 0, 1]]).sum(axis=1))
        mean = 0.5 * (angles / sines) @ wedges
        row[face] += wedges @ mean / (distances[face] * np.linalg.det(u))
    return row / row.sum()


def self_check(s):
    """Raises where the peers are wrong: a fast peer that computes something else would be no peer."""
    phi = s.phi()
    affine = affine_error(phi, s)
    sums = float(np.abs(phi.sum(axis=1) - 1.0).max())
    assert affine < 1e-10, f"coordinates miss the rest pose by {affine:.1e} of the diagonal"
    assert sums < 1e-12, f"coordinates of a point sum to 1 only within {sums:.1e}"
    # Affine reproduction alone does not tell mean value coordinates from other coordinates.
    sample = np.linspace(0, len(phi) - 1, 20).astype(int)
    plain = np.array([mean_value_row(s.rest[i], s.cage, s.triangles) for i in sample])
    textbook = float(np.abs(phi[sample] - plain).max())
    assert textbook < 1e-9, f"coordinates differ from the textbook form by {textbook:.1e}"
    green = Green(s.cage, s.triangles).evaluate(s.rest, s.threads)
    green_affine = affine_error(green, s, green_values(s))
    assert green_affine < 1e-10, f"Green coordinates miss the rest pose by {green_affine:.1e} of the diagonal"
    plain = np.array([green_row(s.rest[i], s.cage, s.triangles) for i in sample])
    green_textbook = float(np.abs(green[sample] - plain).max())
    assert green_textbook < 1e-8, f"Green coordinates differ from the paper's pseudocode by {green_textbook:.1e}"
    # Harmonic functions take their extremes on the boundary, and coordinates sum to one; the grid misses the rest pose.
    harmonic = VoxelHarmonic(s.cage, s.triangles, VOXELS).evaluate(s.rest, s.threads)
    harmonic_sums = float(np.abs(harmonic.sum(axis=1) - 1.0).max())
    assert harmonic.min() > -1e-4 and harmonic_sums < 1e-3, f"harmonic coordinates sum to 1 within {harmonic_sums:.1e}"
    harmonic_affine = affine_error(harmonic, s)
    assert harmonic_affine < 0.02, f"harmonic coordinates miss the rest pose by {harmonic_affine:.1e} of the diagonal"
    arguments = (phi, s.operator(), s.rows(), s.frames)
    batched, loop = invert_measure_batched(*arguments), invert_measure_per_frame(*arguments)
    agreement = max(float(np.abs(b - p).max()) for b, p in zip(batched, loop)) / s.scale
    assert agreement < 1e-11, f"batched and per-frame results differ by {agreement:.1e} of the diagonal"
    fresh = sl.solve(phi[s.rows()].T, phi.T)
    entry = float(np.abs(fresh).max())
    assert entry < MAXVOL_BOUND + 1e-9, f"handles leave an entry of {entry}"
    rest = s.operator() @ s.rest[s.rows()]
    # Reported, not asserted: the Laplacian is meant to move the cage where the data do not hold it.
    moved = float(np.linalg.norm(rest - s.cage, axis=1).max() / s.scale)
    return {
        "affine": affine,
        "row_sum": sums,
        "textbook": textbook,
        "green_affine": green_affine,
        "green_textbook": green_textbook,
        "harmonic_affine": harmonic_affine,
        "harmonic_row_sum": harmonic_sums,
        "batched_vs_loop": agreement,
        "max_entry": entry,
        "rest_cage_moved": moved,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rest", required=True, help="rest pose of the model, OBJ")
    parser.add_argument("--cage", required=True, help="cage in the rest pose, OBJ")
    parser.add_argument("--frames", required=True, help="frames x points x 3, NPY")
    parser.add_argument("--runs", type=int, default=5, help="timed runs of each step (default 5)")
    parser.add_argument("--only", help=f"comma-separated steps out of: {', '.join(STEPS)}")
    parser.add_argument("--self-check", action="store_true", help="check the peers' results instead of timing them")
    options = parser.parse_args()
    steps = options.only.split(",") if options.only else list(STEPS)
    unknown = [step for step in steps if step not in STEPS]
    if unknown:
        parser.error(f"unknown step {unknown[0]!r}; steps are {', '.join(STEPS)}")
    if options.runs < 1:
        parser.error("--runs must be at least 1")

    keep_memory()
    session = Session(options)
    if session.frames.ndim != 3 or session.frames.shape[1:] != session.rest.shape:
        parser.error(f"{options.frames} is {session.frames.shape}, the rest pose has {len(session.rest)} points")
    report = {
        "versions": {
            "python": sys.version.split()[0],
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "teneva": teneva.__version__,
            "blas": np.show_config(mode="dicts")["Build Dependencies"]["blas"]["version"],
        },
        "threads": session.threads,
        "points": len(session.rest),
        "cage_vertices": len(session.cage),
        "cage_faces": len(session.triangles),
        "frames": len(session.frames),
    }
    if options.self_check:
        report["self_check"] = self_check(session)
    else:
        report["seconds"] = {step: STEPS[step](session) for step in steps}
    json.dump(report, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
