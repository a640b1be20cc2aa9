"""Runs `cager compare` on the real captures and writes the tables of docs/PAPER.md.

Standard library only. `make paper` builds the program and calls this. The captures are not part of the project: they are looked for
in CAGER_CAPTURES (default ../shared/data). Reports and figures stay in the folder given as argument (default out/paper).
"""

import json
import os
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DATA = os.environ.get("CAGER_CAPTURES", os.path.join(ROOT, "..", "shared", "data"))
TARGET = os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target"))
CAGER = os.path.join(TARGET, "release", "cager")
PAGE = os.path.join(ROOT, "docs", "PAPER.md")
# Folder and cage of each capture, and the systems: free normals of the largest cage are 3,173 unknowns, hours of swaps and draws.
CAPTURES = [
    ("horse-gallop", "cage350", "all"),
    ("samba", "cage350", "all"),
    ("supercages-arm", "cage350", "all"),
    ("supercages-arm", "cage", "all"),
    ("makehuman-cmu-walk", "cage350", "all"),
    ("makehuman-cmu-walk", "cage", "mvc,harmonic,green"),
]
ALL, MAXVOL = ("all", "none", 0), ("maxvol", "none", 0)
# Columns of the error table: title, handles, regularizer, threshold (None: the usual one).
METHODS = [
    ("all points", "all", "none", 0),
    ("all, global", "all", "global", 0),
    ("maxvol", "maxvol", "none", 0),
    ("maxvol, usual s", "maxvol", "laplacian", None),
    ("maxvol, global", "maxvol", "global", 0),
    ("maxvol, truncated", "maxvol", "truncated-svd", None),
    ("rectangular, usual s", "rectangular", "laplacian", None),
    ("spread, usual s", "spread", "laplacian", None),
    ("spread", "spread", "none", 0),
]


def compare(folder, capture, cage, systems):
    """Figures of one capture; makes them unless they are there."""
    name = f"{capture}-{cage}"
    figures, report = (os.path.join(folder, name + ending) for ending in (".json", ".html"))
    if not os.path.exists(figures):
        at = os.path.join(DATA, capture)
        command = [CAGER, "compare", "--rest", f"{at}/rest.obj", "--cage", f"{at}/{cage}.obj", "--frames", f"{at}/frames.npy"]
        command += [] if systems == "all" else ["--coordinates", systems]
        subprocess.run(command + ["-o", report, "--json", figures, "--overwrite"], check=True)
    with open(figures, encoding="utf-8") as file:
        return json.load(file)


def percent(x, digits):
    return "–" if x is None else f"{100 * x:.{digits}f}"


def number(x, digits=1):
    return "–" if x is None else (f"{x:,.{digits}f}" if abs(x) < 1e6 else f"{x:.1e}")


