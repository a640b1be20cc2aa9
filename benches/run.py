"""Measures this project beside its peers in one run: writes benches/results.json and the tables of docs/GUIDE.md.

Standard library only. `make bench` builds everything and calls this.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time

import service

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PEERS = os.path.join(ROOT, "benches", ".venv", "bin", "python")
CAGER = os.path.join(ROOT, "target", "release", "cager")
RESULTS = os.path.join(ROOT, "benches", "results.json")
GUIDE = os.path.join(ROOT, "docs", "GUIDE.md")
DATA = os.environ.get("CAGER_CAPTURES", os.path.join(ROOT, "..", "shared", "data"))
CAPTURES = ("samba", "horse-gallop", "makehuman-cmu-walk", "anny-man_soma-02_02")
RUNS = 5


def figures_program():
    """The built benchmark, as cargo names it."""
    command = ["cargo", "bench", "--locked", "--bench", "figures", "--no-run", "--message-format=json"]
    for line in subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines():
        message = json.loads(line)
        if message.get("executable") and message.get("target", {}).get("name") == "figures":
            return message["executable"]
    sys.exit("cargo built no benchmark named figures")


def run_json(command):
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


def peak_bytes(command):
    """Runs a command in a child of its own and returns its peak resident memory and its wall-clock seconds."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        begin = time.perf_counter()
        done = subprocess.run(command, stdout=subprocess.DEVNULL)
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
        os.write(write, json.dumps([done.returncode, peak, time.perf_counter() - begin]).encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        code, peak, seconds = json.loads(pipe.read())
    os.waitpid(child, 0)
    if code:
        sys.exit(f"{' '.join(command)} failed")
    return peak, seconds


def wall(command):
    """Best and median wall-clock seconds of a command."""
    seconds = []
    for _ in range(RUNS + 1):
        begin = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - begin)
    seconds = sorted(seconds[1:])
    return {"best": seconds[0], "median": seconds[RUNS // 2]}


def first_preparation(program):
    """Best and median seconds of a preparation that is the first of its process: new memory, sleeping threads."""
    seconds = sorted(run_json([program, "--growth", "20000", "330"])["seconds"] for _ in range(RUNS))
    return {"best": seconds[0], "median": seconds[RUNS // 2]}


def encode_command(folder, frames, output):
    names = ["--rest", "rest.obj", "--cage", "cage.obj"]
    names = [os.path.join(folder, n) if not n.startswith("--") else n for n in names]
    return [CAGER, "encode", *names, "--frames", os.path.join(folder, frames), "-o", os.path.join(folder, output), "--overwrite"]


def encoding(program, rest, cage, frames, folder):
    """What the default encoding of files takes beside its parts that cannot be left out, and beside the peers."""
    found = run_json([program, "--encoding", rest, cage, frames])
    output = os.path.join(folder, "encoding.cager")
    found["seconds"]["encode"] = wall(
        [CAGER, "encode", "--rest", rest, "--cage", cage, "--frames", frames, "-o", output, "--overwrite"]
    )
    peers = os.path.join(ROOT, "benches", "peers", "peers.py")
    files = [f"--rest={rest}", f"--cage={cage}", f"--frames={frames}"]
    found["peers"] = run_json([PEERS, peers, *files, f"--runs={RUNS}", "--only=mvc,maxvol,maxvol_lapack,svd,pipeline"])["seconds"]
    return found


def encodings(program, folder):
    """Of the built-in capture, and of those at hand: in the cage that is there, or one made around the rest pose."""
    found = {"built in": encoding(program, *(os.path.join(folder, n) for n in ("rest.obj", "cage.obj", "frames.npy")), folder)}
    for name in CAPTURES:
        rest, cage, frames = (os.path.join(DATA, name, n) for n in ("rest.obj", "cage350.obj", "frames.npy"))
        if not os.path.exists(frames):
            continue
        if not os.path.exists(cage):
            cage = os.path.join(folder, "made.obj")
            subprocess.run([CAGER, "cage", "--rest", rest, "--vertices", "350", "-o", cage, "--overwrite", "--quiet"], check=True)
        found[name] = encoding(program, rest, cage, frames, folder)
    return found


def measure():
    program = figures_program()
    with tempfile.TemporaryDirectory() as folder:
        ours = run_json([program, folder])
        ours["seconds"]["prepare_first"] = first_preparation(program)
        arguments = [f"--{n}={os.path.join(folder, n + '.obj')}" for n in ("rest", "cage")]
        arguments.append(f"--frames={os.path.join(folder, 'frames.npy')}")
        peers = run_json([PEERS, os.path.join(ROOT, "benches", "peers", "peers.py"), *arguments, f"--runs={RUNS}"])

        found = encodings(program, folder)
        encode = encode_command(folder, "frames.npy", "capture.cager")
        container = os.path.join(folder, "capture.cager")
        ours["seconds"]["encode"] = wall(encode)
        decode = [CAGER, "decode", container, "-o", os.path.join(folder, "decoded.npy"), "--overwrite"]
        ours["seconds"]["decode_all"] = wall(decode)
        ours["report"] = run_json([CAGER, "inspect", "--json", container])
        for key in ("singular_values", "handle_indices", "sections"):
            ours["report"].pop(key)
        ours["report"]["error"].pop("per_frame")
        ours["service"] = service.measure(CAGER, folder, encode, wall, RUNS)
        few = os.path.join(folder, "few.npy")
        truncate_npy(os.path.join(folder, "frames.npy"), few, 50)
        memory = {
            "encode_50_frames": peak_bytes(encode_command(folder, "few.npy", "few.cager"))[0],
            "encode_499_frames": peak_bytes(encode)[0],
        }
    growth = []
    for points, vertices in [(20_000, 330), (100_000, 330), (1_000_000, 330), (20_000, 1_000), (20_000, 2_000)]:
        command = [program, "--growth", str(points), str(vertices)]
        entry = run_json(command)
        entry["peak_bytes"] = peak_bytes(command)[0]
        growth.append(entry)
    return {"ours": ours, "peers": peers, "memory": memory, "growth": growth, "encodings": found}


def truncate_npy(source, target, frames):
    with open(source, "rb") as file:
        head = file.read(10)
        text = file.read(int.from_bytes(head[8:10], "little")).decode()
        start = text.index("(") + 1
        count, points = (int(x) for x in text[start:].split(",")[:2])
        shorter = text.replace(f"({count}", f"({frames}", 1).rstrip("\n").ljust(len(text) - 1)[: len(text) - 1] + "\n"
        with open(target, "wb") as out:
            out.write(head + shorter.encode() + file.read(frames * points * 12))


def seconds(value):
    for unit, factor in (("s", 1), ("ms", 1e3), ("µs", 1e6)):
        if value * factor >= 1 or unit == "µs":
            return f"{value * factor:.3g} {unit}"
    return ""


def table(results):
    ours, peers = results["ours"]["seconds"], results["peers"]["seconds"]
    o, p = (lambda k: ours[k]["median"]), (lambda *k: nested(peers, k)["median"])
    f = lambda *k: nested(peers, k)["median_per_frame"]
    n, m = results["ours"]["points"], results["ours"]["cage_vertices"]
    voxels, finer = peers["harmonic"], peers["harmonic"]["finer"]
    missed = lambda v: f"{v['voxels']}³, affine error {100 * v['affine_reproduction_error']:.2g} %"
    grid = f"scipy, voxels, {missed(voxels)} ({missed(finer)}: {seconds(finer['median'])})"
    peer_sum = p("mvc") + p("maxvol_lapack") + p("svd")
    rows = [
        (f"mean value coordinates, {n:,} points, {m} vertices", o("mvc"), p("mvc"), "numpy, 2 threads", "0.08 s"),
        (f"Green coordinates, {n:,} points, {m} vertices", o("green"), p("green"), "numpy, 2 threads", "0.15 s"),
        (f"harmonic coordinates, {n:,} points, {m} vertices", o("harmonic"), p("harmonic"), grid, "2 s"),
        ("maxvol to 1.01", o("maxvol"), p("maxvol_lapack"), "the algorithm on OpenBLAS", "0.10 s"),
        (f"SVD {m} × {m}", o("svd"), p("svd"), "LAPACK", "12 ms"),
        ("preparation with maxvol handles", o("prepare"), peer_sum, "the three above", "0.20 s"),
        ("the same, first in its process", o("prepare_first"), peer_sum, "the three above, warm", "0.20 s"),
        ("inversion, per frame", o("invert_batched"), f("invert_batched", "with_gather"), "OpenBLAS, all frames in one product", "20 µs"),
        ("inversion and error, per frame", o("invert_measure"), f("invert_measure", "batched"), "OpenBLAS, f64, batched", "0.3 ms"),
        ("decoding, per frame", o("decode"), f("decode", "batched"), "OpenBLAS, f64, batched", "0.4 ms"),
        (f"`cager encode`, {results['ours']['frames']} frames from .npy", o("encode"), p("pipeline"), "the steps above as a script", "1.0 s"),
    ]
    lines = ["| step | CageR | peer | ratio | target | peer is |", "|---|---|---|---|---|---|"]
    for name, mine, theirs, who, target in rows:
        lines.append(f"| {name} | {seconds(mine)} | {seconds(theirs)} | {theirs / mine:.1f} × | {target} | {who} |")
    found = results["ours"]["coordinates"]
    harmonic = found["harmonic"]
    lines += [
        "",
        f"The affine error is {found['mvc']['affine_error']:.0e} of the diagonal with mean value coordinates, "
        f"{found['green']['affine_error']:.0e} with Green coordinates and {harmonic['affine_error']:.0e} with harmonic ones, which "
        f"come from {harmonic['elements']:,} boundary elements after {harmonic['refinements']} refinements and are off by "
        f"{harmonic['change']:.1e} at most, about. Green coordinates whose normals follow from the vertices take "
        f"{seconds(ours['green_invert_batched']['median'])} per frame to invert.",
    ]
    cages = o("code_cages"), o("read_cages")
    lines += [
        "",
        f"Coding cages alone, in the steps of `--quality preview` and groups of 256 frames, takes {seconds(cages[0])} per frame, reading them back {seconds(cages[1])}: "
        f"{1 / cages[0]:,.0f} and {1 / cages[1]:,.0f} frames/s (target 5,000), by one thread.",
    ]
    lines += encoding_table(results["encodings"])
    lines += ["", "| growth | preparation | peak memory | prepared solver |", "|---|---|---|---|"]
    for g in results["growth"]:
        lines.append(
            f"| {g['points']:,} points, {g['cage_vertices']:,} vertices | {seconds(g['seconds'])} "
            f"| {g['peak_bytes'] / 1e9:.2f} GB | {g['solver_bytes'] / 1e6:.0f} MB |"
        )
    s = {key: value["median"] for key, value in results["ours"]["service"].items()}
    share = 100 * s["encode_local"] / s["encode_fresh"]
    lines += [
        "",
        "| through the service, on loopback | CageR | target |",
        "|---|---|---|",
        f"| `cager encode --server` of the same capture, nothing prepared | {seconds(s['encode_fresh'])}, {share:.0f} % of the rate without the service ({seconds(s['encode_local'])}) | 60 % |",
        f"| the same where the solver is cached | {seconds(s['encode_prepared'])} | – |",
        f"| first cage after the first frame's last byte, idle service | {seconds(s['first_cage'])} | 5 ms |",
        f"| a second session on the same rest pose and cage, ready | {seconds(s['second_session'])} | 5 ms |",
    ]
    memory, report = results["memory"], results["ours"]["report"]
    lines += [
        "",
        f"Encoding 50 frames takes {memory['encode_50_frames'] / 1e6:.0f} MB of memory at its peak, {results['ours']['frames']} frames "
        f"{memory['encode_499_frames'] / 1e6:.0f} MB. The capture of {report['bytes']['capture'] / 1e6:.1f} MB becomes "
        f"{report['bytes']['output'] / 1e6:.2f} MB ({report['bytes']['ratio']:.0f} times smaller) at an L2 error of "
        f"{100 * report['error']['l2_mean']:.3f} % of the diagonal.",
        f"Medians on {results['ours']['threads']} threads; peers: numpy {results['peers']['versions']['numpy']}, "
        f"scipy {results['peers']['versions']['scipy']}, OpenBLAS {results['peers']['versions']['blas']}, in the same run.",
    ]
    return "\n".join(lines)


def encoding_table(encodings):
    lines = [
        "",
        "**With default options** (`spread` handles), as users get it. The limit of `encode` is what its reading of the frames and its two products for each frame take alone, "
        "operator by handles and coordinates by cage; a preparation comes before them.",
        "",
        "| capture | points, cage, frames | preparation | peer: coordinates, maxvol, SVD by LAPACK (maxvol by teneva) | `cager encode` | limit (reading + products) | encode / (preparation + limit) | peer: script |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, found in encodings.items():
        s, p = ({key: value["median"] for key, value in found[k].items()} for k in ("seconds", "peers"))
        common = p["mvc"] + p["svd"]
        limit = s["read"] + s["products"]
        lines.append(
            f"| {name} | {found['points']:,}, {found['cage_vertices']}, {found['frames']} | {seconds(s['prepare'])} "
            f"| {seconds(common + p['maxvol_lapack'])} ({seconds(common + p['maxvol'])}) | {seconds(s['encode'])} "
            f"| {seconds(limit)} ({seconds(s['read'])} + {seconds(s['products'])}) | {s['encode'] / (s['prepare'] + limit):.2f} | {seconds(p['pipeline'])} |"
        )
    return lines


def nested(tree, keys):
    for key in keys:
        tree = tree[key]
    return tree


def put_into_guide(text):
    begin, end = "<!-- figures: begin -->", "<!-- figures: end -->"
    with open(GUIDE, encoding="utf-8") as file:
        guide = file.read()
    head, rest = guide.split(begin)
    _, tail = rest.split(end)
    with open(GUIDE, "w", encoding="utf-8") as file:
        file.write(f"{head}{begin}\n{text}\n{end}{tail}")


if __name__ == "__main__":
    if "--table" in sys.argv:
        with open(RESULTS) as file:
            results = json.load(file)
    else:
        results = measure()
        with open(RESULTS, "w") as file:
            json.dump(results, file, indent=1)
            file.write("\n")
    put_into_guide(table(results))
    print(table(results))
