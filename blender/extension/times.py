"""The time of a scene, between whole frames too and remapped, as Blender's own animation has it."""

import math
from contextlib import contextmanager

from bpy.props import IntProperty

# Blender's last frame; its first is as far below 0.
LAST_FRAME = 1_048_574


def first_frame_property():
    return IntProperty(
        name="First frame", default=1, min=-LAST_FRAME, max=LAST_FRAME, description="Frame of the scene that shows the capture's first"
    )


def now(scene):
    """The time that a scene shows: a frame, or a part of the way to the next."""
    time = (scene.frame_current + scene.frame_subframe) * scene.render.frame_map_old / scene.render.frame_map_new
    # Parts of frames are in single precision.
    return round(time) if abs(time - round(time)) < 1e-4 else time


def go_to(scene, time):
    frame = time * scene.render.frame_map_new / scene.render.frame_map_old
    scene.frame_set(math.floor(frame), subframe=frame - math.floor(frame))


def again(scene):
    """Shows the scene's frame anew."""
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)


@contextmanager
def kept(scene):
    """Returns to the scene's frame after others were gone through."""
    frame, part = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=part)
