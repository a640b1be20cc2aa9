"""The time of a scene, between whole frames too and remapped, as Blender's own animation has it."""

import math
from contextlib import contextmanager

from bpy.props import IntProperty

# Blender's last frame; its first is as far below 0.
LAST_FRAME = 1_048_574
# Times that are the same: parts of frames are in single precision.
SAME = 1e-4


def first_frame_property(**options):
    return IntProperty(
        name="First frame",
        default=1,
        min=-LAST_FRAME,
        max=LAST_FRAME,
        description="Frame of the scene that shows the capture's first",
        **options,
    )


def rate(scene):
    """Frames per second. What rates are divided by is in single precision: 1.001 is meant where it says 1.00100004."""
    return scene.render.fps / float(f"{scene.render.fps_base:.7g}")


def now(scene):
    """The time that a scene shows: a frame, or a part of the way to the next."""
    time = (scene.frame_current + scene.frame_subframe) * scene.render.frame_map_old / scene.render.frame_map_new
    return round(time) if abs(time - round(time)) < SAME else time


def go_to(scene, time):
    frame = time * scene.render.frame_map_new / scene.render.frame_map_old
    scene.frame_set(math.floor(frame), subframe=frame - math.floor(frame))


def words(time):
    """A time as users read it: 12, 12.5."""
    return f"{round(float(time), 4):.12g}"


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
