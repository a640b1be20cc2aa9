"""Makes and designs cages for the real captures and writes their tables in docs/PAPER.md.

Standard library only, but for the cages of gpytoolbox, which peers/lazy_cage.py makes with the Python named in CAGER_LAZY_PYTHON; without it their table
stays as it is. `--lazy` makes that table alone. `make cages` builds the program and calls this. The captures are not part of the project: they are looked for
in CAGER_CAPTURES (default ../shared/data). Cages, reports and pictures stay in the folder given as argument (default out/cages); what is
there already is not made again.
"""

import array
import json
import os
import struct
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DATA = os.environ.get("CAGER_CAPTURES", os.path.join(ROOT, "..", "shared", "data"))
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
CAGER = os.environ.get("CAGER", os.path.join(TARGET, "release", "cager"))
PAGE = os.path.join(ROOT, "docs", "PAPER.md")
CAPTURES = ["horse-gallop", "samba", "makehuman-cmu-walk", "supercages-arm", "chickenCrossing"]
VERTICES = [50, 150, 350]
# The largest cages take minutes: of two captures.
LARGE, LARGE_OF = 1000, ["horse-gallop", "samba"]
KINDS = ["rest", "editable", "free"]
LAZY_PYTHON = os.environ.get("CAGER_LAZY_PYTHON")
# Cells along a side of the grid: what lazy_cage takes where nothing is said, and twice as many.
LAZY_GRIDS = [50, 100]


def run(*arguments):
    subprocess.run([CAGER, *arguments], check=True, stdout=subprocess.DEVNULL)


def read(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def encoded(folder, capture, name, cage, frames=None):
    """Report of an encoding with a cage and spread handles."""
    report = os.path.join(folder, f"{capture}-{name}-encoded.json")
    if not os.path.exists(report):
        at = os.path.join(DATA, capture)
        frames = frames or f"{at}/frames.npy"
        out = os.path.join(folder, "out.cager")
        run("encode", "--rest", f"{at}/rest.obj", "--cage", cage, "--frames", frames, "--handles", "spread", "-o", out, "--report", report, "--overwrite")
    return read(report)


def made(folder, capture, kind, vertices, frames=None, tag=""):
    """Report of a cage of a kind, and its path."""
    name = f"{capture}-{kind}-{vertices}{tag}"
    cage, report, picture = (os.path.join(folder, name + ending) for ending in (".obj", ".json", ".html"))
    if not os.path.exists(report):
        at = os.path.join(DATA, capture)
        command = ["cage", "--rest", f"{at}/rest.obj", "--vertices", str(vertices), "-o", cage, "--report", report, "--overwrite"]
        command += ["--picture", picture]
        if kind != "rest":
            command += ["--frames", frames or f"{at}/frames.npy", "--style", kind]
        run(*command)
        print(name, flush=True)
    return read(report), cage


def halves(folder, capture):
    """The first and the second half of a capture as files."""
    paths = [os.path.join(folder, f"{capture}-{half}.npy") for half in ("first", "second")]
    with open(os.path.join(DATA, capture, "frames.npy"), "rb") as file:
        data = file.read()
    header = struct.unpack("<H", data[8:10])[0]
    shape = [int(x) for x in data[10 : 10 + header].decode().split("(")[1].split(")")[0].split(",") if x.strip()]
    each = 12 * shape[1]
    middle = shape[0] // 2
    for path, first, last in zip(paths, (0, middle), (middle, shape[0])):
        values = array.array("f", data[10 + header + first * each : 10 + header + last * each])
        text = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({last - first}, {shape[1]}, 3), }}"
        text = text.ljust(117) + "\n"
        with open(path, "wb") as out:
            out.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode())
            values.tofile(out)
    return paths


def percent(x, digits=3):
    return f"{100 * x:.{digits}f}"


