"""Cages as they are edited in the scene, in every frame of their capture."""

import bpy
import numpy as np

from . import captures, live, times
from .reading import Refused, switched_on


def leave_edit_mode(context):
    """What is edited counts once Edit Mode is left."""
    if context.object and context.object.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def edited_capture(context, model, name=""):
    """The capture as it is seen in the scene, edits in a layer of this name, and the scene's frames that were edited. Raises CagerError and Refused."""
    leave_edit_mode(context)
    opened, scene = captures.of_model(model), context.scene
    if model.cager.cage is None:
        return opened.capture, []
    cages, frames = np.array(opened.stored), []
    with times.kept(scene):
        with live.paused(model), switched_on(context, [model, model.cager.cage]):
            for k in range(len(opened)):
                time = captures.time_of(model, k)
                times.go_to(scene, time)
                if not any(each.visible_get() for each in (model, model.cager.cage)):
                    raise Refused(f"{model.name} is hidden in frame {times.words(time)}: take off the animation that hides it.")
                points = live.cage_of(model, context.evaluated_depsgraph_get())
                cage = None if points is None else opened.edited(points, k)
                if cage is not None:
                    cages[k] = cage
                    frames.append(time)
    return opened.capture.with_cages(cages, name=name) if frames else opened.capture, frames


def spans(frames):
    """Frames in words: 3, 5 to 9."""
    parts, start = [], 0
    for k in range(1, len(frames) + 1):
        if k == len(frames) or frames[k] > frames[k - 1] + 1:
            first, last = times.words(frames[start]), times.words(frames[k - 1])
            parts.append(first if first == last else f"{first} to {last}")
            start = k
    return ", ".join(parts)
