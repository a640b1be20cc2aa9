"""Captures there and back: what is promised of errors, files, arrays and edits."""

import gc
import multiprocessing
import os
import signal
import threading

import numpy as np
import pytest

import cager


@pytest.fixture(scope="module")
def coded(small):
    return cager.encode(small.rest, small.faces, small.frames, small.cage, max_error=1e-3)


def test_no_point_is_farther_than_the_maximum_error(small, coded):
    farthest = np.linalg.norm(coded.decode() - small.frames, axis=2).max()
    assert 0 < farthest <= 1e-3 * small.diagonal
    assert coded.report["coding"]["max_error"] == 1e-3


def test_a_mean_error_is_met(small):
    capture = cager.encode(small.rest, small.faces, small.frames, small.cage, mean_error=2e-3)
    squared = ((capture.decode() - small.frames) ** 2).sum(axis=2)
    assert np.sqrt(squared.mean(axis=1)).mean() <= 2e-3 * small.diagonal


def test_a_mean_error_that_no_cage_meets_is_met_by_coding(small):
    frames = small.frames + 0.02 * np.random.default_rng(1).normal(size=small.frames.shape)
    capture = cager.encode(small.rest, small.faces, frames, mean_error=1e-3)
    squared = ((capture.decode() - frames) ** 2).sum(axis=2)
    assert np.sqrt(squared.mean(axis=1)).mean() <= 1e-3 * small.diagonal
    with pytest.warns(UserWarning, match="was not reached"):
        cager.design_cage(small.rest, small.faces, frames, mean_error=1e-3)


def test_frames_come_one_by_one_in_slices_and_all_at_once(small, coded):
    assert len(coded) == 10
    assert coded[0].shape == small.rest.shape and coded[0].dtype == np.float32
    everything = coded.decode()
    assert np.array_equal(np.stack(list(coded)), everything)
    assert np.array_equal(coded[-1], everything[9])
    assert np.array_equal(coded[7:2:-2], everything[7:2:-2])
    many = cager.encode(small.rest, small.faces, np.concatenate([small.frames] * 4), small.cage)
    assert np.array_equal(many.decode(), np.stack(list(many)))
    assert coded[5:5].shape == (0, len(small.rest), 3)
    assert np.array_equal(coded[np.int64(3)], everything[3])
    for missing in (10, -11, 2**80):
        with pytest.raises(IndexError, match="counted from 0"):
            coded[missing]
    with pytest.raises(TypeError):
        coded["first"]


def test_frames_are_written_into_arrays_that_are_given(small, coded):
    everything = coded.decode()
    for out in (
        np.zeros(small.frames.shape),
        np.zeros(small.frames.shape, np.float32, order="F"),
        np.zeros((10, 2 * len(small.rest), 3), np.float32)[:, ::2],
    ):
        assert coded.decode(out) is out
        assert np.array_equal(out, everything.astype(out.dtype))
    frozen = np.zeros(small.frames.shape, np.float32)
    frozen.flags.writeable = False
    for out in (frozen, np.zeros((10, 3)), np.zeros(small.frames.shape, np.int32), [1, 2]):
        with pytest.raises(cager.CagerError, match="out: give a writable array"):
            coded.decode(out)


def turned(faces):
    """Faces in any order, each from its smallest vertex on."""
    return sorted(tuple(np.roll(face, -np.argmin(face)).tolist()) for face in faces)


def test_a_saved_capture_is_the_same_when_it_is_opened(small, coded, tmp_path):
    path = tmp_path / "walk.cager"
    coded.save(path)
    again = cager.open(path)
    assert np.array_equal(again.decode(), coded.decode())
    # Coded files keep the faces in an order of their own.
    assert turned(again.faces) == turned(small.faces)
    assert turned(again.cage_faces) == turned(small.cage[1])
    assert np.allclose(again.rest_cage, small.cage[0], atol=1e-3 * small.diagonal)
    assert np.allclose(again.rest, small.rest, atol=1e-3 * small.diagonal)
    with pytest.raises(cager.CagerError, match="walk.cager: "):
        coded.save(path)
    coded.save(path, overwrite=True)
    with pytest.raises(cager.CagerError, match="create its folder first"):
        coded.save(tmp_path / "nowhere" / "walk.cager")


