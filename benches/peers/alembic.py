"""Writes a capture as Alembic through Blender and reads it back: python alembic.py REST.npy FACES.npy FRAMES.npy OUT.abc, where `import bpy` works.

Prints JSON: bytes of the file, seconds of writing and reading, and the largest difference of what comes back.
"""

import json
import os
import struct
import sys
import tempfile
import time

import bpy
import numpy as np


def animated(rest, faces, frames, cache):
    """An object whose points follow a point cache, a frame of the scene each."""
    mesh = bpy.data.meshes.new("capture")
    mesh.from_pydata(rest.tolist(), [], faces.tolist())
    thing = bpy.data.objects.new("capture", mesh)
    bpy.context.scene.collection.objects.link(thing)
    with open(cache, "wb") as file:
        file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, frames.shape[1], 0.0, 1.0, len(frames)))
        file.write(frames.tobytes())
    modifier = thing.modifiers.new("cache", "MESH_CACHE")
    modifier.cache_format, modifier.filepath, modifier.frame_start = "PC2", cache, 1
    modifier.forward_axis, modifier.up_axis = "POS_Y", "POS_Z"


def positions(frame):
    bpy.context.scene.frame_set(frame)
    thing = next(o for o in bpy.context.scene.objects if o.type == "MESH")
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    found = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", found)
    # The reader turns the axes by the object's transform.
    return found.reshape(-1, 3)


def main():
    rest, faces, frames = (np.load(path) for path in sys.argv[1:4])
    frames, out = np.ascontiguousarray(frames, np.float32), sys.argv[4]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, len(frames)
    with tempfile.TemporaryDirectory() as folder:
        animated(rest, faces, frames, os.path.join(folder, "cache.pc2"))
        start = time.perf_counter()
        bpy.ops.wm.alembic_export(filepath=out, start=1, end=len(frames), uvs=False, normals=False, vcolors=False, orcos=False, export_hair=False, export_particles=False)
        write = time.perf_counter() - start
    bpy.ops.wm.read_factory_settings(use_empty=True)
    start = time.perf_counter()
    bpy.ops.wm.alembic_import(filepath=out, as_background_job=False)
    back = [positions(k + 1) for k in range(len(frames))]
    read = time.perf_counter() - start
    # Alembic's up is y: x y z come back as x z −y or as they were.
    turned = [np.stack([p[:, 0], -p[:, 2], p[:, 1]], 1) for p in back]
    apart = min(max(np.abs(a - b).max() for a, b in zip(kind, frames)) for kind in (back, turned))
    print(json.dumps({"bytes": os.path.getsize(out), "write": write, "read": read, "apart": float(apart)}))


if __name__ == "__main__":
    main()
