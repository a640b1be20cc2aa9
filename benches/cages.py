"""Makes and designs cages for the real captures and writes their tables in docs/PAPER.md.

Standard library only. `make cages` builds the program and calls this. The captures are not part of the project: they are looked for
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


def write(page, name, text):
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, rest = page.split(begin, 1)
    return before + begin + text + "\n" + end + rest.split(end, 1)[1]


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "out", "cages")
    os.makedirs(folder, exist_ok=True)
    tables = {"cages": errors(folder), "cage-steps": steps(folder), "cage-unseen": unseen(folder)}
    with open(PAGE, encoding="utf-8") as file:
        page = file.read()
    for name, text in tables.items():
        page = write(page, name, text)
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(page)


if __name__ == "__main__":
    main()