def test_a_file_that_is_written_anew_is_not_mixed_with_what_was_opened(small, coded, tmp_path, monkeypatch):
    coded.save(tmp_path / "walk.cager")
    monkeypatch.chdir(tmp_path)
    opened = cager.open("walk.cager")
    monkeypatch.chdir("/")
    assert np.array_equal(opened.cages, coded.cages)
    cager.encode(small.rest, None, small.frames[:3], small.cage).save(tmp_path / "walk.cager", overwrite=True)
    for read in (opened.decode, lambda: opened[0], lambda: opened.cages, lambda: opened.save(tmp_path / "other.cager")):
        with pytest.raises(cager.CagerError, match="walk.cager: has been written anew"):
            read()


def test_faces_of_one_size_are_an_array(small):
    triangles = [face for face in small.faces if len(face) == 3]
    capture = cager.encode(small.rest, np.array(triangles, np.int32), small.frames[:2], small.cage)
    assert capture.faces.shape == (len(triangles), 3)
    cloud = cager.encode(small.rest, None, small.frames[:2], small.cage)
    assert cloud.faces.shape == (0, 3)


def test_memory_order_and_precision_do_not_matter(small, tmp_path):
    def written(frames, rest=small.rest):
        path = tmp_path / "any.cager"
        cager.encode(rest, small.faces, frames, small.cage, max_error=1e-3).save(path, overwrite=True)
        return path.read_bytes()

    single = small.frames.astype(np.float32)
    exact = written(single.astype(np.float64))
    assert written(single) == exact
    assert written(np.asfortranarray(single)) == exact
    assert written(single[::-1][::-1]) == exact
    assert written(list(single)) == exact
    assert written(frame for frame in single) == exact
    assert written(single.astype(">f4")) == exact
    packed = np.zeros(single.shape, [("", "u1"), ("x", "f4")])
    packed["x"] = single
    assert written(packed["x"]) == exact
    assert written(single, np.asfortranarray(small.rest)) == exact


def test_edited_cages_move_the_model(small, coded):
    cages = coded.cages
    assert cages.shape == (10, len(small.cage[0]), 3)
    moved = coded.with_cages(cages + np.float32([0, 0, 2]))
    assert np.allclose(moved.cages, cages + np.float32([0, 0, 2]))
    assert np.allclose(moved.decode().mean(axis=1), coded.decode().mean(axis=1) + [0, 0, 2], atol=0.02)
    assert len(coded.with_cages(cages[:3])) == 3
    with pytest.raises(cager.CagerError, match="frames of the model, not of its cage"):
        coded.with_cages(small.frames)
    with pytest.raises(cager.CagerError, match="cages"):
        coded.with_cages(np.full_like(cages, np.nan))
    with pytest.raises(cager.CagerError, match="no frames"):
        coded.with_cages([])


def test_a_model_is_posed_by_a_cage_as_by_an_edited_capture(small, coded):
    cage = coded.cages[4] * [1, 1.25, 1]
    assert np.array_equal(coded.pose(cage), coded.with_cages([cage])[0])
    with pytest.raises(cager.CagerError, match="cage: has 7 vertices where the capture's has"):
        coded.pose(cage[:7])
    with pytest.raises(cager.CagerError, match="vertex 2 is too far away"):
        coded.pose(np.where(np.arange(len(cage))[:, None] == 2, 1e39, cage))


def test_frames_are_exported_for_other_programs(small, coded, tmp_path):
    assert coded.export(tmp_path / "walk.npy") == []
    assert np.array_equal(np.load(tmp_path / "walk.npy"), coded.decode())
    for name in ("walk.usdc", "walk.abc"):
        assert coded.export(tmp_path / name) == [] and (tmp_path / name).stat().st_size > 12 * coded.decode().size / 3
    (loss,) = coded.export(tmp_path / "walk.glb")
    assert "morph targets" in loss
    coded.export(tmp_path / "caged.usdc", with_cage=True)
    assert (tmp_path / "caged.usdc").stat().st_size > (tmp_path / "walk.usdc").stat().st_size
    with pytest.raises(cager.CagerError, match="pass overwrite=True"):
        coded.export(tmp_path / "walk.npy")
    coded.export(tmp_path / "walk.npy", overwrite=True)
    coded.save(tmp_path / "walk.cager")
    opened = cager.open(tmp_path / "walk.cager")
    for name, words in (("walk.cager", "is the capture itself"), ("walk.xyz", "walk.xyz")):
        with pytest.raises(cager.CagerError, match=words):
            opened.export(tmp_path / name, overwrite=True)
    assert np.array_equal(cager.open(tmp_path / "walk.cager").decode(), coded.decode())


