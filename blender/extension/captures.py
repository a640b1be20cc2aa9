"""Opened captures, and the frame of one that a scene shows."""

import os

import cager
import numpy as np

from . import paths
from .times import SAME

_opened = {}


class Opened:
    """A capture with what is asked of it in every frame. Positions are relative to `offset`, as Blender has single precision alone."""

    def __init__(self, path):
        self.capture = cager.open(path)
        numbers = self.capture.times
        # Its frames, counted from that of the scene that shows the first or the part of a frame before it.
        self.times = numbers - np.floor(numbers[:1])
        self.rest_cage = self.capture.rest_cage
        report = self.capture.report
        self.has_details, self.is_free = bool(report.get("coding")), report.get("coordinates") == "green-free"
        self.stored = np.asarray(self.capture.cages)
        is_far = self.stored.dtype == np.float64
        self.offset = self.rest_cage.mean(axis=0).astype(np.float32).astype(float) if is_far else np.zeros(3)
        self.cages = np.ascontiguousarray(self.stored - self.offset, np.float32)
        # Blender adds shape keys up in single precision: what is closer than this was not edited.
        size = np.linalg.norm(np.ptp(self.rest_cage, axis=0))
        self.tolerance = 1e-6 * size + 4 * np.finfo(np.float32).eps * np.abs(self.cages).max(initial=0)

    def __len__(self):
        return len(self.capture)

    def positions(self, frame, part=0):
        """The model in a frame, (n, 3), or a part of the way to the next."""
        return self.relative(between(self.capture, frame, part))

    def edited(self, points, frame, part=0):
        """The cage of a frame with vertices that were moved, (m, 3); None where none was. Raises CagerError."""
        moved = self.differs(points, between(self.cages, frame, part))
        if not moved.any():
            return None
        if self.is_free:
            raise cager.CagerError(
                "this capture has green-free coordinates, whose cage cannot be edited: undo what was edited, click on the model, choose Encode selected, and edit the capture that this makes"
            )
        cage = np.array(between(self.stored, frame, part), float)
        cage[moved] = points[moved] + self.offset
        return cage

    def differs(self, points, others):
        """Which vertices of two cages are in other places, (m,)."""
        return np.abs(points - others).max(axis=1) > self.tolerance

    def posed(self, cage):
        """The model in an edited cage, (n, 3)."""
        return self.relative(self.capture.pose(cage))

    def details(self, frame, part=0):
        """What the cage of a frame leaves over, (n, 3), which stays where the cage is edited; 0 where it leaves nothing."""
        if not self.has_details:
            return 0
        return self.positions(frame, part) - self.posed(np.array(between(self.stored, frame, part), float))

    def relative(self, positions):
        """Positions of the capture as Blender has them."""
        return positions if positions.dtype == np.float32 else (positions - self.offset).astype(np.float32)


def between(frames, frame, part):
    """What is a part of the way from a frame to the next."""
    return (1 - part) * frames[frame] + part * frames[frame + 1] if part else frames[frame]


def of_path(path):
    """The capture of a file, opened once, by its whole path. Raises CagerError."""
    path = os.path.realpath(path)
    if path not in _opened:
        _opened[path] = Opened(path)
    return _opened[path]


def of_model(model):
    """The capture that a model shows. Raises CagerError."""
    path = paths.found(model)
    opened = of_path(path)
    if model.cager.found != path:
        model.cager.found = path
    return opened


def forget(path=None):
    """Closes a capture, which has another content by now, or all."""
    if path is None:
        _opened.clear()
    else:
        _opened.pop(os.path.realpath(path), None)


def models(scene):
    """Objects that show a capture: those of a scene, and of the collections that it has instances of."""
    things, instanced = list(scene.objects), set()
    for thing in things:
        collection = thing.instance_collection if thing.instance_type == "COLLECTION" else None
        if collection and collection not in instanced:
            instanced.add(collection)
            things += collection.all_objects
    return [thing for thing in dict.fromkeys(things) if thing.type == "MESH" and thing.cager.file]


def model_of(thing):
    """The model that an object is, or whose cage it is."""
    if thing is None:
        return None
    if thing.type == "MESH" and thing.cager.file:
        return thing
    children = [thing, *thing.children, *(thing.parent.children if thing.parent else ())]
    return next((each for each in children if each.cager.file and thing in (each.parent, each.cager.cage)), None)


def time_of(model, frame):
    """The scene's time of a frame of the capture."""
    return model.cager.first + float(of_model(model).times[frame])


def step_after(model, time):
    """How long a frame of the capture is shown, of the scene's frames."""
    times = of_model(model).times
    frame = int(np.searchsorted(times, time - model.cager.first + SAME, side="right"))
    return float(times[frame] - times[frame - 1]) if 0 < frame < len(times) else 1


def place_of(model, time):
    """The frame of the capture at a time, and the part of the way to the next; the first before it begins, the last after its end."""
    times, at = of_model(model).times, time - model.cager.first
    frame = max(int(np.searchsorted(times, at + SAME, side="right")) - 1, 0)
    if frame + 1 == len(times) or at - times[frame] <= SAME:
        return frame, 0
    return frame, float((at - times[frame]) / (times[frame + 1] - times[frame]))
