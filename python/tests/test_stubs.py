"""The stubs name what is there, and their examples give what they say."""

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import cager

STUBS = Path(__file__).parents[1] / "cager.pyi"
USE = '''
import contextlib, copy
from collections.abc import Iterator
import numpy as np
import cager

def positions(capture: cager.Capture) -> Iterator[float]:
    for frame in [*capture, *list(capture), *reversed(capture), capture[np.int64(1)], capture[1], capture[1:2]]:
        yield float((frame - capture.rest).max())

def arrays(capture: cager.Capture) -> tuple[np.ndarray[tuple[int, ...], np.dtype[np.float32]], bool]:
    capture.pose(copy.copy(capture).cages[0] * 2)
    return capture.decode(np.zeros((1, 2, 3), np.float32)), capture.decode().dtype == np.float64

def placed(capture: cager.Capture) -> tuple[float | None, float]:
    capture.export("walk.usdc", up="y", unit="cm")
    capture.with_cages(capture.cages, name="smile").switch_layer(0, False).remove_layer().flatten()
    last = cager.encode(capture.rest, None, capture, unit=0.01, up="z", times=capture.times)
    return last.unit, sum(frame for layer in last.layers if layer["on"] for frame in layer["frames"]) + float(last.times[0])

async def last(client: cager.Client) -> int:
    async with contextlib.aclosing(client.follow("x")) as cages:
        number, cage = await anext(cages)
    return number
'''


def members(of):
    """Public names and those of protocols, of a body of the stubs."""
    names = {name.id for node in of for name in getattr(node, "targets", []) + [getattr(node, "target", None)] if isinstance(name, ast.Name)}
    names |= {node.name for node in of if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))}
    return {name for name in names if not name.startswith("_") or name.startswith("__")}


def test_the_stubs_name_what_is_there():
    body = ast.parse(STUBS.read_text()).body
    assert members(body) == {*cager.__all__, "__all__"}
    (listed,) = [node.value for node in body if isinstance(node, ast.Assign) and node.targets[0].id == "__all__"]
    assert sorted(ast.literal_eval(listed)) == sorted({*cager.__all__} - {"__version__"})
    # Of these the stubs' readers know from the class object, or from that they are called.
    usual = {*dir(object), "__new__", "__module__", "__doc__", "__weakref__"} - {"__reduce__"}
    for kind in (cager.Capture, cager.Client, type(cager.Client("http://127.0.0.1:1").follow("x"))):
        name = {"Cages": "_Cages"}.get(kind.__name__, kind.__name__)
        (written,) = [node.body for node in body if isinstance(node, ast.ClassDef) and node.name == name]
        assert members(written) - usual == {name for name in vars(kind)} - usual


@pytest.mark.skipif(not importlib.util.find_spec("mypy"), reason="mypy is not here")
def test_a_checker_of_types_accepts_what_works(tmp_path):
    (tmp_path / "cager.pyi").write_text(STUBS.read_text())
    (tmp_path / "use.py").write_text(USE)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache", "use.py", "cager.pyi"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("kind", ["green", "green-free"])
def test_coordinates_with_normals_are_used_as_the_example_says(small, kind):
    example = re.findall(r"^ +(normals = .*|lengths = .*|points = .*)$", STUBS.read_text(), re.M)
    assert len(example) == 3 and all(line in cager.coordinates.__doc__ for line in example)
    cage_vertices, cage_faces = small.cage
    phi = cager.coordinates(small.rest, cage_vertices, cage_faces, kind)
    assert phi.shape == (len(small.rest), len(cage_vertices) + len(cage_faces))
    names = {"np": np, "phi": phi, "cage_vertices": cage_vertices, "cage_faces": cage_faces}
    exec("\n".join(example), names)
    assert np.allclose(names["points"], small.rest, atol=1e-9)
