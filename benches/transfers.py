"""Moves motions onto other models by every method, beside other programs and the truth, and writes the tables of docs/EXPLORATION.md.

`make transfers` builds the program and calls this, then exploration_pictures.py. The captures are not part of the project: they are looked for in
CAGER_CAPTURES (default ../shared/data). CAGER is another program to measure, CAGER_BLENDER_PYTHON a Python that has bpy. Results stay in the folder given as
argument (default out/transfers/); those that are newer than the program are not made again.
"""

import json
import os
import subprocess
import sys
import time

import numpy as np
import trimesh
from deformation import DeformationTransfer, Quality, aligned, diagonal, mean_error, moved, normals, trembling, triangles_under
from recovery import CAGER, DATA, PAGE, ROOT, table, write

PAGE = os.path.join(os.path.dirname(PAGE), "EXPLORATION.md")
BLENDER = os.environ.get("CAGER_BLENDER_PYTHON", os.path.join(ROOT, "target", "blender", "bin", "python"))
SURFACE_DEFORM = os.path.join(ROOT, "benches", "peers", "surface_deform.py")
WALK = "anny-man-02_02"
# What is compared: title, capture with the truth, and the frame of it in which the target is at rest (None: its own rest pose).
PAIRS = [
    ("the same body, another mesh", "anny-man_soma-02_02", None),
    ("heavy woman", "anny-heavywoman-02_02", None),
    ("heavy woman, at rest in frame 12 of her walk", "anny-heavywoman-02_02", 12),
    ("heavy woman, at rest in frame 33", "anny-heavywoman-02_02", 33),
]
ANIMALS = ["cat", "lion"]
# Frames whose errors are measured: every so many.
EVERY = 6
# The table is about transfers: what is written is as good as exact.
EXACT = ["--max-error", "0.0002", "--cage-vertices", "50"]
PUBLIC = [
    ("public, box", ["--method", "public", "--public", "box"]),
    ("public, sphere of 42", ["--method", "public", "--cage", "SPHERE42"]),
    ("public, sphere of 162", ["--method", "public", "--public", "sphere"]),
    ("public, hull of 42", ["--method", "public", "--public", "hull"]),
    ("public, offset surface of 350", ["--method", "public", "--public", "offset"]),
    ("rigid, sphere of 162", ["--method", "rigid", "--public", "sphere"]),
]


class Refused(Exception):
    """The program, or another one, did not do it."""


def mesh(name):
    """Vertices and triangles of a model of the captures."""
    points, faces = [], []
    with open(os.path.join(DATA, name), encoding="utf-8") as file:
        for line in file:
            if line.startswith("v "):
                points.append([float(word) for word in line.split()[1:4]])
            elif line.startswith("f "):
                corners = [int(word.split("/")[0]) - 1 for word in line.split()[1:]]
                faces += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    return np.array(points), np.array(faces)


def frames_of(name):
    return np.load(os.path.join(DATA, name, "frames.npy")).astype(float)


def write_obj(path, points, faces):
    """Faces may be of any number of corners."""
    with open(path, "w", encoding="utf-8") as file:
        file.writelines("v " + " ".join(f"{x:.9g}" for x in point) + "\n" for point in points)
        file.writelines("f " + " ".join(str(corner + 1) for corner in face) + "\n" for face in faces)


def run(*arguments):
    """The program's words, warnings among them; what it says is a refusal where it fails."""
    done = subprocess.run([CAGER, *arguments], capture_output=True, text=True)
    words = " ".join(done.stderr.split())
    if done.returncode != 0:
        raise Refused(words.removeprefix("cager: "))
    return words


def fresh(path):
    return os.path.exists(path) and os.path.getmtime(path) > os.path.getmtime(CAGER)


def stem(folder, name):
    """Where results of this name stay."""
    return os.path.join(folder, "".join(c if c.isalnum() else "-" for c in name))


