"""Objects that show a capture: the model, and its cage with a shape key for every frame, below an empty."""

import math
import os

import bpy
import cager

from . import captures, keys, paths
from .times import LAST_FRAME

# Units that differ by less are the same, as in the command line.
SAME_UNIT = 1e-5


def unit(scene):
    """Metres of Blender's unit, which is in single precision; None where the scene has none."""
    settings = scene.unit_settings
    return None if settings.system == "NONE" else float(f"{settings.scale_length:.6g}")


def add(context, path, first=None, up=None, with_cage=True, to_unit=True):
    """Adds a capture to the scene, where and when it says that it is unless `first` and `up` do; returns its model. Raises CagerError."""
    whole = paths.chosen(path)
    opened = captures.of_path(whole)
    capture = opened.capture
    first = math.floor(capture.times[0]) if first is None else first
    last = math.ceil(first + opened.times[-1])
    if last > LAST_FRAME or first < -LAST_FRAME:
        raise cager.CagerError(f"{path}: would begin in frame {first} and end in frame {last}, and Blender's last is {LAST_FRAME}: choose an earlier first frame")
    # A damaged file is found here, before anything is added.
    rest, faces, cage_faces = capture.rest, capture.faces, capture.cage_faces
    name = os.path.splitext(os.path.basename(whole))[0]
    root = bpy.data.objects.new(name, None)
    root.empty_display_size = 0.1
    here = unit(context.scene)
    scale = capture.unit / here if to_unit and capture.unit and here else 1
    if abs(scale - 1) <= SAME_UNIT:
        scale = 1
    root.scale = (scale, scale, scale)
    x, y, z = scale * opened.offset
    root.location = (x, y, z)
    if (up or capture.up) == "y":
        root.rotation_euler.x = math.pi / 2
        root.location = (x, -z, y)
    context.collection.objects.link(root)
    model = child(context, root, name + " model", rest - opened.offset, faces)
    model.data.shade_smooth()
    # Its place is that of the empty: moved by itself, it would leave its cage.
    model.lock_location = model.lock_rotation = model.lock_scale = (True, True, True)
    if with_cage:
        cage = child(context, root, name + " cage", opened.rest_cage - opened.offset, cage_faces)
        cage.display_type = "WIRE"
        cage.hide_render = True
        keys.add(cage, opened.cages, first + opened.times)
        model.cager.cage = cage
        # Blender does not evaluate what is hidden, unless what is seen depends on it. Unbound, the modifier does nothing else.
        model.modifiers.new("Follows its cage", "MESH_DEFORM").object = cage
    model.cager.first = first
    # From now on it is shown.
    model.cager.file = paths.kept(path)
    return model


def child(context, root, name, points, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], [face.tolist() for face in faces])
    thing = bpy.data.objects.new(name, mesh)
    thing.parent = root
    context.collection.objects.link(thing)
    return thing