def test_a_capture_far_away_keeps_its_digits(small):
    far = np.array([691_234.0, 5_334_987.0, 512.0])
    capture = cager.encode(small.rest + far, small.faces, small.frames + far, (small.cage[0] + far, small.cage[1]), max_error=1e-3)
    assert capture[0].dtype == np.float64 and capture.cages.dtype == np.float64
    assert np.linalg.norm(capture.decode() - small.frames - far, axis=2).max() <= 1e-3 * small.diagonal
    assert np.allclose(capture.with_cages(capture.cages).cages, capture.cages)


def test_captures_without_a_name_go_with_their_last_use(small, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    capture = cager.encode(small.rest, small.faces, small.frames, small.cage)
    assert len(os.listdir(tmp_path)) == 1
    del capture
    gc.collect()
    assert os.listdir(tmp_path) == []


def test_other_threads_run_while_frames_are_encoded_and_read(small, coded):
    expected = coded.decode()
    results = [None] * 4

    def read(place):
        results[place] = all(np.array_equal(coded[t], expected[t]) for t in range(10))

    threads = [threading.Thread(target=read, args=(place,)) for place in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [True] * 4


def test_progress_is_told_and_an_exception_in_it_ends_the_encoding(small):
    told = []
    cager.encode(small.rest, small.faces, small.frames, small.cage, progress=lambda *now: told.append(now))
    assert told[-1] == ("encoding", 1.0) and len({stage for stage, _ in told}) > 1

    class Enough(Exception):
        pass

    def stop(stage, fraction):
        raise Enough(stage)

    with pytest.raises(Enough):
        cager.encode(small.rest, small.faces, small.frames, small.cage, progress=stop)
    with pytest.raises(Enough):
        cager.design_cage(small.rest, small.faces, small.frames, 20, progress=stop)
    with pytest.raises(TypeError):
        cager.encode(small.rest, small.faces, small.frames, small.cage, progress=3)


def test_the_user_can_interrupt_it(small):
    frames = np.concatenate([small.frames] * 300)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        timer.start()
        for _ in range(100):
            cager.encode(small.rest, small.faces, frames, small.cage, max_error=1e-3)
    timer.join()


def read_in_child(capture, results):
    try:
        results.put(len(capture.decode()))
    except cager.CagerError as error:
        results.put(str(error))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="processes are not forked here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_is_told_to_start_otherwise(coded):
    coded.decode()
    context = multiprocessing.get_context("fork")
    results = context.Queue()
    child = context.Process(target=read_in_child, args=(coded, results))
    child.start()
    assert "spawn" in results.get(timeout=30)
    child.join()


def test_points_outside_the_cage_are_warned_of(small):
    beside = (small.cage[0] + 1, small.cage[1])
    with pytest.warns(UserWarning, match="386 of 386 points lie outside the cage"):
        cager.encode(small.rest, small.faces, small.frames, beside, force=True)


def test_a_cage_is_designed_where_none_is_given(small):
    vertices, faces = cager.design_cage(small.rest, small.faces, small.frames, vertices=30)
    assert vertices.shape[1] == 3 and 4 <= len(vertices) <= 30 and faces.shape[1] == 3
    same = cager.design_cage(small.rest, small.faces, small.frames, vertices=30)
    assert np.array_equal(vertices, same[0]) and np.array_equal(faces, same[1])
    capture = cager.encode(small.rest, small.faces, small.frames, vertices=30)
    assert np.allclose(capture.rest_cage, vertices) and np.array_equal(capture.cage_faces, faces)


@pytest.mark.parametrize("kind", ["mvc", "harmonic"])
def test_coordinates_reproduce_the_points(small, kind):
    phi = cager.coordinates(small.rest, *small.cage, kind=kind)
    assert phi.shape == (len(small.rest), len(small.cage[0]))
    assert np.allclose(phi @ small.cage[0], small.rest, atol=1e-3)
    assert np.allclose(phi.sum(axis=1), 1)
