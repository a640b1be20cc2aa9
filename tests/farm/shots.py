"""Shots encoded and decoded as farms would: python shots.py PROGRAM, where openjd-cli and opencue-pyoutline are installed.

Open Job Description's own runner runs its templates. Of OpenCue the job specification is made by its library, of Flamenco the tasks by
a stand-in for its job compiler where Node is, and their command lines are run here; no Cuebot, RQD or Flamenco is.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as tree

HERE = pathlib.Path(__file__).resolve().parent
FARM = HERE.parent.parent / "deploy" / "farm"
TEMPLATE = FARM / "encode-shots.openjd.yaml"
DECODE_TEMPLATE = FARM / "decode-shots.openjd.yaml"
BOUND = 0.002
FRAMES = {1: "0-7", 2: "8-13", 3: "14-19"}


def run(*words, expect=0, **more):
    """What a command said, both streams in one, after a look at its exit status."""
    done = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    assert done.returncode == expect, f"{words} ended with {done.returncode}:\n{done.stdout}"
    return done.stdout


def run_template(template, parameters, *more, expect=0):
    """Runs a template in Open Job Description's runner."""
    words = [word for key, value in parameters.items() for word in ("-p", f"{key}={value}")]
    return run(pathlib.Path(sys.executable).parent / "openjd", "run", template, *words, *more, expect=expect)


class Studio:
    """A folder `captures` with three shots, and what farms do with them."""

    def __init__(self, folder, program):
        self.folder, self.program = folder, program
        demo = folder / "demo"
        run(program, "demo", "-o", demo, "--points", 600, "--frames", 20, "--cage-vertices", 60)
        # A blank, since names that artists give have them.
        self.captures, self.output = folder / "the captures", folder / "out"
        for shot, frames in FRAMES.items():
            for name in (f"sh{shot:03}", f"sh{shot:04}"):
                place = self.captures / name
                place.mkdir(parents=True)
                shutil.copy(demo / "rest.obj", place)
                for capture in ("frames.npy", "hero.usdc"):
                    run(program, "decode", demo / "capture.cager", "--range", frames, "-o", place / capture)
        shutil.copy(demo / "cage.obj", self.captures)

    def openjd(self, *more, expect=0, **parameters):
        """Runs the template that encodes in Open Job Description's runner."""
        given = {"Captures": self.captures, "Shots": "1-3", "Cage": "../cage.obj", "MaxError": BOUND, "Output": self.output,
                 "Program": self.program} | parameters
        return run_template(TEMPLATE, given, *more, expect=expect)

    def openjd_decode(self, *more, expect=0, **parameters):
        """Runs the template that decodes what the other one has written."""
        given = {"Containers": self.output, "Shots": "1-3", "Output": self.folder / "decoded", "Program": self.program}
        return run_template(DECODE_TEMPLATE, given | parameters, *more, expect=expect)

    def decoded(self):
        """The decoded shots, which are taken away."""
        place = self.folder / "decoded"
        found = sorted(str(path.relative_to(place)) for path in place.rglob("*") if path.is_file())
        shutil.rmtree(place)
        return found

    def written(self):
        """Names and identities of the output's files: one that is replaced is another file."""
        return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in self.output.iterdir()}

    def check(self, shots=(1, 2, 3), digits=3):
        """That these shots lie in the output, whole and within the bound, and nothing else."""
        names = {f"sh{shot:0{digits}}" for shot in shots}
        assert set(os.listdir(self.output)) == {name + end for name in names for end in (".cager", ".json")}, os.listdir(self.output)
        for shot in shots:
            name = f"sh{shot:0{digits}}"
            inside = json.loads(run(self.program, "inspect", "--json", self.output / f"{name}.cager"))
            first, last = map(int, FRAMES[shot].split("-"))
            assert inside["frames"] == last - first + 1, inside["frames"]
            report = json.loads((self.output / f"{name}.json").read_text())
            assert 0 < report["error"]["linf_max"] <= BOUND, report["error"]

    def clear(self):
        shutil.rmtree(self.output, ignore_errors=True)


def openjd_encodes_every_shot(studio):
    run(pathlib.Path(sys.executable).parent / "openjd", "check", TEMPLATE)
    said = studio.openjd()
    assert "sh001" in said and "sh003" in said, said
    studio.check()


