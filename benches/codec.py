"""Sizes and errors of coded captures beside other formats': docs/RATES.md and its plots.

`make bench-codec` builds the program and calls this with the Python of the peers. Everything in a file counts: model, cage, errors, tables.
Errors are measured on what each decoder gives back. The captures are looked for in CAGER_CAPTURES (default ../shared/data); cages that are
designed stay in the folder given as argument (default out/codec). `--perceptual` measures and writes what has no times alone: the measure like STED
and differences between whole curves, which any build of the program may be used for. `--summary` measures nothing: it writes the summary anew from the
tables that the page has.
"""

import io
import json
import lzma
import math
import os
import subprocess
import sys
import tempfile
import time

import DracoPy
import meshoptimizer
import numpy as np
import py_dem_bones
import zstandard
from pxr import Usd, UsdGeom, Vt
from scipy.spatial.transform import Rotation

from bjontegaard import bd_rate, frontier
from cages import CAGER, DATA, ROOT, table, write
from sted import Sted

PAGE = os.path.join(ROOT, "docs", "RATES.md")
BLENDER = os.path.join(ROOT, "target", "blender", "bin", "python")
CAPTURES = ["samba", "horse-gallop", "makehuman-cmu-walk", "chickenCrossing", "supercages-arm"]
# The horse's capture has 24 frames twice.
CYCLE = ("horse-gallop", 24)
OURS, PEERS = "cager, cage designed, 350", ["quantised PCA, xz", "Draco, each frame", "meshoptimizer, temporal deltas"]
SETTINGS = [
    ["--quality", "preview"],
    *(["--mean-error", f"{e:g}"] for e in (5e-3, 2e-3, 1.4e-3, 1e-3, 7e-4, 5e-4, 2.5e-4, 1e-4, 5e-5)),
    *(["--max-error", f"{e:g}"] for e in (1e-2, 1e-3, 1e-4, 1e-5)),
]
# For cages that were not made for the motion.
FEW = [SETTINGS[0], ["--mean-error", "0.001"], ["--max-error", "0.001"], ["--max-error", "0.0001"]]


class Capture:
    def __init__(self, name, count=None):
        """All frames, or the first few."""
        self.name, self.folder = name, os.path.join(DATA, name)
        self.frames = np.load(os.path.join(self.folder, "frames.npy")).astype(np.float64)[:count]
        files = ["--rest", f"{self.folder}/rest.obj", "--frames", f"{self.folder}/frames.npy"]
        self.files = files if count is None else [*files, "--frames-range", f"0-{count - 1}"]
        points, faces = [], []
        with open(os.path.join(self.folder, "rest.obj"), encoding="utf-8") as file:
            for line in file:
                words = line.split()
                if words[:1] == ["v"]:
                    points.append([float(x) for x in words[1:4]])
                elif words[:1] == ["f"]:
                    faces.append([int(x.split("/")[0]) - 1 for x in words[1:]])
        self.rest = np.array(points)
        self.faces = np.array([[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)], np.uint32)
        self.diagonal = np.linalg.norm(np.ptp(self.rest, axis=0))
        self.spread = np.square(self.frames - self.frames.mean(1, keepdims=True)).sum()
        self.sted = Sted(faces, len(self.rest), self.diagonal)

    def row(self, kind, setting, size, decoded, encode, decode):
        """Figures of a file of `size` bytes that decodes to these frames; times in seconds for the whole capture."""
        difference = self.frames - decoded
        count, points, _ = self.frames.shape
        spatial, temporal, sted = self.sted(self.frames, decoded)
        return {
            "capture": self.name,
            "kind": kind,
            "setting": setting,
            "bytes": size,
            "bpvf": 8 * size / (count * points),
            "kg": 100 * math.sqrt(np.square(difference).sum() / self.spread),
            "max": np.linalg.norm(difference, axis=2).max() / self.diagonal,
            "sted": sted,
            "sted spatial": spatial,
            "sted temporal": temporal,
            "encode": count / encode,
            "decode": count / decode,
        }


