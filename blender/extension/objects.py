"""Objects that show a capture: the model, and its cage with a shape key for every frame, below an empty."""

import math
import os

import bpy

from . import captures


def add(context, path, first, y_is_up=False, with_cage=True):
    """Adds a capture to the scene; returns its model. Raises CagerError."""
    opened = captures.of_path(path)
    name = os.path.splitext(os.path.basename(path))[0]
    root = bpy.data.objects.new(name, None)
    root.empty_display_size = 0.1
    root.location = opened.offset
    if y_is_up:
        root.rotation_euler.x = math.pi / 2
        root.location = [opened.offset[0], -opened.offset[2], opened.offset[1]]
    context.collection.objects.link(root)
    model = child(context, root, name + " model", opened.capture.rest - opened.offset, opened.capture.faces)
    model.data.shade_smooth()
    # Its place is that of the empty: moved by itself, it would leave its cage.
    model.lock_location = model.lock_rotation = model.lock_scale = (True, True, True)
    if with_cage:
        cage = child(context, root, name + " cage", opened.rest_cage - opened.offset, opened.capture.cage_faces)
        cage.display_type = "WIRE"
        cage.hide_render = True
        key_frames(cage, opened.cages, first)
        model.cager.cage = cage
        # Blender does not evaluate what is hidden, unless what is seen depends on it. Unbound, the modifier does nothing else.
        model.modifiers.new("Follows its cage", "MESH_DEFORM").object = cage
    model.cager.first = first
    # From now on it is shown.
    model.cager.file = path
    return model


def child(context, root, name, points, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], [face.tolist() for face in faces])
    thing = bpy.data.objects.new(name, mesh)
    thing.parent = root
    context.collection.objects.link(thing)
    return thing


def key_frames(cage, cages, first):
    """A shape key for each frame, at its full value there and at none in the frames beside it."""
    cage.shape_key_add(name="rest", from_mix=False)
    for k, points in enumerate(cages):
        key = cage.shape_key_add(name=key_name(first + k), from_mix=False)
        key.data.foreach_set("co", points.ravel())
        for step, value in ((-1, 0), (1, 0), (0, 1)):
            # The first holds before the capture begins, and the last after its end.
            if 0 <= k + step < len(cages):
                key.value = value
                key.keyframe_insert("value", frame=first + k + step)


def key_name(scene_frame):
    return f"frame {scene_frame}"