def transferred(path, rest, frames, target, *options):
    """Frames of the target by `cager transfer`, and its report; `path` is where they stay, without an ending."""
    out, report, decoded = path + ".cager", path + ".json", path + ".npy"
    if not fresh(decoded):
        given = ["--source-rest", rest, "--source-frames", frames, "--target", target]
        said = run("transfer", *given, "-o", out, "--report", report, "--overwrite", *options)
        for line in filter(None, said.split("cager: ")):
            if "warning" in line or "almost as well" in line:
                print(f"  {os.path.basename(path)}: {line}", flush=True)
        run("decode", out, "-o", decoded, "--overwrite", "--quiet")
    with open(report, encoding="utf-8") as file:
        return np.load(decoded).astype(float), json.load(file)


class Pair:
    """A source with its motion, a target at rest, and the truth where there is one."""

    def __init__(self, folder, source, source_frames, target_file, truth=None, up="z"):
        self.folder, self.up, self.truth = folder, up, truth
        self.source_file, self.frames_file, self.target_file = os.path.join(DATA, source), source_frames, target_file
        self.source, self.faces = mesh(self.source_file)
        self.frames = np.load(source_frames).astype(float)
        self.target, self.target_faces = mesh(target_file)
        self.quality = Quality(self.target, self.target_faces)
        self.size = diagonal(self.target)
        self.every = range(0, len(self.frames), EVERY)
        self.rows = []

    def cager(self, name, *options):
        if "SPHERE42" in options:
            sphere = os.path.join(self.folder, "sphere42.obj")
            run("cage", "--rest", self.source_file, "--rest", self.target_file, "--general", "sphere", "--vertices", "42", "-o", sphere, "--overwrite")
            options = [sphere if option == "SPHERE42" else option for option in options]
        return transferred(stem(self.folder, name), self.source_file, self.frames_file, self.target_file, "--up", self.up, *options)

    def add(self, name, make):
        """A row of the table. `make` gives frames, and seconds before all frames and for them."""
        try:
            shapes, prepare, seconds = make()
        except Refused as refused:
            self.rows.append([name, f"refused: {reason(refused)}", *[""] * (7 if self.truth is not None else 5)])
            print(*self.rows[-1], flush=True)
            return
        row = [name]
        if self.truth is not None:
            mean = lambda poses: np.mean([mean_error(poses[f], self.truth[f]) for f in self.every])
            error = mean(shapes)
            row += [f"{100 * error / mean([self.target] * len(shapes)):.1f}", f"{100 * error / self.size:.3f}"]
        measured = np.array([self.quality(shapes[f]) for f in self.every])
        shake = trembling(shapes) / self.size / (trembling(self.frames) / diagonal(self.source))
        lowest, highest = measured[:, 2].min(), measured[:, 2].max()
        row += [f"{measured[:, 0].mean():.2f}", f"{measured[:, 1].mean():.2f}", f"{lowest:.2f}–{highest:.2f}", f"{shake:.2f}"]
        if self.truth is not None:
            row += [f"{self.slide(shapes):.3f}"]
        row += ["", ""] if seconds is None else [f"{prepare:.1f}", f"{1000 * seconds / len(shapes):.1f}"]
        self.rows.append(row)
        print(*row, sep="; ", flush=True)

    def add_cager(self, name, *options):
        def make():
            shapes, report = self.cager(name, *options)
            return shapes, report["seconds"]["prepare"], report["seconds"]["frames"]

        self.add(name, make)

    def slide(self, shapes):
        """How far the points slide in a frame that stand on the floor in the truth, in percent of the diagonal."""
        floor = self.truth[:, :, 2].min() + 0.02 * self.size
        low = self.truth[:, :, 2] < floor
        still = np.linalg.norm(np.diff(self.truth, axis=0), axis=2) < 0.004 * self.size
        along = np.linalg.norm(np.diff(shapes, axis=0)[:, :, :2], axis=2)
        return 100 * along[low[1:] & low[:-1] & still].mean() / self.size

    def laid(self):
        """The similarity that lays the source onto the target as they stand: the centres and sizes of the surfaces meet."""
        (here, size), (there, other) = middle(self.source, self.faces), middle(self.target, self.target_faces)
        matrix = np.eye(4)
        matrix[:3, :3] *= other / size
        matrix[:3, 3] = there - other / size * here
        return matrix

    def by_deformation_transfer(self, registered, started, source=None):
        """Frames by triangles that correspond: those of the registered source lie on the target's."""
        matrix = self.laid()
        source = moved(self.source if source is None else source, matrix)
        under = triangles_under(self.target, self.target_faces, registered, self.faces)
        transfer = DeformationTransfer(source, self.faces, self.target, self.target_faces, under)
        prepared = time.perf_counter()
        shapes = np.array([transfer(moved(pose, matrix)) for pose in self.frames])
        return shapes, prepared - started, time.perf_counter() - prepared

    def nricp(self):
        started = time.perf_counter()
        kept = os.path.join(self.folder, "nricp.npz")
        if os.path.exists(kept):
            registered, before = np.load(kept)["points"], float(np.load(kept)["seconds"])
        else:
            source, target = (trimesh.Trimesh(p, f, process=False) for p, f in ((moved(self.source, self.laid()), self.faces), (self.target, self.target_faces)))
            registered, before = trimesh.registration.nricp_amberg(source, target), 0.0
            np.savez(kept, points=registered, seconds=time.perf_counter() - started)
        shapes, prepare, seconds = self.by_deformation_transfer(registered, started)
        return shapes, prepare + before, seconds

    def surface_deform(self):
        if not os.path.exists(BLENDER):
            raise Refused("there is no Python with bpy (make target/blender/bin/python, which needs Python 3.11)")
        given, out = (os.path.join(self.folder, name) for name in ("blender.npz", "blender.npy"))
        matrix = self.laid()
        np.savez(
            given,
            source=moved(self.source, matrix),
            faces=self.faces,
            frames=np.array([moved(pose, matrix) for pose in self.frames]),
            target=self.target,
            target_faces=self.target_faces,
        )
        done = subprocess.run([BLENDER, SURFACE_DEFORM, given, out], capture_output=True, text=True)
        if done.returncode != 0:
            raise Refused(f"Blender: {' '.join(done.stderr.split())[-200:]}")
        seconds = json.loads(done.stdout.strip().splitlines()[-1])
        return np.load(out).astype(float), seconds["prepare"], seconds["frames"]


