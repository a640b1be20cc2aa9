"""Brings back what `cager decode` has written beside the .blend file: the model of walk.pc2, and the cages of cages.pc2.

Run it in Blender's Scripting tab, with the object active that export.py has written. It gets a double that plays walk.pc2 by a Mesh
Cache modifier, and the cages become an object with one shape key for every frame, to be edited there and written by export.py.
"""

import os

import bpy
import numpy as np


def play(thing, path, first=None):
    """A double of an object as it is in the scene's first frame, moved by a file of positions from scene frame `first` on."""
    scene = bpy.context.scene
    first = scene.frame_start if first is None else first
    before = scene.frame_current
    scene.frame_set(scene.frame_start)
    shown = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = bpy.data.meshes.new_from_object(shown)
    scene.frame_set(before)
    frames = read_pc2(path)
    if frames.shape[1] != len(mesh.vertices):
        raise RuntimeError("%s has %d vertices and %s has %d: click on the object that was exported." %
                         (thing.name, len(mesh.vertices), os.path.basename(path), frames.shape[1]))
    # The file has positions in the world, so the object must not be moved as well.
    double = bpy.data.objects.new(thing.name + " decoded", mesh)
    scene.collection.objects.link(double)
    add_mesh_cache(double, path, first)
    return double


def add_mesh_cache(thing, path, first):
    """The settings with which frame 0 of a file is shown in frame `first` of the scene, and each frame in its own."""
    cache = thing.modifiers.new("cager", "MESH_CACHE")
    cache.cache_format = "PC2"
    cache.filepath = path
    cache.forward_axis, cache.up_axis = "POS_Y", "POS_Z"
    cache.deform_mode = "OVERWRITE"
    cache.play_mode, cache.time_mode = "SCENE", "FRAME"
    cache.frame_start, cache.frame_scale = first, 1
    return cache


def cages(rest, path, first=None):
    """An object of the rest cage, a shape key for every frame of `path`, each at its full value in its frame."""
    scene = bpy.context.scene
    first = scene.frame_start if first is None else first
    points, faces = read_obj(rest)
    frames = read_pc2(path)
    if frames.shape[1] != len(points):
        raise RuntimeError("%s has %d vertices and %s has %d: decode both from the same file." %
                         (os.path.basename(rest), len(points), os.path.basename(path), frames.shape[1]))
    mesh = bpy.data.meshes.new("cage")
    mesh.from_pydata(points, [], faces)
    cage = bpy.data.objects.new("cage", mesh)
    cage["cager"] = "cage"
    cage.display_type = "WIRE"
    scene.collection.objects.link(cage)
    cage.shape_key_add(name="rest")
    for k, frame in enumerate(frames):
        key = cage.shape_key_add(name="frame %d" % (first + k))
        key.data.foreach_set("co", frame.ravel())
        for t, value in ((-1, 0), (0, 1), (1, 0)):
            key.value = value
            key.keyframe_insert("value", frame=first + k + t)
    return cage


def read_pc2(path):
    with open(path, "rb") as file:
        head = file.read(32)
        if head[:12] != b"POINTCACHE2\0":
            raise RuntimeError("%s is no .pc2 file: decode with -o NAME.pc2." % path)
        points, frames = (int.from_bytes(head[at:at + 4], "little") for at in (16, 28))
        return np.fromfile(file, "<f4").reshape(frames, points, 3)


def read_obj(path):
    points, faces = [], []
    with open(path) as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(word) - 1 for word in words[1:]])
    return points, faces


if __name__ == "__main__":
    beside = lambda name: os.path.join(bpy.path.abspath("//") or os.getcwd(), name)
    active = bpy.context.view_layer.objects.active
    if active is None:
        raise RuntimeError("Nothing is active: click on the object that was exported, then run this again.")
    if os.path.exists(beside("walk.pc2")):
        print("%s plays walk.pc2" % play(active, beside("walk.pc2")).name)
    if os.path.exists(beside("cages.pc2")):
        print("%s has the cages of cages.pc2" % cages(beside("cages.cage.obj"), beside("cages.pc2")).name)
