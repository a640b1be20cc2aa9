"""Opened captures, and the frame of one that a scene shows."""

import os

import bpy
import cager
import numpy as np

_opened = {}


class Opened:
    """A capture with what is asked of it in every frame. Positions are relative to `offset`, as Blender has single precision alone."""

    def __init__(self, path):
        self.path = path
        self.capture = cager.open(path)
        self.rest_cage = self.capture.rest_cage
        self.stored = np.asarray(self.capture.cages)
        is_far = self.stored.dtype == np.float64
        self.offset = self.rest_cage.mean(axis=0).astype(np.float32).astype(float) if is_far else np.zeros(3)
        self.cages = np.ascontiguousarray(self.stored - self.offset, np.float32)
        # Blender adds shape keys up in single precision: what is closer than this was not edited.
        size = np.linalg.norm(np.ptp(self.rest_cage, axis=0))
        self.tolerance = 1e-6 * size + 4 * np.finfo(np.float32).eps * np.abs(self.cages).max(initial=0)

    def __len__(self):
        return len(self.capture)

    def positions(self, frame):
        """The model in a frame, (n, 3)."""
        return self._relative(self.capture[frame])

    def edited(self, frame, points):
        """The cage of a frame with vertices that were moved, (m, 3); None where none was."""
        moved = np.abs(points - self.cages[frame]).max(axis=1) > self.tolerance
        if not moved.any():
            return None
        cage = np.array(self.stored[frame], float)
        cage[moved] = points[moved] + self.offset
        return cage

    def posed(self, cage):
        """The model in an edited cage, (n, 3)."""
        return self._relative(self.capture.pose(cage))

    def _relative(self, positions):
        return positions if positions.dtype == np.float32 else (positions - self.offset).astype(np.float32)


def of_path(path):
    """The capture of a file, opened once. Raises CagerError."""
    path = os.path.realpath(bpy.path.abspath(path))
    if path not in _opened:
        _opened[path] = Opened(path)
    return _opened[path]


def of_model(model):
    return of_path(model.cager.file)


def forget(path=None):
    """Closes a capture, which has another content by now, or all."""
    if path is None:
        _opened.clear()
    else:
        _opened.pop(os.path.realpath(bpy.path.abspath(path)), None)


def models(scene):
    """Objects of a scene that show a capture."""
    return [thing for thing in scene.objects if thing.type == "MESH" and thing.cager.file]


def model_of(thing):
    """The model that an object is, or whose cage it is."""
    if thing is None:
        return None
    if thing.type == "MESH" and thing.cager.file:
        return thing
    children = [thing, *thing.children, *(thing.parent.children if thing.parent else ())]
    return next((each for each in children if each.cager.file and thing in (each.parent, each.cager.cage)), None)


def frame_of(model, scene_frame):
    """The frame of the capture in a frame of the scene; the first before it begins, and the last after its end."""
    return min(max(scene_frame - model.cager.first, 0), len(of_model(model)) - 1)
