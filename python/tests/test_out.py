"""Arrays that frames are decoded into: what would be wrong in them is refused."""

import numpy as np
import pytest

import cager


@pytest.fixture(scope="module")
def coded(small):
    return cager.encode(small.rest, small.faces, small.frames, small.cage, max_error=1e-3)


@pytest.mark.parametrize("strides", [(0, 12, 4), (12, 12, 4), (4, 0, 4), (-12, 24, 4), (4632, 4, 8)])
@pytest.mark.parametrize("single", [True, False])
def test_numbers_that_share_their_places_are_refused(small, coded, strides, single):
    kind = np.float32 if single else np.float64
    strides = [step * np.dtype(kind).itemsize // 4 for step in strides]
    room = np.zeros(2 * small.frames.size, kind)[small.frames.size :]
    with pytest.raises(cager.CagerError, match="out: has numbers that share their places; give an array in which each has its own"):
        coded.decode(np.lib.stride_tricks.as_strided(room, small.frames.shape, strides))


def test_views_whose_numbers_have_their_own_places_are_filled(small, coded):
    frames, points, _ = small.frames.shape
    expected = coded.decode()
    for out in (
        np.zeros((frames, points, 3), np.float32)[::-1, :, ::-1],
        np.zeros((3, points, frames), np.float32).T,
        np.zeros((2 * frames, 3, points + 5), np.float32)[::2, :, 5:].transpose(0, 2, 1),
        np.zeros((frames, points, 4), [("x", "f4"), ("y", "f4")])["y"][..., :3],
    ):
        assert np.array_equal(coded.decode(out), expected)
    one = cager.encode(small.rest, small.faces, small.frames[:1], small.cage)
    out = np.lib.stride_tricks.as_strided(np.zeros(3 * points, np.float32), (1, points, 3), (0, 12, 4))
    assert np.array_equal(one.decode(out), one.decode())


@pytest.mark.parametrize("away, bound, refused", [(1e3, None, False), (1e3, 1e-4, True), (1e6, None, True)])
def test_single_precision_is_refused_where_it_loses_more_than_the_bound_leaves(small, away, bound, refused):
    vertices, faces = small.cage
    cage = (vertices + away, faces)
    capture = cager.encode(small.rest + away, small.faces, small.frames + away, cage, max_error=bound)
    single = np.zeros(small.frames.shape, np.float32)
    double = capture.decode(np.zeros(small.frames.shape))
    if refused:
        with pytest.raises(cager.CagerError, match="out: holds single precision, which moves points by .* give an array of float64"):
            capture.decode(single)
    else:
        rounded = capture.decode(single).astype(np.float64) - double
        assert np.linalg.norm(rounded, axis=2).max() < 1e-4 * small.diagonal
    if bound is not None:
        assert np.linalg.norm(double - small.frames - away, axis=2).max() <= bound * small.diagonal
