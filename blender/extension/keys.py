"""Shape keys of a cage: one for each frame of its capture, whose values follow the scene."""

import re

import numpy as np

from .times import words

OF_FRAME = re.compile(r"frame -?\d+(\.\d+)?")


def key_name(time):
    return f"frame {words(time)}"


def add(cage, cages, times):
    """Adds a shape key for each frame. Keyframes for so many would take longer than all else."""
    cage.shape_key_add(name="rest", from_mix=False)
    for time, points in zip(times, cages):
        key = cage.shape_key_add(name=key_name(time), from_mix=False)
        key.data.foreach_set("co", points.ravel())
        key.value = 0


def points_of(blocks, time):
    """The cage as it is in the key of a frame, (m, 3); None where there is no such key any more."""
    key = blocks.get(key_name(time))
    if key is None:
        return None
    points = np.empty(3 * len(key.data), np.float32)
    key.data.foreach_get("co", points)
    return points.reshape(-1, 3)


def weigh(blocks, times, part):
    """Lets a cage be as at a time, or a part of the way to the next of two. Keys of the user's own stay as they are."""
    wanted = dict(zip(map(key_name, times), (np.float32(1 - part), np.float32(part))))
    values = np.empty(len(blocks), np.float32)
    blocks.foreach_get("value", values)
    for k in np.flatnonzero(values).tolist():
        if OF_FRAME.fullmatch(blocks[k].name) and blocks[k].name not in wanted:
            blocks[k].value = 0
    for name, value in wanted.items():
        key = blocks.get(name)
        if key and key.value != value:
            key.value = value
