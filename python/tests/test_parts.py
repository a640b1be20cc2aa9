"""Parts of a capture, and what lies on their faces."""

import os
import subprocess

import numpy as np
import pytest

import cager

PROGRAM = os.environ.get("CAGER_BINARY")

HEAD = """mtllib cast.mtl
o body
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl skin
f 1/1 2/2 3/3 4/4
f 1/1 5/3 2/2
o hat
v 0 2 0
v 1 2 0
v 0 2 1
f 6/1 7/2 8/4
"""


@pytest.mark.skipif(not PROGRAM, reason="CAGER_BINARY names no program")
def test_parts_have_their_faces_texture_coordinates_and_materials(tmp_path):
    (tmp_path / "cast.obj").write_text(HEAD)
    (tmp_path / "cast.mtl").write_text("newmtl skin\nKd 1 0.5 0.25\nmap_Kd skin.png\n")
    points = np.array([[float(x) for x in line.split()[1:]] for line in HEAD.splitlines() if line.startswith("v ")])
    np.save(tmp_path / "frames.npy", np.stack([points, points + [0.1, 0, 0]]))
    command = [PROGRAM, "encode", "--rest", "cast.obj", "--frames", "frames.npy", "--cage-vertices", "20", "-o", "cast.cager"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    capture = cager.open(tmp_path / "cast.cager")
    body, hat = capture.parts
    assert (body["path"], hat["path"]) == ("/body", "/hat")
    assert (body["points"], hat["points"], body["shown"]) == ((0, 5), (5, 8), None)
    assert body["face_counts"].tolist() == [4, 3] and body["face_points"].tolist() == [0, 1, 2, 3, 0, 4, 1]
    assert hat["face_points"].tolist() == [0, 1, 2]
    (uvs,) = body["uvs"].values()
    assert uvs.shape == (7, 2) and np.abs(uvs[2] - [1, 1]).max() < 1e-4
    assert body["materials"].tolist() == [0, 0]
    (skin,) = capture.materials
    assert skin["name"] == "skin" and skin["textures"] == {"base_color": "skin.png"}
    assert np.allclose(skin["base_color"], [1, 0.5, 0.25])


def test_a_capture_of_arrays_has_no_parts(small):
    capture = cager.encode(small.rest, small.faces, small.frames, small.cage)
    assert capture.parts == [] and capture.materials == []
