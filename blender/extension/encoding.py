"""Encodes an animated object: frames are read bit by bit in Blender's own thread, which no other may do, and encoded in another."""

import math
import threading
import time

import cager
import numpy as np

from . import live, objects, times
from .reading import KINDS, Refused, closed_cage, seen, switched_on


class Cancelled(Exception):
    """The user has stopped the encoding."""


class Encoding:
    """One encoding on its way. `step` is called in Blender's thread until it returns True; `error` then says why there is no capture."""

    def __init__(self, context, thing, path):
        self.scene, self.thing, self.path = context.scene, thing, path
        chosen = self.scene.cager
        self.cage = chosen.cage
        self.options = {
            "max_error": 0.01 * chosen.max_error if chosen.keep == "ERROR" else None,
            "vertices": chosen.vertices or None if chosen.cage is None else None,
            "frame_rate": times.rate(self.scene),
            "unit": objects.unit(self.scene),
            # As everywhere in Blender.
            "up": "z",
        }
        self.shows, self.name = chosen.show, thing.name
        self.first = self.scene.frame_start
        whole = self.scene.frame_end - self.first
        self.times = [self.first + k / chosen.samples for k in range(whole * chosen.samples + 1)]
        self.total = len(self.times)
        self.stage, self.fraction = "reading frames", 0.0
        self.capture = self.error = self.faces = self.cage_mesh = None
        self.frames, self.thread = [], None
        self._stopped = threading.Event()
        if thing.type not in KINDS:
            raise Refused(f"{thing.name} is no mesh but of type {thing.type.title()}: click on the mesh that it moves.")
        if chosen.cage == thing:
            raise Refused(f"{thing.name} is its own cage: choose another object as the cage, or none.")

    def cancel(self):
        self._stopped.set()

    def step(self, context, seconds=0.05):
        """Goes on for about so long; True once all is done."""
        if self.thread:
            self.thread.join(min(seconds, 0.01))
            return not self.thread.is_alive()
        try:
            self._read(context, seconds)
        except (Refused, ReferenceError) as error:
            self.error = str(error) if isinstance(error, Refused) else f"{self.name} was deleted while it was read."
            return True
        if self._stopped.is_set():
            self.error = "Encoding was cancelled; nothing was written."
            return True
        if len(self.frames) == self.total:
            self.stage, self.fraction = "encoding", 0.0
            self.thread = threading.Thread(target=self._encode, name="cager", daemon=True)
            self.thread.start()
        return False

    def _read(self, context, seconds):
        end = time.monotonic() + seconds
        if context.scene != self.scene:
            raise Refused(f"Another scene was chosen while {self.name} was read: encode it again, and stay in its scene meanwhile.")
        if self.thing.mode != "OBJECT":
            raise Refused(f"{self.name} is edited while it is read: encode it again, and stay in Object Mode meanwhile.")
        with times.kept(self.scene), switched_on(context, self._needed()):
            while len(self.frames) < self.total and not self._stopped.is_set():
                now = self.times[len(self.frames)]
                self.scene.frame_set(math.floor(now), subframe=now - math.floor(now))
                self._read_frame(context.evaluated_depsgraph_get())
                self.fraction = len(self.frames) / self.total
                if time.monotonic() > end:
                    break

    def _needed(self):
        """What is read next: the cage in the first frame alone."""
        return [self.thing] if self.frames or not self.cage else [self.thing, self.cage]

    def _read_frame(self, depsgraph):
        frame = times.words(self.times[len(self.frames)])
        for each in self._needed():
            if not each.visible_get():
                raise Refused(f"{each.name} is hidden in frame {frame}: show it in the viewport, or take off the animation that hides it.")
        problem = live.problems.get(self.thing.name_full)
        if problem and self.thing.cager.file:
            raise Refused(f"{self.name} does not play: {problem}")
        points, faces = seen(self.thing, depsgraph, with_faces=not self.frames)
        if not self.frames:
            if not len(points):
                raise Refused(f"{self.name} has no vertices in frame {frame}: click on the mesh that is seen.")
            self.faces = faces
            if self.cage:
                self.cage_mesh = closed_cage(self.cage, depsgraph)
        elif len(points) != len(self.frames[0]):
            raise Refused(
                f"{self.name} has {len(self.frames[0])} vertices in frame {self.first} and {len(points)} in frame {frame}: switch off the modifiers that remesh, decimate or cut it."
            )
        self.frames.append(points)

    def _encode(self):
        try:
            rest = self.frames[0].astype(float)
            faces = self.faces if len(self.faces) else None
            capture = cager.encode(rest, faces, self.frames, self.cage_mesh, progress=self._tell, times=self.times, **self.options)
            self._tell("saving", 1.0)
            capture.save(self.path, overwrite=True)
            self.capture = capture
        except Cancelled:
            self.error = "Encoding was cancelled; nothing was written."
        except Exception as error:
            # Whatever it is, the user waits for an answer.
            self.error = str(error) or repr(error)
        finally:
            self.frames = []

    def _tell(self, stage, fraction):
        self.stage, self.fraction = stage, float(fraction)
        if self._stopped.is_set():
            raise Cancelled

    def summary(self):
        """What was written, in words."""
        report = self.capture.report
        count, points = len(self.capture), len(np.asarray(self.capture.rest))
        return f"{count} frames of {points} vertices, largest error {100 * report['error']['linf_max']:.2g} % of the model's size"