def middle(points, faces):
    """The centre of a surface, and how far its points are from it in the root mean square."""
    areas, centres = np.linalg.norm(normals(points, faces), axis=1), points[faces].mean(axis=1)
    centre = areas @ centres / areas.sum()
    return centre, np.sqrt(areas @ ((centres - centre) ** 2).sum(axis=1) / areas.sum())


def bodies(folder, title, capture, frame):
    truth = frames_of(capture)
    target_file = os.path.join(DATA, capture, "rest.obj")
    if frame is not None:
        _, faces = mesh(target_file)
        target_file = os.path.join(folder, f"{capture}-{frame}.obj")
        write_obj(target_file, truth[frame], faces)
    name = capture if frame is None else f"{capture}-{frame}"
    os.makedirs(os.path.join(folder, name), exist_ok=True)
    pair = Pair(os.path.join(folder, name), f"{WALK}/rest.obj", os.path.join(DATA, WALK, "frames.npy"), target_file, truth)
    print(f"# {title}", flush=True)
    pair.add("unmoved", lambda: (np.repeat(pair.target[None], len(truth), axis=0), 0, None))
    pair.add_cager("**fitted**", *EXACT)
    pair.add_cager("fitted, as it is written by default")
    for method, options in PUBLIC:
        pair.add_cager(method, *options, *EXACT)
    pair.add("trimesh `nricp_amberg`, deformation transfer", pair.nricp)
    pair.add("Blender, Surface Deform", pair.surface_deform)
    # Bodies of one family have the same triangles; the same body under another mesh lies on itself.
    rest, _ = mesh(f"{capture}/rest.obj")
    same = len(rest) == len(pair.source)
    true = rest if same else pair.source
    on = pair.target if same else moved(true, pair.laid())
    pair.add("true correspondences, deformation transfer", lambda: timeless(pair.by_deformation_transfer(on, 0)))
    if frame is not None:
        pair.add("the same, source at rest in that frame too", lambda: timeless(pair.by_deformation_transfer(on, 0, pair.frames[frame])))
    pair.add("the truth", lambda: (truth, 0, None))
    return pair.rows


