"""Redoes the figures of the paper on shape exploration by its method and by the fitted cage: docs/pictures/explore-*.png, and their table in docs/EXPLORATION.md.

Called after transfers.py by `make transfers`, with the same folder and variables. Models that the paper shows and the captures lack are made from others: the hand
and the shell are opened, the cat's triangles are joined to quads.
"""

import os
import sys

import numpy as np
from deformation import normals, unit
from raster import render, sheet, view
from recovery import ROOT, table
from transfers import DATA, EXACT, WALK, Refused, frames_of, mesh, stem, transferred, update, write_obj

PICTURES = os.path.join(ROOT, "docs", "pictures")
SOURCE, TARGET = (0.62, 0.72, 0.86), (0.93, 0.78, 0.55)
PANEL = (200, 170)
# Frame of the gallop that is shown.
FRAME = 7
# Title, name of the result as in transfers.py, options.
METHODS = [
    ("paper, icosahedron", "public, icosahedron", ["--method", "public", "--public", "ico"]),
    ("paper, hull of 42", "public, hull of 42", ["--method", "public", "--public", "hull"]),
    ("fitted", "**fitted**", []),
]


def panel(points, faces, colour, rotation, size=PANEL, extent=None, edges=None):
    seen = points @ rotation.T
    middle = (seen.max(0) + seen.min(0)) / 2 @ rotation
    widths = np.ptp(seen, axis=0)
    extent = extent or 1.12 * max(widths[1], widths[0] * size[1] / size[0])
    return render(points, faces, colour, rotation, (middle, extent), size, edges)


def quads(points, triangles):
    """Pairs of triangles joined where they make the best quads; the others stay."""
    owners = {}
    for t, triangle in enumerate(triangles):
        for k in range(3):
            owners.setdefault(frozenset((triangle[k], triangle[(k + 1) % 3])), []).append((t, k))
    normal = unit(normals(points, triangles))
    found = []
    for pair in owners.values():
        if len(pair) != 2:
            continue
        (t, k), (s, j) = pair
        quad = [triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3], triangles[t][k], triangles[s][(j + 2) % 3]]
        sides = unit(np.roll(points[quad], -1, axis=0) - points[quad])
        skew = np.abs((sides * np.roll(sides, -1, axis=0)).sum(axis=1)).max()
        found.append((skew + 2 * (1 - normal[t] @ normal[s]), t, s, quad))
    joined, faces = set(), []
    for _, t, s, quad in sorted(found, key=lambda entry: entry[0]):
        if t not in joined and s not in joined:
            joined |= {t, s}
            faces.append(quad)
    return faces + [list(triangle) for t, triangle in enumerate(triangles) if t not in joined]


def compacted(points, faces):
    """The largest connected part of a mesh, without points that are in no face."""
    import trimesh

    parts = trimesh.graph.connected_component_labels(trimesh.Trimesh(points, faces, process=False).face_adjacency, node_count=len(faces))
    faces = faces[parts == np.bincount(parts).argmax()]
    used, numbers = np.unique(faces, return_inverse=True)
    return points[used], numbers.reshape(-1, 3)


def triangulated(faces):
    triangles, sides = [], []
    for face in faces:
        for k in range(1, len(face) - 1):
            triangles.append((face[0], face[k], face[k + 1]))
            sides.append((True, k + 2 == len(face), k == 1))
    return np.array(triangles), np.array(sides)


def targets():
    """Title, number of the paper's figure, name, points, faces, the axes from which they are seen, and how the horse is laid onto them."""
    hand, hand_faces = mesh("pairs/pgc_hand/mesh.obj")
    cat, cat_faces = mesh("animals/cat.obj")
    lion, lion_faces = mesh("animals/lion.obj")
    man, man_faces = mesh(f"{WALK}/rest.obj")
    side, stands = view("y", -60, 12), ["--up", "y"]
    yield "quadruped", "13", "cat", cat, cat_faces, side, stands
    yield "quadruped", "13", "lion", lion, lion_faces, side, stands
    yield "quads", "12", "quad-cat", cat, quads(cat, cat_faces), side, stands
    yield "hand", "16", "hand", hand, hand_faces, view("y", -30, 10), stands
    long = np.argmax(np.ptp(hand, axis=0))
    wrist = hand[hand_faces].mean(axis=1)[:, long]
    ends = [wrist < np.quantile(wrist, 0.06), wrist > np.quantile(wrist, 0.94)]
    # The wrist is the end that is wider.
    end = max(ends, key=lambda chosen: np.ptp(hand[hand_faces[chosen]].reshape(-1, 3), axis=0).prod())
    yield "open hand", "16", "open-hand", *compacted(hand, hand_faces[~end]), view("y", -30, 10), stands
    below = unit(normals(lion, lion_faces))[:, 1] < -0.35
    yield "open shell", "", "open-lion", *compacted(lion, lion_faces[~below]), view("y", -60, -25), stands
    upright = man[:, [0, 2, 1]] * [1, 1, -1]
    yield "biped", "1", "man", upright, man_faces, view("y", -35, 8), ["--align", on_hind_legs(upright)]


