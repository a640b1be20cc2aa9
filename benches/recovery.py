"""Recovers the real captures from surfaces without correspondence, beside other programs, and writes the tables of docs/RECOVERY.md.

`make recovery` builds the program and calls this. The captures are not part of the project: they are looked for in CAGER_CAPTURES
(default ../shared/data). Observations and results stay in the folder given as argument (default out/recovery/).
"""

import json
import os
import subprocess
import sys
import time

import numpy as np
import trimesh

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DATA = os.environ.get("CAGER_CAPTURES", os.path.join(ROOT, "..", "shared", "data"))
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
CAGER = os.environ.get("CAGER", os.path.join(TARGET, "release", "cager"))
PAGE = os.path.join(ROOT, "docs", "RECOVERY.md")
POINTS = 15_000
# Captures, and the step between the frames that are observed.
CAPTURES = [("samba", 1), ("samba", 2), ("samba", 4), ("makehuman-cmu-walk", 1), ("horse-gallop", 1)]
# Frames of samba that other programs register, one onto the next.
PAIR = 60, 61


def capture(name):
    """Frames (frames × points × 3) and faces of a capture."""
    faces = []
    with open(os.path.join(DATA, name, "rest.obj"), encoding="utf-8") as file:
        for line in file:
            if line.startswith("f "):
                corners = [int(word.split("/")[0]) - 1 for word in line.split()[1:]]
                faces += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    return np.load(os.path.join(DATA, name, "frames.npy")).astype(float), np.array(faces)


def sample(vertices, faces, seed):
    """Points uniform by area, and their normals."""
    random = np.random.default_rng(seed)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    face = random.choice(len(faces), POINTS, p=areas / areas.sum())
    u, v = np.sqrt(random.random(POINTS)), random.random(POINTS)
    weights = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    return np.einsum("ni,nij->nj", weights, corners[face]), normals[face] / areas[face, None]


def write_cloud(path, points, normals):
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    with open(path, "wb") as file:
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{names}end_header\n".encode())
        file.write(np.hstack([points, normals]).astype("<f4").tobytes())


def recovered(folder, frames, faces, chosen, *options):
    """Positions of the template, the first of the frames, in the chosen ones, and the report."""
    os.makedirs(folder, exist_ok=True)
    template, observed, out, report, decoded = (os.path.join(folder, name) for name in ("template.obj", "observed", "out.cager", "report.json", "out.npy"))
    os.makedirs(observed, exist_ok=True)
    trimesh.Trimesh(frames[0], faces, process=False).export(template, digits=9)
    for frame in chosen:
        path = os.path.join(observed, f"{frame:04}.ply")
        if not os.path.exists(path):
            write_cloud(path, *sample(frames[frame], faces, frame))
    run("recover", "--template", template, "--frames", observed, "-o", out, "--report", report, "--overwrite", *options)
    run("decode", out, "-o", decoded, "--overwrite")
    with open(report, encoding="utf-8") as file:
        return np.load(decoded).astype(float), json.load(file)


def run(*arguments):
    subprocess.run([CAGER, *arguments], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def rms(vectors):
    return np.sqrt((vectors**2).sum(axis=-1).mean(axis=-1))


def second_differences(motion):
    return np.sqrt(((motion[:-2] - 2 * motion[1:-1] + motion[2:]) ** 2).sum(axis=-1).mean())


def tracked(folder):
    rows = []
    for name, step in CAPTURES:
        frames, faces = capture(name)
        chosen = range(0, len(frames), step)
        result, report = recovered(os.path.join(folder, f"{name}-{step}"), frames, faces, chosen)
        truth = frames[::step]
        diagonal = np.linalg.norm(np.ptp(frames[0], axis=0)) / 100
        error = (result - truth) / diagonal
        by_frame = rms(error)
        row = [name if step == 1 else f"{name}, one frame of {step}", f"{len(truth)}", f"{by_frame[1:].mean():.3f}", f"{by_frame.max():.3f}"]
        row += [f"{np.linalg.norm(error, axis=2).max():.1f}", f"{by_frame[0]:.3f}", f"{second_differences(error):.3f} ({second_differences(truth / diagonal):.3f})"]
        row += [f"{len(report['lost'])}"]
        rows.append(row)
        print(*row, flush=True)
    head = ["capture", "frames", "mean", "worst frame", "largest of all points", "first frame", "second differences of the error in time (of the truth)", "lost"]
    return table(head, rows)


def beside_others(folder):
    frames, faces = capture("samba")
    source, truth = frames[PAIR[0]], frames[PAIR[1]]
    points, _ = sample(truth, faces, PAIR[1])
    diagonal = np.linalg.norm(np.ptp(source, axis=0))
    rows = []

    def add(name, result, seconds):
        error = np.linalg.norm(result - truth, axis=1) / diagonal * 100
        there = trimesh.proximity.closest_point(trimesh.Trimesh(truth, faces, process=False), result)[1] / diagonal * 100
        row = [name, f"{np.sqrt((error**2).mean()):.3f}", f"{np.percentile(error, 95):.2f}", f"{error.max():.2f}", f"{there.mean():.3f}", f"{seconds:.2f}"]
        rows.append(row)
        print(*row, flush=True)

    def timed(name, register):
        start = time.perf_counter()
        result = register()
        add(name, result, time.perf_counter() - start)

    add("where it starts", source, 0)
    result, report = recovered(os.path.join(folder, "pair"), np.concatenate([source[None], frames[1:]]), faces, [PAIR[1]])
    add("cager recover", result[0], report["seconds"]["follow"])
    mesh = trimesh.Trimesh(source, faces, process=False)
    timed(
        "trimesh nricp_amberg, onto the true surface",
        lambda: trimesh.registration.nricp_amberg(mesh, trimesh.Trimesh(truth, faces, process=False)),
    )
    try:
        import rustcpd

        fast = {"normalize": True, "low_rank_method": "pivoted_cholesky"}
        timed("rustcpd deformable, pivoted Cholesky", lambda: rustcpd.register_deformable(points, source, **fast).points)
        loose = {"alpha": 0.1, "beta": 0.3, "outlier_weight": 0.05}
        timed("rustcpd deformable, alpha 0.1, beta 0.3", lambda: rustcpd.register_deformable(points, source, **fast, **loose).points)
    except ImportError as missing:
        print("rustcpd is not measured:", missing)
    try:
        from probreg import cpd

        def nonrigid():
            # Its kernel is dense: every fourth vertex, and the nearest ones' displacement for the others.
            few = source[::4]
            moved = cpd.registration_cpd(few, points[::4], tf_type_name="nonrigid").transformation.transform(few) - few
            return source + moved[trimesh.proximity.PointCloud(few).kdtree.query(source)[1]]

        timed("probreg cpd nonrigid, a quarter of the points", nonrigid)
    except ImportError as missing:
        print("probreg is not measured:", missing)
    return table(["program", "RMS", "95 %", "largest", "to the surface", "s"], rows)


def table(head, rows):
    lines = ["| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows]]
    return "\n".join(lines)


def write(page, name, text):
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, rest = page.split(begin, 1)
    return before + begin + text + "\n" + end + rest.split(end, 1)[1]


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "out", "recovery")
    tables = {"peers": beside_others(folder), "captures": tracked(folder)}
    with open(PAGE, encoding="utf-8") as file:
        page = file.read()
    for name, text in tables.items():
        page = write(page, name, text)
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(page)


if __name__ == "__main__":
    main()