def timeless(made):
    return made[0], 0, None


def animals(folder):
    rows = []
    for name in ANIMALS:
        pair = gallop(folder, name)
        print(f"# {name}", flush=True)
        methods = [("**fitted**", []), ("fitted, relative", ["--pose", "relative"]), ("fitted, absolute", ["--pose", "absolute"])]
        methods += [method for method in PUBLIC if "SPHERE42" not in method[1]]
        for method, options in methods:
            pair.add_cager(method, *options, *EXACT)
        rows += [[name, *row] for row in pair.rows]
    return rows


def gallop(folder, name):
    into = os.path.join(folder, name)
    os.makedirs(into, exist_ok=True)
    frames = os.path.join(DATA, "horse-gallop", "frames.npy")
    return Pair(into, "horse-gallop/rest.obj", frames, os.path.join(DATA, "animals", f"{name}.obj"), up="y")


def between(folder):
    """Shapes half way between key frames of an arm, and how far they are from its way."""
    os.makedirs(os.path.join(folder, "arm"), exist_ok=True)
    rest, faces = mesh("supercages-arm/rest.obj")
    poses, size, rows = frames_of("supercages-arm"), diagonal(rest), []
    root_mean_square = lambda a, b: np.sqrt(((aligned(a, b)[0] - b) ** 2).sum(axis=1).mean())
    for first, last in [(0, 36), (36, 78)]:
        keys = [os.path.join(folder, "arm", f"{frame}.obj") for frame in (first, last)]
        for path, frame in zip(keys, (first, last)):
            write_obj(path, poses[frame], faces)
        row = [f"{first} to {last}"]
        for options in (["--on", "mesh"], ["--on", "cage"]):
            half, many = (os.path.join(folder, "arm", name) for name in ("half.obj", "many.npy"))
            try:
                run("explore", *keys, "--weights", "0.5,0.5", "-o", half, "--overwrite", *options)
                shape, _ = mesh(half)
                error = min(root_mean_square(shape, pose) for pose in poses[first : last + 1])
                took = []
                for steps in (2, 102):
                    clock = time.perf_counter()
                    run("explore", *keys, "--steps", str(steps), "-o", many, "--overwrite", *options)
                    took.append(time.perf_counter() - clock)
                row += [f"{100 * error / size:.3f}", f"{took[0]:.2f}", f"{1000 * (took[1] - took[0]) / 100:.1f}"]
            except Refused as refused:
                row += [f"refused: {reason(refused)}", "", ""]
        rows.append(row)
        print(*row, sep="; ", flush=True)
    return rows


def update(name, text):
    """Writes a table into the page."""
    with open(PAGE, encoding="utf-8") as file:
        page = file.read()
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(write(page, name, text))


def reason(refused):
    """What the program says last, without the warnings before it."""
    return str(refused).split("cager: ")[-1].strip()


def main():
    folder = os.path.abspath(sys.argv[1]) if len(sys.argv) > 1 else os.path.join(ROOT, "out", "transfers")
    os.makedirs(folder, exist_ok=True)
    sides = [f"on the {side}, {what}" for side in ("mesh", "cage") for what in ("% of the diagonal", "s in all for 2", "ms a shape more")]
    update("between", table(["frames", *sides], between(folder)))
    marks = ["folded, % of the area", "stretched, %", "volume", "jitter"]
    seconds = ["s to prepare", "ms a frame"]
    update("animals", table(["gallop onto", "", *marks, *seconds], animals(folder)))
    head = ["", "error, % of unmoved", "% of the diagonal", *marks, "feet slide, % a frame", *seconds]
    rows = []
    for title, capture, frame in PAIRS:
        rows += [[f"*{title}*", *[""] * (len(head) - 1)], *bodies(folder, title, capture, frame)]
        update("pairs", table(head, rows))


if __name__ == "__main__":
    main()