def on_hind_legs(target):
    """The matrix that stands the horse up, its back to the rear, as tall as the target."""
    horse, _ = mesh("horse-gallop/rest.obj")
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    standing = horse @ turn.T
    scale = np.ptp(target, axis=0)[1] / np.ptp(standing, axis=0)[1]
    middle = lambda points: (points.max(0) + points.min(0)) / 2
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scale * turn, middle(target) - scale * middle(standing)
    return " ".join(f"{x:.9g}" for x in matrix.ravel())


def main():
    folder = os.path.abspath(sys.argv[1]) if len(sys.argv) > 1 else os.path.join(ROOT, "out", "transfers")
    os.makedirs(PICTURES, exist_ok=True)
    rest_file, frames_file = (os.path.join(DATA, "horse-gallop", name) for name in ("rest.obj", "frames.npy"))
    horse, horse_faces = mesh(rest_file)
    pose = np.load(frames_file)[FRAME].astype(float)
    rows, sheets = [], {}
    for title, figure, name, points, faces, eye, laid in targets():
        into = os.path.join(folder, name)
        os.makedirs(into, exist_ok=True)
        target_file = os.path.join(into, "target.obj")
        if not os.path.exists(target_file):
            write_obj(target_file, points, faces)
        triangles, sides = triangulated(faces)
        lines = sides if name == "quad-cat" else None
        row = [title, figure, f"{len(points):,}"]
        pictures = [("source", panel(horse, horse_faces, SOURCE, view("y", -60, 12))), ("posed", panel(pose, horse_faces, SOURCE, view("y", -60, 12)))]
        pictures.append((name, panel(points, triangles, TARGET, eye, edges=lines)))
        extent = 1.3 * np.ptp(points @ eye.T, axis=0)[:2].max()
        for method, result, options in METHODS:
            try:
                shapes, report = transferred(stem(into, result), rest_file, frames_file, target_file, *laid, *options, *EXACT)
                pictures.append((method, panel(shapes[FRAME], triangles, TARGET, eye, extent=extent, edges=lines)))
                row += [f"{report['seconds']['prepare']:.1f}", f"{1000 * report['seconds']['frames'] / len(shapes):.1f}"]
                print(name, method, json_line(report), flush=True)
            except Refused as refused:
                pictures.append((f"{method}: refused", None))
                row += ["refused", ""]
                print(f"{name}, {method}: refused: {refused}", flush=True)
        rows.append(row)
        sheets.setdefault(title.split()[-1] if title != "quadruped" else title, []).append(pictures)
    for title, pictures in sheets.items():
        sheet(pictures, os.path.join(PICTURES, f"explore-{title}.png"), PANEL)
    head = ["target", "figure of the paper", "points", *[f"{method}, {what}" for method, _, _ in METHODS for what in ("s to prepare", "ms a frame")]]
    update("figures", table(head, rows))
    bodies(folder)


def bodies(folder):
    """The heavy woman in one frame of the walk, where transfers.py has left her."""
    into, frame, eye = os.path.join(folder, "anny-heavywoman-02_02"), 12, view("z", 60, 8)
    woman, faces = mesh("anny-heavywoman-02_02/rest.obj")
    size, extent = (200, 300), 1.15 * np.ptp(woman[:, 2])
    see = lambda points, colour: panel(points, faces, colour, eye, size, extent)
    pictures = [("source", see(frames_of(WALK)[frame], SOURCE)), ("at rest", see(woman, TARGET)), ("truth", see(frames_of("anny-heavywoman-02_02")[frame], TARGET))]
    found = [("fitted", "**fitted**"), ("paper, sphere of 162", "public, sphere of 162"), ("paper, hull of 42", "public, hull of 42"), ("Surface Deform", "blender")]
    for title, result in found:
        path = stem(into, result) + ".npy"
        if os.path.exists(path):
            pictures.append((title, see(np.load(path)[frame].astype(float), TARGET)))
    sheet([pictures], os.path.join(PICTURES, "explore-bodies.png"), size)


def json_line(report):
    return ", ".join(f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}" for key, value in report.items() if key not in ("seconds", "correspondence"))


if __name__ == "__main__":
    main()
