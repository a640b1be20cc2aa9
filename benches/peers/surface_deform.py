"""Blender's Surface Deform: the target, bound to the source at rest, follows the source's frames. Run by benches/transfers.py with the Python that has bpy.

`surface_deform.py IN.npz OUT.npy`: IN holds source, faces, frames, target and target_faces. Prints {"prepare": s, "frames": s}.
"""

import json
import sys
import time

import bpy
import numpy as np


def mesh(name, points, faces):
    data = bpy.data.meshes.new(name)
    data.from_pydata(points.tolist(), [], faces.tolist())
    data.update()
    thing = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(thing)
    return thing


def main():
    given = np.load(sys.argv[1])
    clock = time.perf_counter()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    source, target = mesh("source", given["source"], given["faces"]), mesh("target", given["target"], given["target_faces"])
    modifier = target.modifiers.new("follow", "SURFACE_DEFORM")
    modifier.target = source
    bpy.context.view_layer.objects.active = target
    bpy.context.view_layer.update()
    bpy.ops.object.surfacedeform_bind(modifier=modifier.name)
    if not modifier.is_bound:
        sys.exit("Blender cannot bind the target to the source")
    prepared, clock = time.perf_counter() - clock, time.perf_counter()
    shapes = []
    for frame in given["frames"]:
        source.data.vertices.foreach_set("co", np.ascontiguousarray(frame, dtype=np.float32).ravel())
        source.data.update()
        evaluated = target.evaluated_get(bpy.context.evaluated_depsgraph_get())
        shape = np.empty((len(given["target"]), 3), dtype=np.float32)
        evaluated.data.vertices.foreach_get("co", shape.ravel())
        shapes.append(shape)
    np.save(sys.argv[2], np.array(shapes))
    print(json.dumps({"prepare": prepared, "frames": time.perf_counter() - clock}))


if __name__ == "__main__":
    main()