def timed(work):
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def cager(*arguments):
    done = subprocess.run([CAGER, *arguments, "--quiet", "--overwrite"], stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise SystemExit(done.stderr)


def cages(capture, folder):
    """Kinds of cages and their files: designed for this capture, made by a program, made by an artist."""
    designed = os.path.join(folder, f"{capture.name}-350.obj")
    if not os.path.exists(designed):
        cager("cage", *capture.files, "--style", "free", "-o", designed)
    found = {"designed, 350": designed}
    for name, kind in [("cage350.obj", "offset surface, 350"), ("cage.obj", "artist's")]:
        path = os.path.join(capture.folder, name)
        if os.path.exists(path):
            found[kind] = path
    return found


def ours(capture, folder, kinds=None):
    """In all cages, or in those of some kinds."""
    out, back = os.path.join(folder, "out.cager"), os.path.join(folder, "back.npy")
    for kind, cage in cages(capture, folder).items():
        if kinds and kind not in kinds:
            continue
        for setting in SETTINGS if kind.startswith("designed") else FEW:
            try:
                _, encode = timed(lambda: cager("encode", *capture.files, "--cage", cage, *setting, "-o", out))
            except SystemExit as refused:
                print(f"{capture.name}, cage {kind}, {' '.join(setting)}: {refused}", flush=True)
                continue
            _, decode = timed(lambda: cager("decode", out, "-o", back))
            yield capture.row(f"cager, cage {kind}", " ".join(setting), os.path.getsize(out), np.load(back), encode, decode)


def draco(capture):
    for bits in (8, 10, 12, 14):
        def encode(**more):
            return [DracoPy.encode(f.astype(np.float32), capture.faces, quantization_bits=bits, compression_level=10, **more) for f in capture.frames]

        files, seconds = timed(encode)
        _, back = timed(lambda: [DracoPy.decode(f).points for f in files])
        # The smaller files lose the order of the points; errors are those of the same quantisation in order.
        decoded = np.stack([DracoPy.decode(f).points for f in encode(preserve_order=True)])
        yield capture.row("Draco, each frame", f"{bits} bits", sum(map(len, files)), decoded, seconds, back)


def meshopt(capture):
    low, extent = capture.frames.min((0, 1)), np.ptp(capture.frames, axis=(0, 1)).max()
    count, points, _ = capture.frames.shape
    indices = meshoptimizer.encode_index_buffer(capture.faces.ravel(), len(capture.faces) * 3, points)
    for bits in (8, 10, 12, 14, 16):
        scale = (2**bits - 1) / extent

        def encode():
            whole = np.round((capture.frames - low) * scale).astype(np.int32)
            deltas = np.diff(whole, axis=0, prepend=np.zeros((1, points, 3), np.int32))
            padded = np.zeros((count, points, 4), np.int16)
            padded[:, :, :3] = deltas.astype(np.uint16).view(np.int16)
            return [meshoptimizer.encode_vertex_buffer(frame, points, 8) for frame in padded]

        def decode():
            frames = []
            for file in files:
                frame = meshoptimizer.decode_vertex_buffer(points, 8, file)
                frames.append(np.ascontiguousarray(frame).view(np.int16).reshape(points, 4)[:, :3])
            whole = np.cumsum(np.stack(frames).astype(np.int64), axis=0) & 0xFFFF
            return whole / scale + low

        files, seconds = timed(encode)
        decoded, back = timed(decode)
        yield capture.row("meshoptimizer, temporal deltas", f"{bits} bits", sum(map(len, files)) + len(indices), decoded, seconds, back)


def pca(capture):
    count, points, _ = capture.frames.shape
    connectivity = len(lzma.compress(np.diff(capture.faces.ravel().astype(np.int32)).astype(np.int32).tobytes(), preset=9))
    for components, step in ((5, 1e-2), (10, 4e-3), (20, 2e-3), (40, 1e-3), (80, 5e-4)):
        if components >= count:
            continue

        def encode():
            flat = capture.frames.reshape(count, -1)
            mean = flat.mean(0)
            values, vectors = np.linalg.eigh((flat - mean) @ (flat - mean).T)
            weights = vectors[:, ::-1][:, :components]
            basis = weights.T @ (flat - mean)
            parts, back = [], []
            # One step for all components, which have the length of what they move.
            for array, unit in ((mean, step / 8 * capture.diagonal), (basis, step * capture.diagonal), (weights, 2**-12)):
                whole = np.round(array / unit).astype(np.int32)
                parts += [((whole >> 8) & 0xFF).astype(np.uint8).tobytes(), (whole & 0xFF).astype(np.uint8).tobytes(), (whole >> 16).astype(np.int8).tobytes()]
                back.append(whole * unit)
            return lzma.compress(b"".join(parts), preset=9), back

        (file, (mean, basis, weights)), seconds = timed(encode)
        decoded, back = timed(lambda: (weights @ basis + mean).reshape(capture.frames.shape))
        yield capture.row("quantised PCA, xz", f"{components} components", len(file) + connectivity, decoded, seconds, back)


def skinning(capture):
    """Smooth skinning decomposition (Le and Deng 2012): rigid bones in every frame, eight of them for each point."""
    count, points, _ = capture.frames.shape
    most, unit = 8, 2e-5 * capture.diagonal
    connectivity = len(lzma.compress(np.diff(capture.faces.ravel().astype(np.int32)).astype(np.int32).tobytes(), preset=9))
    homogeneous = np.c_[np.round(capture.rest / unit) * unit, np.ones(points)]
    for bones in (10, 20, 40, 80):

        def encode():
            solver = py_dem_bones.DemBones()
            solver.nV, solver.nF, solver.nS, solver.nB = points, count, 1, bones
            solver.nIters, solver.nnz = 30, most
            solver.fStart, solver.subjectID = np.array([0, count]), np.zeros(count, dtype=np.int32)
            solver.u, solver.fv = capture.rest.T.copy(), capture.faces.tolist()
            solver.v = capture.frames.transpose(0, 2, 1).reshape(3 * count, points).copy()
            solver.init()
            solver.compute()
            weights = np.asarray(solver.get_weights())
            chosen = np.argsort(-weights, axis=0)[:most]
            weights = np.round(np.take_along_axis(weights, chosen, axis=0) * 1023).astype(np.int16)
            moved = np.asarray(solver.m).reshape(count, 4, solver.nB, 4)[:, :3].transpose(0, 2, 1, 3)
            turned = np.round(Rotation.from_matrix(moved[..., :3].reshape(-1, 3, 3)).as_quat(canonical=True)[:, :3].reshape(moved.shape[:-1]) * 2**14).astype(np.int32)
            shifted = np.round(moved[..., 3] / unit).astype(np.int32)
            # Frames as differences to the one before.
            parts = [np.diff(np.round(capture.rest / unit).astype(np.int32), axis=0, prepend=0), chosen.astype(np.uint8), weights]
            parts += [np.diff(of, axis=0, prepend=np.zeros((1, *of.shape[1:]), np.int32)) for of in (turned, shifted)]
            bytes_of = [np.ascontiguousarray(part.ravel().view(np.uint8).reshape(-1, part.itemsize).T).tobytes() for part in map(np.ascontiguousarray, parts)]
            return sum(len(lzma.compress(part, preset=9)) for part in bytes_of), (chosen, weights, turned, shifted)

        def decode():
            shares = np.zeros((kept[2].shape[1], points))
            np.put_along_axis(shares, kept[0], kept[1] / np.maximum(kept[1].sum(0), 1), axis=0)
            weighted = np.einsum("bn,nk->bkn", shares, homogeneous).reshape(-1, points)
            vectors = kept[2].reshape(-1, 3) / 2**14
            real = np.sqrt(np.maximum(0, 1 - np.square(vectors).sum(1, keepdims=True)))
            turned = Rotation.from_quat(np.c_[vectors, real]).as_matrix().reshape(*kept[2].shape, 3)
            moved = np.concatenate([turned, unit * kept[3][..., None]], axis=3)
            return (moved.transpose(0, 2, 1, 3).reshape(3 * count, -1) @ weighted).reshape(count, 3, points).transpose(0, 2, 1)

        (size, kept), seconds = timed(encode)
        decoded, back = timed(decode)
        yield capture.row("skinning by py-dem-bones, xz", f"{bones} bones", size + connectivity, decoded, seconds, back)


def plain(capture):
    data = capture.frames.astype(np.float32)
    raw = data.tobytes() + capture.faces.tobytes()
    for kind, encode, decode in [
        ("float32, zstd 19", zstandard.ZstdCompressor(19).compress, zstandard.ZstdDecompressor().decompress),
        ("float32, xz 9", lambda raw: lzma.compress(raw, preset=9), lzma.decompress),
    ]:
        file, seconds = timed(lambda: encode(raw))
        _, back = timed(lambda: decode(file))
        yield capture.row(kind, "", len(file), data.astype(np.float64), seconds, back)
    path = "/tmp/cager-bench.usdc"

    def usd():
        if os.path.exists(path):
            os.remove(path)
        stage = Usd.Stage.CreateNew(path)
        mesh = UsdGeom.Mesh.Define(stage, "/model")
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(capture.faces), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(capture.faces.ravel().astype(np.int32)))
        attribute = mesh.CreatePointsAttr()
        for k, frame in enumerate(data):
            attribute.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(frame)), k)
        stage.Save()

    _, seconds = timed(usd)

    def read():
        stage = Usd.Stage.Open(path)
        points = UsdGeom.Mesh(stage.GetPrimAtPath("/model")).GetPointsAttr()
        return [np.array(points.Get(k)) for k in range(len(data))]

    _, back = timed(read)
    yield capture.row("USD (usdc)", "", os.path.getsize(path), data.astype(np.float64), seconds, back)
    os.remove(path)