def table(headers, rows):
    lines = ["| " + " | ".join(headers) + " |", "|" + "---|" * len(headers)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def errors(folder):
    rows = []
    for capture in CAPTURES:
        given = os.path.join(DATA, capture, "cage350.obj")
        report = encoded(folder, capture, "given", given)
        row = [capture, "given", str(report["cage_vertices"]), percent(report["error"]["l2_mean"]), percent(report["error"]["linf_mean"], 2), f"{report['condition_number']['full']:,.0f}", "", ""]
        rows.append(row)
        for kind in KINDS:
            for vertices in VERTICES + ([LARGE] if capture in LARGE_OF else []):
                cage_report, cage = made(folder, capture, kind, vertices)
                report = encoded(folder, capture, f"{kind}-{vertices}", cage)
                name = {"rest": "from the rest pose", "editable": "designed, editable", "free": "designed, free"}[kind]
                row = [capture, name, str(cage_report["vertices"]), percent(report["error"]["l2_mean"]), percent(report["error"]["linf_mean"], 2)]
                row += [f"{report['condition_number']['full']:,.0f}", str(cage_report["points_outside"]), str(cage_report["self_intersections"])]
                rows.append(row)
    return table(["capture", "cage", "vertices", "mean L2, %", "mean L∞, %", "condition", "points outside", "faces that cut"], rows)


def steps(folder):
    rows = []
    for capture in CAPTURES:
        for kind in KINDS[1:]:
            for stage in made(folder, capture, kind, 350)[0]["design"]["stages"]:
                condition = stage.get("condition_number")
                row = [capture, kind, stage["name"], percent(stage["designed_error"]), percent(stage["held_back_error"])]
                rows.append(row + ["–" if condition is None else f"{condition:,.0f}"])
    return table(["capture", "style", "after", "seen, %", "held back, %", "condition"], rows)


def unseen(folder):
    rows = []
    for capture in CAPTURES[:3]:
        first, second = halves(folder, capture)
        _, own = made(folder, capture, "editable", 350, second, "-second")
        _, other = made(folder, capture, "editable", 350, first, "-first")
        results = [
            encoded(folder, capture, name, cage, second)["error"]["l2_mean"]
            for name, cage in [
                ("second-of-rest", os.path.join(folder, f"{capture}-rest-350.obj")),
                ("second-of-first", other),
                ("second-of-second", own),
            ]
        ]
        rows.append([capture] + [percent(x) for x in results])
    return table(["capture", "from the rest pose", "designed on the first half", "designed on the second half"], rows)


def held_back(folder, capture, name, cage):
    """Mean L2 error of a cage on the frames that designs hold back, every second one, or why it is refused."""
    at = os.path.join(DATA, capture)
    report = os.path.join(folder, f"{capture}-{name}-held-back.json")
    if not os.path.exists(report):
        frames = read(f"{at}/info.json")["frames"]
        command = ["encode", "--rest", f"{at}/rest.obj", "--cage", cage, "--frames", f"{at}/frames.npy", "--frames-range", f"1-{frames - 1}x2"]
        command += ["--handles", "spread", "-o", os.path.join(folder, "out.cager"), "--report", report, "--overwrite"]
        done = subprocess.run([CAGER, *command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            return None, "refused: " + done.stderr.strip().splitlines()[0]
    return read(report)["error"]["l2_mean"], None


def lazy(folder):
    """Beside cages of gpytoolbox's lazy_cage with as many vertices, of which the better grid counts."""
    rows = []
    for capture in CAPTURES:
        for vertices in VERTICES:
            found = []
            for grid in LAZY_GRIDS:
                name = f"{capture}-lazy-{vertices}-{grid}"
                cage, told = os.path.join(folder, f"{name}.obj"), os.path.join(folder, f"{name}.json")
                if not os.path.exists(told):
                    script = os.path.join(ROOT, "benches", "peers", "lazy_cage.py")
                    rest = os.path.join(DATA, capture, "rest.obj")
                    done = subprocess.run([LAZY_PYTHON, script, rest, str(vertices), str(grid), cage], stdout=subprocess.PIPE, text=True, check=True)
                    with open(told, "w", encoding="utf-8") as file:
                        file.write(done.stdout)
                made_of = read(told)["vertices"]
                if made_of == 0:
                    found.append((float("inf"), vertices, grid, "none is made"))
                    continue
                error, refusal = held_back(folder, capture, f"lazy-{vertices}-{grid}", cage)
                found.append((error if error is not None else float("inf"), made_of, grid, refusal))
            error, count, grid, refusal = min(found, key=lambda each: each[0])
            row = [capture, str(count), str(grid), refusal or percent(error)]
            for kind in ("rest", "free"):
                report, cage = made(folder, capture, kind, count)
                ours = held_back(folder, capture, f"{kind}-{count}", cage)[0]
                row.append(f"{percent(ours)} ({report['vertices']})")
            rows.append(row)
            print(*row, flush=True)
    return table(["capture", "vertices", "grid", "lazy_cage, %", "from the rest pose, %", "designed, free, %"], rows)


def write(page, name, text):
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, rest = page.split(begin, 1)
    return before + begin + text + "\n" + end + rest.split(end, 1)[1]


def main():
    arguments = [argument for argument in sys.argv[1:] if argument != "--lazy"]
    folder = arguments[0] if arguments else os.path.join(ROOT, "out", "cages")
    os.makedirs(folder, exist_ok=True)
    tables = {}
    if len(arguments) == len(sys.argv) - 1:
        tables = {"cages": errors(folder), "cage-steps": steps(folder), "cage-unseen": unseen(folder)}
    if LAZY_PYTHON:
        tables["lazy-cages"] = lazy(folder)
    with open(PAGE, encoding="utf-8") as file:
        page = file.read()
    for name, text in tables.items():
        page = write(page, name, text)
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(page)


if __name__ == "__main__":
    main()
