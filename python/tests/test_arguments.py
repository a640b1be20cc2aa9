"""Arguments that are out of range, and paths and formats that cannot be meant, are named."""

import numpy as np
import pytest

import cager


@pytest.fixture(scope="module")
def coded(small):
    return cager.encode(small.rest, small.faces, small.frames, small.cage)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"seed": -1}, "seed: is -1; give a whole number of 0 or more"),
        ({"seed": 2**64}, f"seed: is {2**64}; give a smaller number"),
        ({"vertices": -1}, "vertices: is -1; give a whole number of 0 or more"),
        ({"vertices": 10**30}, "vertices: is 10+; give a smaller number"),
    ],
)
def test_numbers_out_of_range_are_named(small, options, words):
    client = cager.Client("http://127.0.0.1:1")
    for call in (cager.encode, cager.design_cage, client.encode):
        with pytest.raises(cager.CagerError, match=words):
            call(small.rest, small.faces, small.frames, **options)


def test_the_first_frame_to_follow_is_named_where_it_is_out_of_range():
    client = cager.Client("http://127.0.0.1:1")
    with pytest.raises(cager.CagerError, match="first: is -1; give a whole number of 0 or more"):
        client.follow("x", -1)
    with pytest.raises(cager.CagerError, match="first: is 4294967296; give a smaller number"):
        client.follow("x", first=2**32)


def test_a_time_limit_that_is_infinite_is_none(small):
    unlimited = cager.design_cage(small.rest, small.faces, small.frames, 20)
    for limit in (float("inf"), 1e300):
        vertices, faces = cager.design_cage(small.rest, small.faces, small.frames, 20, time_limit=limit)
        assert np.array_equal(vertices, unlimited[0]) and np.array_equal(faces, unlimited[1])
    for limit, words in ((0, "is 0"), (-1, "is -1"), (float("nan"), "is NaN")):
        with pytest.raises(cager.CagerError, match=f"time_limit: {words}; give a number of seconds above 0"):
            cager.design_cage(small.rest, small.faces, small.frames, 20, time_limit=limit)


def test_an_empty_path_is_named(coded):
    client = cager.Client("http://127.0.0.1:1")
    for call in (cager.open, coded.save, coded.export, lambda path: client.download("x", path)):
        with pytest.raises(cager.CagerError, match="^path: is empty; name a file"):
            call("")


def test_a_folder_is_no_capture(tmp_path):
    with pytest.raises(cager.CagerError, match=f"^{tmp_path}: is a folder; name a .cager file$"):
        cager.open(tmp_path)


def test_one_mesh_file_for_all_frames_is_refused_without_options_of_the_program(coded, tmp_path):
    with pytest.raises(cager.CagerError, match="holds one mesh, and there are 10 frames; name a folder for all, such as ") as told:
        coded.export(tmp_path / "walk.obj")
    assert "--" not in str(told.value)
