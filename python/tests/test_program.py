"""The module and the program write the same files, and the example of the README runs."""

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cager

PROGRAM = os.environ.get("CAGER_BINARY")


def write_obj(path, points, faces):
    lines = ["v " + " ".join(repr(float(x)) for x in point) for point in points]
    lines += ["f " + " ".join(str(vertex + 1) for vertex in face) for face in faces]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.skipif(not PROGRAM, reason="CAGER_BINARY names no program")
@pytest.mark.parametrize(
    "cage, options, arguments",
    [
        (True, {}, []),
        (True, {"max_error": 1e-3}, ["--max-error", "1e-3"]),
        (True, {"mean_error": 2e-3}, ["--mean-error", "2e-3"]),
        (True, {"coordinates": "green", "frame_rate": 25}, ["--coordinates", "green", "--fps", "25"]),
        (False, {"max_error": 1e-3, "vertices": 30, "seed": 4}, ["--max-error", "1e-3", "--cage-vertices", "30", "--seed", "4"]),
    ],
)
def test_the_program_writes_the_same_bytes(small, tmp_path, cage, options, arguments):
    write_obj(tmp_path / "rest.obj", small.rest, small.faces)
    write_obj(tmp_path / "cage.obj", *small.cage)
    np.save(tmp_path / "frames.npy", small.frames)
    arguments = [*(["--cage", "cage.obj"] if cage else []), *arguments]
    subprocess.run(
        [PROGRAM, "encode", "--rest", "rest.obj", "--frames", "frames.npy", "-o", "program.cager", *arguments],
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    capture = cager.encode(small.rest, small.faces, small.frames, small.cage if cage else None, **options)
    capture.save(tmp_path / "module.cager")
    assert (tmp_path / "module.cager").read_bytes() == (tmp_path / "program.cager").read_bytes()
    subprocess.run([PROGRAM, "decode", "module.cager", "-o", "out.npy"], cwd=tmp_path, check=True, capture_output=True)
    assert np.array_equal(np.load(tmp_path / "out.npy"), capture.decode())


def test_the_example_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    readme = Path(__file__).parents[1] / "README.md"
    example = re.findall(r"```python\n(.*?)```", readme.read_text(), re.S)[0]
    exec(compile(example, str(readme), "exec"), {})
    assert capsys.readouterr().out.startswith("12 (500, 3) (12, ")