def openjd_replaces_or_skips_shots_that_are_there(studio):
    studio.openjd()
    first = studio.written()
    (studio.output / "sh002.cager").unlink()
    said = studio.openjd(Existing="skip")
    after = studio.written()
    assert said.count("is there already; skipped") == 2, said
    assert {name for name in first if after[name] != first[name]} == {"sh002.cager", "sh002.json"}, (first, after)
    before = {name: (studio.output / name).read_bytes() for name in first if name.endswith(".cager")}
    studio.openjd()
    again = studio.written()
    assert all(again[name] != after[name] for name in after), (after, again)
    assert all((studio.output / name).read_bytes() == content for name, content in before.items())
    studio.check()


def openjd_shows_why_a_shot_failed(studio):
    frames = studio.captures / "sh002" / "frames.npy"
    kept = frames.read_bytes()
    frames.write_bytes(kept[:-100])
    try:
        studio.openjd("--task-param", "Shot=1")
        said = studio.openjd("--task-param", "Shot=2", expect=1)
        studio.openjd("--task-param", "Shot=3")
    finally:
        frames.write_bytes(kept)
    assert "cager: " in said and "sh002/frames.npy" in said and "exited with code: 1 " in said, said
    # Nothing of the one that failed, no temporary either.
    studio.check(shots=(1, 3))
    said = studio.openjd("--task-param", "Shot=2", ShotName="shot", expect=1)
    assert "ShotName: shot is the same for all shots" in said and "exited with code: 2 " in said, said


def openjd_designs_cages_where_none_is_given(studio):
    studio.openjd("--task-param", "Shot=1", Cage="")
    studio.check(shots=(1,))


def openjd_sends_shots_to_a_service(studio):
    studio.openjd()
    here = (studio.output / "sh001.cager").read_bytes()
    studio.clear()
    service = subprocess.Popen(
        [studio.program, "serve", "--listen", "127.0.0.1:0", "--log-filter", "warn", "--data", studio.folder / "data"],
        stdout=subprocess.PIPE, text=True)
    try:
        place = service.stdout.readline().removeprefix("listening on ").strip()
        said = studio.openjd(Server=f"http://{place}")
        assert "session" in said, said
        studio.check()
        assert (studio.output / "sh001.cager").read_bytes() == here, "a service gives the same file"
    finally:
        service.terminate()
        service.wait()
    said = studio.openjd("--task-param", "Shot=1", Server=f"http://{place}", expect=1)
    assert "cager: " in said and place in said, said


def openjd_takes_meshes_units_and_rates(studio):
    studio.openjd("--task-param", "Shot=1", Unit="cm")
    inside = json.loads(run(studio.program, "inspect", "--json", studio.output / "sh001.cager"))
    assert inside["metres_per_unit"] == 0.01, inside
    # Which it is not, and so the program has been told.
    said = studio.openjd("--task-param", "Shot=1", Up="y", expect=1)
    assert "leave out --up" in said, said
    studio.openjd("--task-param", "Shot=1", Rest="hero.usdc", Frames="hero.usdc", Prim="/hero/nobody*, hero")
    studio.check(shots=(1,))
    said = studio.openjd("--task-param", "Shot=1", SampleRate="x", expect=1)
    assert "SampleRate" in said, said


def openjd_decodes_every_shot(studio):
    run(pathlib.Path(sys.executable).parent / "openjd", "check", DECODE_TEMPLATE)
    studio.openjd(Rest="hero.usdc", Frames="hero.usdc")
    said = studio.openjd_decode()
    assert studio.openjd_decode(Existing="skip").count("is there already; skipped") == 3, said
    assert studio.decoded() == ["sh001.usdc", "sh002.usdc", "sh003.usdc"]
    studio.openjd_decode("--task-param", "Shot=2", Format="obj", Part="h*, *o")
    assert studio.decoded() == [f"sh002/frame_{frame:04}.obj" for frame in range(8, 14)]
    # A layer has the points alone.
    studio.openjd_decode("--task-param", "Shot=3", Onto="hero.usdc", Captures=studio.captures)
    assert studio.decoded() == ["sh003.usdc"]
    assert "Onto: hero.usdc lies in" in studio.openjd_decode("--task-param", "Shot=3", Onto="hero.usdc", expect=1)
    said = studio.openjd_decode("--task-param", "Shot=3", Part="nobody", expect=1)
    assert "has no part nobody" in said, said


def opencue_lines_encode_every_shot(studio):
    sys.path.insert(0, str(FARM))
    import opencue_shots

    words = [studio.captures, studio.output, "--shots", "1-3", "--cage", "../cage.obj", "--max-error", BOUND,
             "--program", studio.program]
    args = opencue_shots.parse([str(word) for word in words + ["--unit", "cm"]])
    studio.output.mkdir()
    for _ in range(2):
        run_frames(opencue_shots.launcher(args, "encode", opencue_shots.encode_line(args)))
    studio.check(digits=4)
    words = ["a", "b", "--shots", "1", "--prim", "eye*", "--prim", "left hand", "--sample-rate", "24"]
    many = opencue_shots.encode_line(opencue_shots.parse(words))
    assert "--prim 'eye*' --prim 'left hand'" in many and "--sample-rate 24.0" in many, many


