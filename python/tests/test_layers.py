"""Edits are layers: what is not edited keeps its bits, and all of it can be taken back."""

import os
import subprocess

import numpy as np
import pytest

import cager

PROGRAM = os.environ.get("CAGER_BINARY")
BOUND = 1e-4


@pytest.fixture(scope="module")
def coded(small):
    return cager.encode(small.rest, small.faces, small.frames, small.cage, max_error=BOUND)


def edited_cages(capture):
    cages = np.array(capture.cages)
    cages[3:6, 7] += np.float32([0.1, 0, 0.05])
    return cages


def saved(capture, path):
    capture.save(path)
    return path.read_bytes()


def test_an_edit_changes_nothing_else(small, coded, tmp_path):
    edited = coded.with_cages(edited_cages(coded), name="shoulder")
    (layer,) = edited.layers
    assert (layer["name"], layer["on"], layer["frames"], layer["vertices"].tolist()) == ("shoulder", True, range(3, 6), [7])
    before, after = coded.decode(), edited.decode()
    outside = [0, 1, 2, 6, 7, 8, 9]
    assert np.array_equal(after[outside], before[outside])
    phi = cager.coordinates(coded.rest, coded.rest_cage, coded.cage_faces)
    # Within the bound of the edited motion: what was captured, moved by the cage.
    change = np.einsum("nm,fmi->fni", phi, np.float64(edited.cages) - coded.cages)
    assert np.linalg.norm(after - (small.frames + change), axis=2).max() <= BOUND * small.diagonal
    assert np.abs(after - (before + change)).max() <= 2e-6 * small.diagonal
    bytes_before, bytes_after = saved(coded, tmp_path / "before.cager"), saved(edited, tmp_path / "after.cager")
    assert 0 < len(bytes_after) - len(bytes_before) < 2000
    assert edited.cages[3, 7].tolist() == edited_cages(coded)[3, 7].tolist()


def test_layers_are_stacked_switched_and_taken_back(coded, tmp_path):
    first = coded.with_cages(edited_cages(coded), name="a")
    cages = np.array(first.cages)
    cages[8, 2] += np.float32(0.1)
    second = first.with_cages(cages, name="b")
    assert [layer["name"] for layer in second.layers] == ["a", "b"]
    original = saved(coded, tmp_path / "original.cager")
    assert saved(second.remove_layer(), tmp_path / "1.cager") == saved(first, tmp_path / "first.cager")
    assert saved(second.remove_layer(0).remove_layer(), tmp_path / "2.cager") == original
    off = second.switch_layer(0, False)
    assert [layer["on"] for layer in off.layers] == [False, True]
    assert np.array_equal(off[4], coded[4]) and np.array_equal(off[8], second[8])
    assert saved(off.switch_layer(-2, True), tmp_path / "3.cager") == saved(second, tmp_path / "second.cager")
    flat = second.flatten()
    assert flat.layers == [] and np.array_equal(flat.decode(), second.decode())
    assert saved(coded.with_cages(coded.cages), tmp_path / "4.cager") == original
    for call in (lambda: coded.remove_layer(), lambda: second.switch_layer(2, True), lambda: second.remove_layer(-3)):
        with pytest.raises(IndexError, match="there is no layer"):
            call()
    with pytest.raises(cager.CagerError, match="name: has 300 bytes, more than 256"):
        coded.with_cages(cages, name="x" * 300)


@pytest.mark.skipif(not PROGRAM, reason="CAGER_BINARY names no program")
def test_the_program_writes_the_same_layer(coded, tmp_path):
    coded.save(tmp_path / "in.cager")
    np.save(tmp_path / "cages.npy", edited_cages(coded))
    command = [PROGRAM, "edit", "in.cager", "--with-cages", "cages.npy", "--name", "shoulder", "-o", "out.cager"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    edited = coded.with_cages(edited_cages(coded), name="shoulder")
    assert saved(edited, tmp_path / "module.cager") == (tmp_path / "out.cager").read_bytes()
