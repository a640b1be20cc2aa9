"""Reads what Blender shows: positions of evaluated meshes, their faces, and cages as they are seen."""

from contextlib import contextmanager

import bmesh
import numpy as np

KINDS = {"MESH", "CURVE", "SURFACE", "META", "FONT"}


class Refused(Exception):
    """What was given cannot be used; the message says what to do."""


def coordinates(mesh):
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3)


def placed(points, matrix):
    """Points moved by a matrix, in double precision between."""
    matrix = np.array(matrix)
    return (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)


def faces(mesh):
    """Vertices of each face: an array where all have as many, else a list."""
    corners, starts = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    mesh.polygons.foreach_get("loop_start", starts)
    each = np.split(corners, starts[1:]) if len(starts) else []
    same = len({len(face) for face in each}) == 1
    return np.array(each) if same and len(each[0]) in (3, 4) else [face.tolist() for face in each]


def turned(faces):
    return faces[:, ::-1] if isinstance(faces, np.ndarray) else [face[::-1] for face in faces]


@contextmanager
def switched_on(context, things):
    """Objects as if none was hidden, as Blender does not go on with what is."""
    layer, everything = context.view_layer, context.scene.collection.objects
    hidden = [thing for thing in things if not thing.visible_get(view_layer=layer)]
    before = [(thing, thing.hide_viewport, thing.hide_get(view_layer=layer), thing in everything.values()) for thing in hidden]
    try:
        for thing, _, _, is_there in before:
            # What is in the scene's own collection is in none that is switched off.
            if not is_there:
                everything.link(thing)
            thing.hide_viewport = False
            thing.hide_set(False, view_layer=layer)
        yield
    finally:
        for thing, is_off, is_hidden, is_there in before:
            if not is_there:
                everything.unlink(thing)
            thing.hide_viewport = is_off
            if is_hidden:
                thing.hide_set(True, view_layer=layer)


def seen(thing, depsgraph, with_faces=False):
    """Positions of an object in the world, modifiers applied, and its faces."""
    shown = thing.evaluated_get(depsgraph)
    mesh = shown.to_mesh()
    try:
        points = placed(coordinates(mesh), shown.matrix_world)
        # What is mirrored has its faces the other way round.
        is_mirrored = shown.matrix_world.determinant() < 0
        return points, (turned(faces(mesh)) if is_mirrored else faces(mesh)) if with_faces else None
    finally:
        shown.to_mesh_clear()


def cage_seen(model, cage, depsgraph):
    """Vertices of a cage as it is seen, in the coordinates of its model."""
    if cage.mode == "EDIT":
        mesh = bmesh.from_edit_mesh(cage.data)
        points = np.array([vertex.co for vertex in mesh.verts], np.float32)
    else:
        points = coordinates(cage.evaluated_get(depsgraph).data)
    here, there = model.evaluated_get(depsgraph).matrix_world, cage.evaluated_get(depsgraph).matrix_world
    return points if here == there else placed(points, np.linalg.inv(np.array(here)) @ np.array(there))


def closed_cage(thing, depsgraph):
    """A cage as it is in the world: vertices in one place welded, holes closed, faces turned outwards. Raises Refused."""
    shown = thing.evaluated_get(depsgraph)
    mesh = bmesh.new()
    try:
        mesh.from_mesh(shown.to_mesh())
        shown.to_mesh_clear()
        mesh.transform(shown.matrix_world)
        bmesh.ops.remove_doubles(mesh, verts=mesh.verts, dist=1e-6 * max(shown.dimensions))
        bmesh.ops.delete(mesh, geom=[vertex for vertex in mesh.verts if not vertex.link_faces], context="VERTS")
        bmesh.ops.holes_fill(mesh, edges=[edge for edge in mesh.edges if edge.is_boundary], sides=0)
        bmesh.ops.recalc_face_normals(mesh, faces=mesh.faces)
        if mesh.calc_volume(signed=True) < 0:
            bmesh.ops.reverse_faces(mesh, faces=mesh.faces)
        if not mesh.faces:
            raise Refused(f"{thing.name} has no faces: choose a closed mesh as the cage, or none.")
        open_edges = sum(not edge.is_manifold for edge in mesh.edges)
        if open_edges:
            raise Refused(
                f"{thing.name} stays open or has inner walls at {open_edges} edges: in Edit Mode, Select > All by Trait > Non Manifold shows them."
            )
        mesh.verts.index_update()
        return np.array([vertex.co for vertex in mesh.verts]), [[vertex.index for vertex in face.verts] for face in mesh.faces]
    finally:
        mesh.free()
