"""Caches that Blender plays without this extension, as on render farms: a point cache beside the .blend file, and a modifier that reads it."""

import os
import struct
import zlib

import bpy
import numpy as np
from bpy.app.handlers import persistent

from . import captures, handlers, paths
from .reading import Refused
from .times import SAME

NAME = "CageR bake"
# By the whole name of the model: whether what it shows has changed since it was baked.
stale = set()


def modifier_of(model):
    """The modifier that plays what was baked; None without one."""
    found = model.modifiers.get(NAME)
    return found if found and found.type == "MESH_CACHE" else None


def switch(model, is_on):
    """Lets a model play what was baked, or the capture."""
    found = modifier_of(model)
    if found and not paths.library_of(model) and (found.show_viewport, found.show_render) != (is_on, is_on):
        found.show_viewport = found.show_render = is_on


def bake(model, capture):
    """Writes a capture that is seen, edits included, and lets a modifier of its model read it; returns the path. Raises CagerError, OSError and Refused."""
    if not bpy.data.filepath:
        raise Refused("The cache is put beside the .blend file, which is not saved yet: save it first.")
    opened = captures.of_model(model)
    name = bpy.path.clean_name(f"{bpy.path.display_name_from_filepath(bpy.data.filepath)} {model.name}") + ".pc2"
    path = os.path.join(os.path.dirname(bpy.data.filepath), name)
    write(path, (opened.relative(frame) for frame in capture), len(capture), len(model.data.vertices))
    place(model, "//" + name, model.cager.first + opened.times)
    model.cager.baked = signature(model)
    stale.discard(model.name_full)
    return path


def write(path, frames, count, points):
    """Writes a point cache, which appears whole or not at all."""
    unfinished = path + ".part"
    try:
        with open(unfinished, "wb") as file:
            file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, points, 0, 1, count))
            for frame in frames:
                file.write(np.ascontiguousarray(frame, "<f4").tobytes())
        os.replace(unfinished, path)
    finally:
        if os.path.exists(unfinished):
            os.remove(unfinished)


def place(model, path, times):
    """Lets a modifier, before all others, show a cache whose frames are at these times."""
    old = modifier_of(model)
    if old:
        model.modifiers.remove(old)
    data_path = f'modifiers["{NAME}"].eval_frame'
    curves = curves_of(model)
    for curve in [each for each in curves if each.data_path == data_path]:
        curves.remove(curve)
    found = model.modifiers.new(NAME, "MESH_CACHE")
    model.modifiers.move(len(model.modifiers) - 1, 0)
    found.cache_format, found.filepath, found.time_mode = "PC2", path, "FRAME"
    found.show_viewport = found.show_render = False
    steps = np.diff(times)
    step = steps[0] if len(steps) else 1
    if np.abs(steps - step).max(initial=0) <= SAME:
        # Blender scales the scene's time before it subtracts the start.
        found.play_mode, found.frame_start, found.frame_scale = "SCENE", times[0] / step, 1 / step
        return
    # Times that are uneven: which frame of the cache is shown is keyed.
    found.play_mode = "CUSTOM"
    for frame, time in enumerate(times.tolist()):
        found.eval_frame = frame
        model.keyframe_insert(data_path, frame=time)
    for curve in curves_of(model):
        if curve.data_path == data_path:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"


def curves_of(thing):
    """The curves of an object's animation, which can be removed from what is returned."""
    animation = thing.animation_data
    if not (animation and animation.action):
        return ()
    return animation.action.fcurves


def signature(model):
    """What tells whether a model shows what was baked: its file, and all that is edited of its cage but animations of the user's own."""
    path, cage = paths.found(model), model.cager.cage
    about = os.stat(path)
    found = zlib.crc32(repr((os.path.basename(path), about.st_size, about.st_mtime_ns, model.cager.first)).encode())
    keys = cage and cage.data.shape_keys
    for key in keys.key_blocks if keys else ():
        points = np.empty(3 * len(key.data), np.float32)
        key.data.foreach_get("co", points)
        found = zlib.crc32(points.tobytes(), zlib.crc32(key.name.encode(), found))
    return f"{found:08x}"


def compare(model):
    """Notes whether what was baked is old."""
    name = model.name_full
    try:
        is_stale = modifier_of(model) is not None and signature(model) != model.cager.baked
    except OSError:
        return
    if is_stale and name not in stale:
        print(f"CageR: {name}: has changed since it was baked for rendering: bake it again")
    (stale.add if is_stale else stale.discard)(name)


def models():
    return [thing for thing in getattr(bpy.data, "objects", ()) if thing.type == "MESH" and thing.cager.file and modifier_of(thing)]


def switch_all(is_on):
    for model in models():
        switch(model, is_on)


@persistent
def before_saving(*_):
    """In the .blend file what was baked is switched on, for machines without this extension."""
    for model in models():
        compare(model)
    switch_all(True)


@persistent
def after_saving(*_):
    switch_all(False)


HANDLERS = (("save_pre", before_saving), ("save_post", after_saving), ("save_post_fail", after_saving), ("load_post", after_saving))


def register():
    handlers.add(HANDLERS)
    switch_all(False)


def unregister():
    switch_all(True)
    handlers.remove(HANDLERS)
    stale.clear()