def opencue_lines_decode_every_shot(studio):
    sys.path.insert(0, str(FARM))
    import opencue_decode

    studio.openjd(ShotName="sh%04d", Rest="hero.usdc", Frames="hero.usdc")
    decoded = studio.folder / "decoded"
    folder = [f"/frame_{frame:04}.ply" for frame in range(8)]
    for more, expected in [(["--part", "her*"], [".usdc"]), (["--format", "ply"], folder)]:
        decoded.mkdir(exist_ok=True)
        words = [studio.output, decoded, "--shots", "1-3", "--program", studio.program, *more]
        args = opencue_decode.parse([str(word) for word in words])
        run_frames(opencue_decode.launcher(args, "decode", opencue_decode.decode_line(args)))
        assert [name for name in studio.decoded() if name.startswith("sh0001")] == [f"sh0001{end}" for end in expected]


def run_frames(job):
    """Runs the frames of a job as Cuebot does, and RQD's shell."""
    spec = job.serialize(use_pycuerun=False)
    layer, = tree.fromstring(spec).iter("layer")
    assert (layer.findtext("range"), layer.findtext("chunk")) == ("1-3", "1"), spec
    for shot in FRAMES:
        run("sh", "-c", layer.findtext("cmd").replace("#ZFRAME#", f"{shot:04}").replace("#IFRAME#", str(shot)))


def flamenco_tasks_encode_and_decode_every_shot(studio):
    node = shutil.which("node")
    if not node:
        return "Node is not here, so Flamenco's job types are not compiled"
    settings = {"captures": str(studio.captures), "output": str(studio.output), "shots": "1-2,3", "cage": "../cage.obj",
                "max_error": BOUND}

    def compiled(expect=0, verb="encode", **more):
        given = studio.folder / "settings.json"
        given.write_text(json.dumps(settings | more))
        return run(node, HERE / "compile.js", FARM / f"cager_{verb}_shots.js", given, expect=expect)

    def done(verb, **more):
        tasks = json.loads(compiled(verb=verb, **more))
        assert [task["name"] for task in tasks] == [f"{verb}-sh001", f"{verb}-sh002", f"{verb}-sh003"], tasks
        for command in (command for task in tasks for command in task["commands"]):
            assert command["name"] == "exec" and command["parameters"]["exe"] == "{cager}", command
            run(studio.program, *command["parameters"]["args"])

    studio.output.mkdir()
    done("encode", rest="hero.usdc", frames="hero.usdc", prim="hero, nobody*")
    studio.check()
    decoded = studio.folder / "decoded"
    decoded.mkdir(exist_ok=True)
    done("decode", containers=str(studio.output), output=str(decoded), part="h*", onto="hero.usdc")
    assert studio.decoded() == ["sh001.usdc", "sh002.usdc", "sh003.usdc"]
    assert "onto: lies in" in compiled(verb="decode", containers="/c", captures="", onto="hero.usdc", expect=1)
    options = json.loads(compiled(up="z", unit="cm", sample_rate=24))[0]["commands"][0]["parameters"]["args"]
    assert " ".join(["--up", "z", "--unit", "cm", "--sample-rate", "24"]) in " ".join(options), options
    assert "is the same for all shots" in compiled(shot_name="shot", expect=1)
    assert "captures: is missing" in compiled(captures="", expect=1)
    assert "--server" in compiled(server="http://127.0.0.1:8080")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    program = pathlib.Path(parser.parse_args().program).resolve()
    tests = [openjd_encodes_every_shot, openjd_replaces_or_skips_shots_that_are_there, openjd_shows_why_a_shot_failed,
             openjd_designs_cages_where_none_is_given, openjd_takes_meshes_units_and_rates, openjd_decodes_every_shot,
             openjd_sends_shots_to_a_service, opencue_lines_encode_every_shot, opencue_lines_decode_every_shot,
             flamenco_tasks_encode_and_decode_every_shot]
    with tempfile.TemporaryDirectory() as folder:
        # Where OpenCue's library keeps its sessions.
        os.environ["HOME"] = folder
        studio = Studio(pathlib.Path(folder), program)
        for test in tests:
            studio.clear()
            left_out = test(studio)
            print(f"{test.__name__}: {left_out or 'ok'}", flush=True)


if __name__ == "__main__":
    main()