def table(headers, rows):
    lines = ["| " + " | ".join(headers) + " |", "|" + "---|" * len(headers)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


class Run:
    """A coordinate system on a capture."""

    def __init__(self, capture, cage, figures, system):
        self.capture, self.cage, self.all, self.system = capture, cage, figures["capture"], system["name"]
        self.found, self.refused = system["figures"], system["refused"]
        self.claims = [c for c in figures["claims"] if c["system"] == self.system]

    def where(self):
        return [self.capture, f"`{self.cage}`", self.system]

    def method(self, handles, regularizer, s):
        """The method; without a threshold, with the one that the program chooses."""
        for m in self.found["methods"]:
            if m["handles"] == handles and m["regularizer"] == regularizer:
                if m["spectrum"] == (s if s is not None else self.usual()):
                    return m
        return None

    def usual(self):
        return min(20, self.found["unknowns"] // 16)

    def total(self, method, key):
        found = self.method(*method)
        return found["totals"][key] if found else None


def times(runs):
    paper = [
        ["the paper, Fig. 14: 1st row (capoeira)", "–", "mvc", "19,998", "330 / 656", "499", "–", "5,616 ms", "568 ms", "0.12", "–"],
        ["the paper, 2nd row", "–", "mvc", "19,998", "330 / 656", "179", "–", "5,616 ms", "568 ms", "–", "–"],
        ["the paper, 3rd row (skirt)", "–", "mvc", "19,990", "368 / 732", "437", "–", "7,291 ms", "890 ms", "–", "–"],
        ["the paper, 4th row", "–", "mvc", "15,002", "339 / 674", "169", "–", "5,617 ms", "624 ms", "–", "–"],
        ["the paper, 5th row (horse)", "–", "mvc", "8,431", "348 / 692", "48", "–", "5,029 ms", "748 ms", "0.19", "–"],
    ]
    rows = []
    for run in runs:
        s, usual = run.found["seconds"], ("maxvol", "laplacian", None)
        rows.append(run.where() + [
            f"{run.all['points']:,}", f"{run.all['cage_vertices']} / {run.all['cage_faces']}", str(run.all["frames"]),
            f"{1e3 * s['coordinates']:.0f} ms", f"{1e3 * (s['maxvol'] + s['svd']):.0f} ms", f"{1e3 * s['per_frame']:.3f} ms",
            percent(run.total(usual, "l2_mean"), 3), percent(run.total(usual, "linf_mean"), 2),
        ])
    headers = ["capture", "cage", "system", "points", "#V / #T", "frames", "coordinates", "maxvol + SVD", "one frame", "mean L2 %", "mean L∞ %"]
    return table(headers, paper + rows)


def errors(runs):
    rows = []
    for run in runs:
        found = [run.total((handles, regularizer, s), "l2_mean") for _, handles, regularizer, s in METHODS]
        # Ratios say nothing where least squares itself is lost to rounding.
        least = found[0] if found[0] < 2 * min(l2 for l2 in found if l2 is not None) else None
        cells = [percent(l2, 3) + (f" ({l2 / least:.2f})" if l2 is not None and least else "") for l2 in found]
        rows.append(run.where() + cells)
    return table(["capture", "cage", "system"] + [title for title, *_ in METHODS], rows)


def spectra(runs):
    rows = []
    for run in runs:
        s = run.found["spectra"]
        rows.append(run.where() + [
            f"{run.found['rank']} of {run.found['unknowns']}", number(s["condition_handles"]), number(s["condition_full"]),
            number(s["condition_normal"], 0), f"{s['handles'][-1] / s['handles'][0]:.2e}", f"{s['full'][-1] / s['full'][0]:.2e}",
        ])
    headers = ["capture", "cage", "system", "rank", "condition of Φ□", "of Φ", "of ΦᵀΦ", "last over first σ of Φ□", "of Φ"]
    return table(headers, rows)


def swaps(runs):
    rows = []
    for run in runs:
        cells = []
        for key in ("from_lu", "from_random"):
            trace = run.found["swaps"][key]
            if trace is None:
                cells += ["–"] * 3
                continue
            v, c = trace["log_volume"], trace["condition"]
            cells += [str(len(v) - 1), f"{v[0]:.1f} → {v[-1]:.1f}", f"{number(c[0])} → {number(c[-1])}"]
        rows.append(run.where() + cells)
    headers = ["capture", "cage", "system", "swaps from LU", "ln volume", "condition", "swaps from drawn points", "ln volume", "condition"]
    return table(headers, rows)


def draws(runs):
    rows = []
    for run in runs:
        drawn = sorted((d for d in run.found["random"] if d["choice"].startswith("random")), key=lambda d: d["totals"]["l2_mean"])
        ranks = [d["rank"] for d in drawn]
        l2 = [d["totals"]["l2_mean"] for d in drawn]
        rows.append(run.where() + [
            f"{min(ranks)}–{max(ranks)} of {run.found['unknowns']}", percent(l2[0], 2), percent(l2[len(l2) // 2], 2), percent(l2[-1], 2),
            percent(run.total(("maxvol", "laplacian", None), "l2_mean"), 3),
        ])
    headers = ["capture", "cage", "system", "rank of ten draws", "best mean L2 %", "median %", "worst %", "maxvol %"]
    return table(headers, rows)


# Columns of the stability table: title, handles, regularizer, threshold.
STABILITY = [
    ("all", "all", "none", 0),
    ("all, global", "all", "global", 0),
    ("maxvol", "maxvol", "none", 0),
    *[(f"maxvol, s = {s}", "maxvol", "laplacian", s) for s in (5, 20, 50, 100)],
    ("maxvol, global", "maxvol", "global", 0),
    ("spread, usual s", "spread", "laplacian", None),
]


def spikes(runs):
    rows = []
    for run in runs:
        cells = []
        for _, *method in STABILITY:
            total = lambda key: run.total(tuple(method), key)
            cell = f"{percent(total('spike_mean'), 3)} / {percent(total('spike_max'), 1)} / {percent(total('edges_mean'), 1)}"
            cells.append(cell if total("l2_mean") is not None else "–")
        rows.append(run.where() + cells + [f"{percent(run.all['motion_mean'], 3)} / {percent(run.all['motion_max'], 1)}"])
    return table(["capture", "cage", "system"] + [title for title, *_ in STABILITY] + ["the model itself"], rows)


def handles(runs):
    """Every system with every choice of points, and what lies between `spread` and all points."""
    rows = []
    for run in runs:
        l2 = [run.total((h, "laplacian", None), "l2_mean") for h in ("maxvol", "rectangular", "spread", "all")]
        over = "–" if None in l2 else f"{100 * (l2[2] / l2[3] - 1):+.1f} %"
        rows.append(run.where() + [percent(x, 3) for x in l2] + [over])
    return table(["capture", "cage", "system", "maxvol", "rectangular", "spread", "all", "spread above all"], rows)


def green(runs):
    """Normals that follow from the vertices against free ones."""
    rows = []
    for run in runs:
        free = [r for r in runs if (r.capture, r.cage, r.system) == (run.capture, run.cage, "green-free")]
        if run.system != "green" or not free:
            continue
        usual, cells = ("maxvol", "laplacian", None), []
        for key, digits in (("l2_mean", 3), ("spike_mean", 3), ("spike_max", 1), ("edges_mean", 1)):
            a, b = free[0].total(usual, key), run.total(usual, key)
            cells.append(f"{percent(a, digits)} → {percent(b, digits)}" + (f" (÷ {a / b:.1f})" if key != "l2_mean" else ""))
        rows.append(run.where()[:2] + cells)
    headers = ["capture", "cage", "mean L2 %, free → consistent", "mean second difference %", "largest %", "change of edges %"]
    return table(headers, rows)


def noise(runs):
    rows = []
    for run in runs:
        for n in run.found["noise"]:
            if (n["handles"], n["regularizer"]) not in (("all", "none"), ("maxvol", "laplacian"), ("spread", "laplacian")):
                continue
            clean = run.method(n["handles"], n["regularizer"], n["spectrum"])
            rows.append(run.where() + [
                n["handles"], f"{percent(clean['totals']['linf_max'], 3)} → {percent(n['totals']['linf_max'], 3)}",
                percent(n["totals"]["linf_max"] - clean["totals"]["linf_max"], 3),
                f"{percent(clean['totals']['l2_mean'], 3)} → {percent(n['totals']['l2_mean'], 3)}", percent(n["clean_l2_mean"], 3),
            ])
    headers = ["capture", "cage", "system", "handles", "largest L∞ %, clean → noisy", "rise", "mean L2 %, clean → noisy", "noisy cage against clean capture"]
    return table(headers, rows)


def vectors(runs):
    rows = []
    for run in runs:
        v = run.found["vectors"]
        rows.append(run.where() + [str(run.found["unknowns"]), number(v["spread_first"]), number(v["spread_last"])])
    return table(["capture", "cage", "system", "unknowns", "first tenth lives on", "last tenth lives on"], rows)


def claims(runs):
    """Of every claim, on how many captures it holds with each system, and where it does not."""
    words = {"in-part": "in part", "fails": "**not**"}
    order, systems = [], []
    for run in runs:
        systems += [run.system] if run.system not in systems else []
        for claim in run.claims:
            key = (claim["statement"], claim["source"])
            order += [key] if key not in order else []
    rows = []
    for key in order:
        row = [key[0], key[1]]
        for system in systems:
            found = [(run, c["verdict"]) for run in runs if run.system == system for c in run.claims if (c["statement"], c["source"]) == key]
            holds = sum(verdict == "holds" for _, verdict in found)
            parts = [f"{holds} of {len(found)}"] if found else ["–"]
            for verdict, word in words.items():
                where = [f"{run.capture} `{run.cage}`" for run, v in found if v == verdict]
                parts += [f"{word}: {', '.join(where)}"] if where else []
            row.append("; ".join(parts))
        rows.append(row)
    return table(["claim", "where"] + systems, rows)


def refused(runs):
    rows = [run.where() + [run.refused] for run in runs]
    return table(["capture", "cage", "system", "why not"], rows) if rows else "All systems could be computed for all cages."


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "out", "paper")
    os.makedirs(folder, exist_ok=True)
    every = []
    for capture, cage, systems in CAPTURES:
        figures = compare(folder, capture, cage, systems)
        every += [Run(capture, cage, figures, system) for system in figures["systems"]]
    runs = [run for run in every if run.found]
    usual = [run for run in runs if run.system == "mvc"]
    tables = {
        "times": times(runs), "errors": errors(runs), "spectra": spectra(runs), "swaps": swaps(runs), "draws": draws(usual),
        "handles": handles(runs), "green": green(runs), "spikes": spikes(runs), "noise": noise(runs), "vectors": vectors(runs), "claims": claims(runs),
        "refused": refused([run for run in every if not run.found]),
    }
    with open(PAGE, encoding="utf-8") as file:
        page = file.read()
    for name, text in tables.items():
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        before, rest = page.split(begin)
        _, after = rest.split(end)
        page = f"{before}{begin}\n{text}\n{end}{after}"
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(page)


if __name__ == "__main__":
    main()
