"""Unit, upward axis and frame numbers are kept, as the command line keeps them, and positions are brought to others."""

import json
import os
import subprocess

import numpy as np
import pytest

import cager
from test_program import write_obj

PROGRAM = os.environ.get("CAGER_BINARY")
NUMBERS = [1001, 1001.5, 1002, 1004, 1005, 1006, 1007, 1008, 1009, 1010.25]


def encoded(small, **options):
    return cager.encode(small.rest, small.faces, small.frames, small.cage, **options)


def test_what_is_said_is_kept(small, tmp_path):
    capture = encoded(small, unit="cm", up="z", times=NUMBERS, frame_rate=24)
    capture.save(tmp_path / "said.cager")
    again = cager.open(tmp_path / "said.cager")
    assert (again.unit, again.up, again.times.tolist()) == (0.01, "z", NUMBERS)
    assert again.report["metres_per_unit"] == 0.01 and again.report["frame_numbers"] == NUMBERS
    assert np.array_equal(again.decode(), encoded(small).decode())
    assert encoded(small, start=-3, unit=1.0).times.tolist() == list(range(-3, 7))
    nothing = encoded(small)
    assert (nothing.unit, nothing.up, nothing.times.tolist()) == (None, None, list(range(10)))


@pytest.mark.parametrize(
    "options, words",
    [
        ({"unit": "km"}, 'unit: is km; give one of "mm"'),
        ({"unit": 0}, "unit: is 0; give one of"),
        ({"unit": float("nan")}, "or the length of 1 in metres"),
        ({"up": "x"}, 'up: there is no axis "x"; give "y" or "z"'),
        ({"start": float("inf")}, "start: is inf; give the number of the first frame"),
        ({"start": 1, "times": NUMBERS}, "leave one of them out"),
        ({"times": NUMBERS[:9]}, "times: has 9 numbers where there are 10 frames"),
        ({"times": sorted(NUMBERS, reverse=True)}, "give them in ascending order"),
        ({"times": [1.0] * 10}, "give them in ascending order"),
        ({"times": [*NUMBERS[:9], float("nan")]}, "times: number 9 is NaN"),
        ({"times": [NUMBERS]}, "times: has the shape 1 × 10; give a list of numbers"),
    ],
)
def test_what_cannot_be_meant_is_refused(small, options, words):
    with pytest.raises(cager.CagerError) as refused:
        encoded(small, **options)
    assert words in str(refused.value)


def test_positions_are_turned_and_scaled(small, tmp_path):
    capture = encoded(small, unit="cm", up="z")
    capture.export(tmp_path / "own.npy")
    capture.export(tmp_path / "y.npy", up="y", unit="m")
    x, y, z = np.moveaxis(np.load(tmp_path / "own.npy"), 2, 0)
    assert np.allclose(np.load(tmp_path / "y.npy"), 0.01 * np.stack([x, z, -y], axis=2), atol=1e-9)
    (note,) = capture.export(tmp_path / "z.abc")
    assert "lay the model on its back (up=\"y\" turns it)" in note
    assert capture.export(tmp_path / "y.abc", up="y") == []
    with pytest.raises(cager.CagerError, match="does not say which axis points up in it, so that up cannot turn"):
        encoded(small).export(tmp_path / "none.npy", up="y")


def test_a_capture_far_away_is_scaled_about_its_origin(small, tmp_path):
    far = np.array([691_234.0, 5_334_987.0, 512.0])
    vertices, faces = small.cage
    capture = cager.encode(small.rest + far, small.faces, small.frames + far, (vertices + far, faces), unit="m", up="y")
    capture.export(tmp_path / "z.npy", up="z", unit="cm")
    x, y, z = np.moveaxis(capture.decode(), 2, 0)
    assert np.abs(np.load(tmp_path / "z.npy") - 100 * np.stack([x, -z, y], axis=2)).max() <= 1e-6 * 100 * small.diagonal


@pytest.mark.skipif(not PROGRAM, reason="CAGER_BINARY names no program")
def test_the_program_writes_and_reads_the_same(small, tmp_path):
    def run(*arguments):
        return subprocess.run([PROGRAM, *arguments], cwd=tmp_path, check=True, capture_output=True, text=True).stdout

    write_obj(tmp_path / "rest.obj", small.rest, small.faces)
    write_obj(tmp_path / "cage.obj", *small.cage)
    np.save(tmp_path / "frames.npy", small.frames)
    files = ["--rest", "rest.obj", "--cage", "cage.obj", "--frames", "frames.npy"]
    run("encode", *files, "-o", "program.cager", "--unit", "cm", "--start", "1001")
    capture = encoded(small, unit="cm", start=1001)
    capture.save(tmp_path / "module.cager")
    assert (tmp_path / "module.cager").read_bytes() == (tmp_path / "program.cager").read_bytes()
    refused = subprocess.run([PROGRAM, "decode", "module.cager", "-o", "y.npy", "--up", "z"], cwd=tmp_path, capture_output=True, text=True)
    assert refused.returncode == 1 and "does not say which axis points up" in refused.stderr
    run("edit", "module.cager", "--up", "y", "-o", "said.cager")
    said = json.loads(run("inspect", "said.cager", "--json"))
    assert (said["up"], said["metres_per_unit"]) == ("y", 0.01)
    again = subprocess.run([PROGRAM, "edit", "said.cager", "--unit", "m", "-o", "again.cager"], cwd=tmp_path, capture_output=True, text=True)
    assert again.returncode == 1 and "says already" in again.stderr
    run("decode", "said.cager", "-o", "z.npy", "--up", "z", "--unit", "m")
    x, y, z = np.moveaxis(capture.decode(), 2, 0)
    assert np.allclose(np.load(tmp_path / "z.npy"), 0.01 * np.stack([x, -z, y], axis=2), atol=1e-8)
    # Cages that were taken elsewhere come back from there.
    run("decode", "said.cager", "--cages", "-o", "cages.npy", "--up", "z", "--unit", "m")
    cages = np.load(tmp_path / "cages.npy")
    cages[3, 5] += [0, 0, 0.001]
    np.save(tmp_path / "cages.npy", cages)
    run("edit", "said.cager", "--with-cages", "cages.npy", "--up", "z", "--unit", "m", "-o", "edited.cager")
    moved = cager.open(tmp_path / "edited.cager").cages - capture.cages
    assert np.allclose(moved[3, 5], [0, 0.1, 0], atol=1e-5)
