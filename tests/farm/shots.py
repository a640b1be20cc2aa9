"""Shots encoded as farms would: python shots.py PROGRAM, where openjd-cli and opencue-pyoutline are installed.

Open Job Description's own runner runs its template. Of OpenCue the job specification is made by its library, of Flamenco the tasks by
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
BOUND = 0.002
FRAMES = {1: "0-7", 2: "8-13", 3: "14-19"}


def run(*words, expect=0, **more):
    """What a command said, both streams in one, after a look at its exit status."""
    done = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)
    assert done.returncode == expect, f"{words} ended with {done.returncode}:\n{done.stdout}"
    return done.stdout


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
                run(program, "decode", demo / "capture.cager", "--range", frames, "-o", place / "frames.npy")
        shutil.copy(demo / "cage.obj", self.captures)

    def openjd(self, *more, expect=0, **parameters):
        """Runs the template in Open Job Description's runner."""
        given = {"Captures": self.captures, "Shots": "1-3", "Cage": "../cage.obj", "MaxError": BOUND, "Output": self.output,
                 "Program": self.program} | parameters
        words = [word for key, value in given.items() for word in ("-p", f"{key}={value}")]
        return run(pathlib.Path(sys.executable).parent / "openjd", "run", TEMPLATE, *words, *more, expect=expect)

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


def opencue_lines_encode_every_shot(studio):
    sys.path.insert(0, str(FARM))
    import opencue_shots

    words = [studio.captures, studio.output, "--shots", "1-3", "--cage", "../cage.obj", "--max-error", BOUND,
             "--program", studio.program]
    spec = opencue_shots.launcher(opencue_shots.parse([str(word) for word in words])).serialize(use_pycuerun=False)
    layer, = tree.fromstring(spec).iter("layer")
    assert (layer.findtext("range"), layer.findtext("chunk")) == ("1-3", "1"), spec
    studio.output.mkdir()
    for shot in FRAMES:
        # As Cuebot does, and RQD's shell.
        line = layer.findtext("cmd").replace("#ZFRAME#", f"{shot:04}").replace("#IFRAME#", str(shot))
        for _ in range(2):
            run("sh", "-c", line)
    studio.check(digits=4)


def flamenco_tasks_encode_every_shot(studio):
    node = shutil.which("node")
    if not node:
        return "Node is not here, so Flamenco's job type is not compiled"
    settings = {"captures": str(studio.captures), "output": str(studio.output), "shots": "1-2,3", "cage": "../cage.obj",
                "max_error": BOUND}

    def compiled(expect=0, **more):
        given = studio.folder / "settings.json"
        given.write_text(json.dumps(settings | more))
        return run(node, HERE / "compile.js", FARM / "cager_encode_shots.js", given, expect=expect)

    studio.output.mkdir()
    tasks = json.loads(compiled())
    assert [task["name"] for task in tasks] == ["encode-sh001", "encode-sh002", "encode-sh003"], tasks
    for command in (command for task in tasks for command in task["commands"]):
        assert command["name"] == "exec" and command["parameters"]["exe"] == "{cager}", command
        run(studio.program, *command["parameters"]["args"])
    studio.check()
    assert "is the same for all shots" in compiled(shot_name="shot", expect=1)
    assert "captures: is missing" in compiled(captures="", expect=1)
    assert "--server" in compiled(server="http://127.0.0.1:8080")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    program = pathlib.Path(parser.parse_args().program).resolve()
    tests = [openjd_encodes_every_shot, openjd_replaces_or_skips_shots_that_are_there, openjd_shows_why_a_shot_failed,
             openjd_designs_cages_where_none_is_given, openjd_sends_shots_to_a_service, opencue_lines_encode_every_shot,
             flamenco_tasks_encode_every_shot]
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