def alembic(capture):
    """Through Blender, which `make blender` installs; without it there is no such row."""
    if not os.path.exists(BLENDER):
        print("no Alembic: `make blender` installs what writes it", file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("rest.npy", "faces.npy", "frames.npy", "out.abc")]
        frames = capture.frames.astype(np.float32)
        for path, array in zip(paths, (capture.rest, capture.faces, frames)):
            np.save(path, array)
        script = os.path.join(ROOT, "benches", "peers", "alembic.py")
        done = subprocess.run([BLENDER, script, *paths], capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(done.stderr)
        found = json.loads(done.stdout.strip().splitlines()[-1])
        if found["apart"] > 1e-6 * capture.diagonal:
            raise SystemExit(f"{capture.name}: Alembic gave back positions {found['apart']:.1e} apart")
    yield capture.row("Alembic (Ogawa)", "", found["bytes"], frames.astype(np.float64), found["write"], found["read"])


def plot(name, rows):
    """Bits over error, both logarithmic; a line for each kind."""
    width, height, left, bottom, top, right = 760, 420, 56, 44, 16, 232
    lossy = [row for row in rows if row["kg"] > 1e-3]
    low = [math.log10(min(row[key] for row in lossy)) - 0.1 for key in ("kg", "bpvf")]
    high = [math.log10(max(row[key] for row in lossy)) + 0.1 for key in ("kg", "bpvf")]
    x = lambda kg: left + (math.log10(kg) - low[0]) / (high[0] - low[0]) * (width - left - right)
    y = lambda bpvf: height - bottom - (math.log10(bpvf) - low[1]) / (high[1] - low[1]) * (height - bottom - top)
    colours = ["#1a6fb5", "#6aa9dc", "#123a5e", "#c0504d", "#d98b2b", "#6b8e23", "#7a5299"]
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">', f'<rect width="{width}" height="{height}" fill="#fff"/>']
    for axis, place, label in ((0, x, lambda v: f"{v:g}"), (1, y, lambda v: f"{v:g}")):
        for power in range(math.floor(low[axis]), math.ceil(high[axis]) + 1):
            for factor in (1, 2, 5):
                value = factor * 10.0**power
                if not low[axis] <= math.log10(value) <= high[axis]:
                    continue
                at = place(value)
                if axis == 0:
                    out.append(f'<path d="M{at:.1f} {top}V{height - bottom}" stroke="#e4e4e4"/><text x="{at:.1f}" y="{height - bottom + 16}" text-anchor="middle">{label(value)}</text>')
                else:
                    out.append(f'<path d="M{left} {at:.1f}H{width - right}" stroke="#e4e4e4"/><text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{label(value)}</text>')
    out.append(f'<text x="{(left + width - right) / 2}" y="{height - 8}" text-anchor="middle">KG error, %</text>')
    out.append(f'<text x="14" y="{(top + height - bottom) / 2}" text-anchor="middle" transform="rotate(-90 14 {(top + height - bottom) / 2})">bits per vertex and frame</text>')
    for k, kind in enumerate(dict.fromkeys(row["kind"] for row in lossy)):
        points = sorted((row["kg"], row["bpvf"]) for row in lossy if row["kind"] == kind)
        colour = colours[k % len(colours)]
        path = " ".join(f"{x(kg):.1f},{y(bpvf):.1f}" for kg, bpvf in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
        out += [f'<circle cx="{x(kg):.1f}" cy="{y(bpvf):.1f}" r="2.6" fill="{colour}"/>' for kg, bpvf in points]
        out.append(f'<path d="M{width - right + 14} {top + 14 + 18 * k}h18" stroke="{colour}" stroke-width="2"/><text x="{width - right + 38}" y="{top + 18 + 18 * k}">{kind}</text>')
    with open(os.path.join(ROOT, "docs", f"rates-{name}.svg"), "w", encoding="utf-8") as file:
        file.write("\n".join(out + ["</svg>", ""]))


def rows_of(rows):
    return table(
        ["file", "setting", "bits per vertex and frame", "KG error, %", "largest error, % of the diagonal", "encoded, frames/s", "decoded, frames/s"],
        [[r["kind"], r["setting"], f"{r['bpvf']:.3f}", f"{r['kg']:.4f}", f"{100 * r['max']:.4f}", f"{r['encode']:,.0f}", f"{r['decode']:,.0f}"] for r in rows],
    )


def at_error(rows, kind, goal):
    """Bits per vertex and frame of a kind at a KG error, between the two files around it: the logarithm of the rate is taken as linear in that of the
    error. None where no file is below or none is above."""
    points = frontier((row["kg"], row["bpvf"]) for row in rows if row["kind"] == kind and row["kg"] > 0)
    for (low, much), (high, little) in zip(points, points[1:]):
        if low <= goal <= high:
            part = math.log(goal / low) / math.log(high / low)
            return math.exp((1 - part) * math.log(much) + part * math.log(little))
    return None


def summary(captures):
    """Rates of all kinds at the same errors."""
    lines = []
    for name in ("samba", "horse-gallop"):
        for goal in (0.6, 0.21, 0.11):
            rates = [at_error(captures[name], kind, goal) for kind in (OURS, *PEERS)]
            lines.append([name, f"{goal} %", *("–" if rate is None else f"{rate:.2f}" for rate in rates)])
    head = ["capture", "KG error", "cager, designed cage of 350", "quantised PCA + xz", "Draco, each frame", "meshoptimizer, temporal deltas"]
    return table(head, lines)


def recorded(text):
    """The rows that the page has, by captures."""
    captures, rows = {}, None
    for line in text.split("<!-- rates: begin -->")[1].split("<!-- rates: end -->")[0].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("## "):
            rows = captures.setdefault(line[3:], [])
        elif line.startswith("| ") and cells[0] != "file":
            rows.append({"kind": cells[0], "setting": cells[1], "bpvf": float(cells[2]), "kg": float(cells[3])})
    return captures


def curve(rows, kind, error):
    """The best points of a kind, as logarithm of the error and rate."""
    points = frontier((row[error], row["bpvf"]) for row in rows if row["kind"] == kind and row[error] > 0)
    return [(math.log10(error), rate) for error, rate in points]


def differences(captures):
    """Table of what ours takes more or less than each peer."""
    out = []
    for name, rows in captures.items():
        for error, label in (("kg", "KG error"), ("sted", "STED-like")):
            found = [bd_rate(curve(rows, peer, error), curve(rows, OURS, error)) for peer in PEERS]
            out.append([name, label, *("–" if d is None else f"{d[0]:+.1f} % over {100 * d[1]:.0f} %" for d in found)])
    return table(["capture", "at the same", *(f"against {peer}" for peer in PEERS)], out)


def perceptual(captures):
    """The part of the page about the measure like STED: differences between curves, and the values of every file that is not exact."""
    page = io.StringIO()
    page.write(f"\n{differences(captures)}\n")
    for name, rows in captures.items():
        shown = [row for row in rows if row["kind"] in (OURS, *PEERS)]
        page.write(f"\n### {name}\n\n")
        head = ["file", "setting", "bits per vertex and frame", "KG error, %", "STED-like", "spatial part", "temporal part"]
        lines = [[r["kind"], r["setting"], f"{r['bpvf']:.3f}", f"{r['kg']:.4f}", *(f"{r[key]:.6f}" for key in ("sted", "sted spatial", "sted temporal"))] for r in shown]
        page.write(table(head, lines) + "\n")
    return page.getvalue()


def lossy(capture, folder):
    """Rows of the files of which there are curves."""
    return [row for part in (ours(capture, folder, ["designed, 350"]), draco(capture), meshopt(capture), pca(capture)) for row in part]


def write_perceptual(folder, captures):
    captures[f"{CYCLE[0]}, its first {CYCLE[1]} frames"] = lossy(Capture(*CYCLE), folder)
    with open(os.path.join(folder, "perceptual.json"), "w", encoding="utf-8") as file:
        json.dump(captures, file, indent=1)
    with open(PAGE, encoding="utf-8") as file:
        text = write(file.read(), "perceptual", perceptual(captures))
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(text)


def main():
    arguments = [argument for argument in sys.argv[1:] if argument not in ("--perceptual", "--summary")]
    folder = arguments[0] if arguments else os.path.join(ROOT, "out", "codec")
    if "--summary" in sys.argv[1:]:
        with open(PAGE, encoding="utf-8") as file:
            text = file.read()
        with open(PAGE, "w", encoding="utf-8") as file:
            file.write(write(text, "summary", summary(recorded(text))))
        return
    os.makedirs(folder, exist_ok=True)
    if "--perceptual" in sys.argv[1:]:
        captures = {}
        for name in CAPTURES:
            captures[name] = lossy(Capture(name), folder)
            print(name, flush=True)
        write_perceptual(folder, captures)
        return
    page = io.StringIO()
    captures = {}
    for name in CAPTURES:
        capture = Capture(name)
        rows = [row for part in (ours(capture, folder), draco(capture), meshopt(capture), pca(capture), skinning(capture), plain(capture), alembic(capture)) for row in part]
        plot(name, rows)
        captures[name] = rows
        count, points, _ = capture.frames.shape
        page.write(f"\n## {name}\n\n{points:,} points, {count} frames.\n\n![bits over error](rates-{name}.svg)\n\n{rows_of(rows)}\n")
        print(name, flush=True)
    with open(os.path.join(folder, "rates.json"), "w", encoding="utf-8") as file:
        json.dump([row for rows in captures.values() for row in rows], file, indent=1)
    with open(PAGE, encoding="utf-8") as file:
        text = write(file.read(), "rates", page.getvalue())
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(write(text, "summary", summary(captures)))
    write_perceptual(folder, captures)


if __name__ == "__main__":
    main()
