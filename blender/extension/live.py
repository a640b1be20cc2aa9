"""Shows the captures of a scene in every frame, and models in their cages while these are edited."""

from contextlib import contextmanager

import bpy
import cager
import numpy as np
from bpy.app.handlers import persistent

from . import captures
from .reading import cage_seen

# By the name of the model: what cannot be shown and why, and the frame and cage that were shown last.
problems, _last = {}, {}
_is_paused = False


@contextmanager
def paused():
    """Leaves models as they are while frames are gone through."""
    global _is_paused
    before, _is_paused = _is_paused, True
    try:
        yield
    finally:
        _is_paused = before


def cage_of(model, depsgraph):
    """The cage of a model as it is seen; None without one. Raises CagerError where it has other vertices than the capture's."""
    cage = model.cager.cage
    if cage is None or cage.name not in depsgraph.scene.objects:
        return None
    points, count = cage_seen(model, cage, depsgraph), captures.of_model(model).cages.shape[1]
    if len(points) != count:
        raise cager.CagerError(
            f"{cage.name} has {len(points)} vertices where the capture's cage has {count}: neither add nor remove any, and take off modifiers that do"
        )
    return points


def show(model, scene, depsgraph, only_if_new=False):
    """Shows a model in the scene's frame, in its cage where that was edited."""
    try:
        opened, frame = captures.of_model(model), captures.frame_of(model, scene.frame_current)
        points = cage_of(model, depsgraph)
        last = _last.get(model.name)
        if only_if_new and last and last[0] == frame and np.array_equal(last[1], points):
            return
        edited = None if points is None else opened.edited(frame, points)
        write(model.data, opened.positions(frame) if edited is None else opened.posed(edited))
        _last[model.name] = frame, points
        problems.pop(model.name, None)
    except (cager.CagerError, OSError) as error:
        # It is opened again as soon as it can be.
        captures.forget(model.cager.file)
        if problems.get(model.name) != str(error):
            print(f"CageR: {model.name}: {error}")
        problems[model.name] = str(error)


def write(mesh, positions):
    if len(mesh.vertices) != len(positions):
        raise cager.CagerError(
            f"{mesh.name} has {len(mesh.vertices)} vertices where the capture has {len(positions)}: import the capture again"
        )
    mesh.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(positions, np.float32).ravel())
    mesh.update()


def show_all(scene, depsgraph=None):
    if _is_paused:
        return
    for model in captures.models(scene):
        show(model, scene, depsgraph or bpy.context.evaluated_depsgraph_get())


@persistent
def on_frame(scene, depsgraph=None):
    show_all(scene, depsgraph)


@persistent
def on_edit(scene, depsgraph):
    if _is_paused:
        return
    changed = {update.id.original for update in depsgraph.updates if update.is_updated_geometry or update.is_updated_transform}
    for model in captures.models(scene) if changed else ():
        cage = model.cager.cage
        if cage and {cage, cage.data, cage.data.shape_keys} & changed:
            show(model, scene, depsgraph, only_if_new=True)


@persistent
def on_undo(*_):
    _last.clear()
    if bpy.context.scene:
        show_all(bpy.context.scene)


@persistent
def on_load(*_):
    captures.forget()
    problems.clear()
    on_undo()


HANDLERS = (
    ("frame_change_post", on_frame),
    ("depsgraph_update_post", on_edit),
    ("load_post", on_load),
    ("undo_post", on_undo),
    ("redo_post", on_undo),
)


def register():
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    for name, handler in HANDLERS:
        there = getattr(bpy.app.handlers, name)
        if handler in there:
            there.remove(handler)
    problems.clear()
    _last.clear()
