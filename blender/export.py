"""Writes the active object of every frame of the scene, for `cager encode`: rest.obj and frames.npy beside the .blend file.

Run it in Blender's Scripting tab, with the animated object active. Another mesh that is selected beside it is its cage, written as
cage.obj. With a cage active that import.py has brought in, it writes edited.npy, for `cager decode --with-cages`.
"""

import os

import bmesh
import bpy
import numpy as np


def export(thing=None, cage=None, folder=None):
    """The files of an animated object, of its cage where one is given, or of edited cages; returns what was written, in words."""
    thing = thing or bpy.context.view_layer.objects.active
    if thing is None:
        raise RuntimeError("Nothing is active: click on the animated object, then run this again.")
    if thing.type not in {"MESH", "CURVE", "SURFACE", "META", "FONT"}:
        raise RuntimeError("%s is no mesh but of type %s: click on the mesh that it moves." % (thing.name, thing.type))
    folder = folder or bpy.path.abspath("//") or os.getcwd()
    frames, faces = positions(thing)
    shape = "%d frames of %d vertices" % (len(frames), len(frames[0]))
    if thing.get("cager") == "cage":
        np.save(os.path.join(folder, "edited.npy"), frames)
        return "edited.npy: %s" % shape
    np.save(os.path.join(folder, "frames.npy"), frames)
    write_obj(os.path.join(folder, "rest.obj"), frames[0], faces)
    said = "rest.obj and frames.npy: %s, in %s" % (shape, folder)
    return said if cage is None else said + "\n" + export_cage(cage, os.path.join(folder, "cage.obj"))


def positions(thing):
    """Where the vertices are in the world in every frame of the scene, all modifiers applied, and the faces."""
    scene, before = bpy.context.scene, bpy.context.scene.frame_current
    frames, faces = [], []
    try:
        for t in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(t)
            shown = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
            mesh = shown.to_mesh()
            points = np.empty(3 * len(mesh.vertices))
            mesh.vertices.foreach_get("co", points)
            if not frames:
                faces = [list(face.vertices) for face in mesh.polygons]
            shown.to_mesh_clear()
            world = np.array(shown.matrix_world)
            frames.append((points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]).astype(np.float32))
            if len(frames[-1]) != len(frames[0]):
                raise RuntimeError(
                    "%s has %d vertices in frame %d and %d in frame %d: switch off the modifiers that remesh, decimate or cut it."
                    % (thing.name, len(frames[0]), scene.frame_start, len(frames[-1]), t))
    finally:
        scene.frame_set(before)
    if not len(frames[0]):
        raise RuntimeError("%s has no vertices in frame %d: click on the mesh that is seen." % (thing.name, scene.frame_start))
    return np.asarray(frames), faces


def export_cage(thing, path):
    """A cage as it is in the scene's first frame: vertices in one place welded, holes closed, faces turned outwards."""
    scene, before = bpy.context.scene, bpy.context.scene.frame_current
    scene.frame_set(scene.frame_start)
    shown = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = bmesh.new()
    mesh.from_mesh(shown.to_mesh())
    shown.to_mesh_clear()
    mesh.transform(shown.matrix_world)
    scene.frame_set(before)
    there = len(mesh.verts)
    bmesh.ops.remove_doubles(mesh, verts=mesh.verts, dist=1e-6 * max(shown.dimensions))
    bmesh.ops.delete(mesh, geom=[v for v in mesh.verts if not v.link_faces], context="VERTS")
    welded = there - len(mesh.verts)
    holes = [edge for edge in mesh.edges if edge.is_boundary]
    bmesh.ops.holes_fill(mesh, edges=holes, sides=0)
    bmesh.ops.recalc_face_normals(mesh, faces=mesh.faces)
    if mesh.calc_volume(signed=True) < 0:
        bmesh.ops.reverse_faces(mesh, faces=mesh.faces)
    open_edges = sum(not edge.is_manifold for edge in mesh.edges)
    if open_edges:
        raise RuntimeError("%s stays open or has inner walls at %d edges: Select > All by Trait > Non Manifold shows them." %
                         (thing.name, open_edges))
    mesh.verts.index_update()
    write_obj(path, [tuple(v.co) for v in mesh.verts], [[v.index for v in face.verts] for face in mesh.faces])
    said = "%s: %d vertices" % (os.path.basename(path), len(mesh.verts))
    mesh.free()
    return said + (", %d welded" % welded if welded else "") + (", its holes closed" if holes else "")


def write_obj(path, points, faces):
    with open(path, "w") as out:
        out.writelines("v %r %r %r\n" % tuple(map(float, point)) for point in points)
        out.writelines("f %s\n" % " ".join(str(v + 1) for v in face) for face in faces)


if __name__ == "__main__":
    active = bpy.context.view_layer.objects.active
    others = [thing for thing in bpy.context.selected_objects if thing != active and thing.type == "MESH"]
    if len(others) > 1:
        raise RuntimeError("%d objects are selected beside %s: select its cage alone." % (len(others), active.name))
    print(export(active, others[0] if others else None))
