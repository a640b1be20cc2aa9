"""Captures in other processes, copied, and referred to."""

import copy
import os
import pickle
import weakref

import numpy as np
import pytest

import cager


@pytest.fixture(scope="module")
def coded(small):
    return cager.encode(small.rest, small.faces, small.frames, small.cage, max_error=1e-3)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are not forked here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_leaves_the_files_of_its_parent(small, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    capture = cager.encode(small.rest, small.faces, small.frames, small.cage)
    child = os.fork()
    if child == 0:
        del capture
        os._exit(0)
    os.waitpid(child, 0)
    assert len(os.listdir(tmp_path)) == 1 and capture.decode().shape == small.frames.shape
    del capture
    assert os.listdir(tmp_path) == []


def test_a_copy_is_the_capture_itself(coded):
    assert copy.copy(coded) is coded and copy.deepcopy([coded]) == [coded]


def test_what_is_pickled_says_how_it_is_sent_instead(coded, tmp_path):
    with pytest.raises(TypeError, match=r"save it with capture.save\(path\), send the path, and open it there with cager.open\(path\)"):
        pickle.dumps(coded)


def test_weak_references_end_with_the_capture(small):
    capture = cager.encode(small.rest, small.faces, small.frames[:2], small.cage)
    reference = weakref.ref(capture)
    assert reference() is capture
    del capture
    assert reference() is None


def test_frames_come_in_turn_from_both_ends(coded):
    everything = coded.decode()
    assert np.array_equal(np.stack(list(coded)), everything)
    assert np.array_equal(np.stack(list(reversed(coded))), everything[::-1])
    assert type(coded).__iter__ and next(iter(coded)).shape == everything[0].shape
