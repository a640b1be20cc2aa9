"""Shows the captures of a scene in every frame, and models in their cages while these are edited."""

from contextlib import contextmanager

import bpy
import cager
import numpy as np
from bpy.app.handlers import persistent

from . import bake, captures, handlers, keys, paths, times
from .reading import cage_seen

# By the whole name of the model: what cannot be shown and why, and the place and cage that were shown last.
problems, _last = {}, {}
_paused = None


@contextmanager
def paused(model):
    """Leaves a model as it is while frames are gone through. Its cage and other captures go on, which its cage may hang on."""
    global _paused
    _paused = model
    try:
        yield
    finally:
        _paused = None


def cage_of(model, depsgraph):
    """The cage of a model as it is seen; None without one. Raises CagerError where it has other vertices than the capture's."""
    cage = model.cager.cage
    if cage is None or not cage.evaluated_get(depsgraph).is_evaluated:
        return None
    points, count = cage_seen(model, cage, depsgraph), captures.of_model(model).cages.shape[1]
    if len(points) != count:
        raise cager.CagerError(
            f"{cage.name} has {len(points)} vertices where the capture's cage has {count}: neither add nor remove any, and take off modifiers that do"
        )
    return points


def show(model, scene, depsgraph, only_if_new=False):
    """Shows a model at the scene's time, in its cage where that was edited."""
    name = model.name_full
    try:
        opened, place = captures.of_model(model), captures.place_of(model, times.now(scene))
        points = cage_of(model, depsgraph)
        last = _last.get(name)
        if only_if_new and last and last[0] == place and np.array_equal(last[1], points):
            return
        edited = None if points is None else opened.edited(points, *place)
        write(model.data, opened.positions(*place) if edited is None else opened.posed(edited) + opened.details(*place))
        _last[name] = place, points
        if problems.pop(name, None):
            bake.switch(model, False)
    except (cager.CagerError, OSError) as error:
        # It is opened again as soon as it can be.
        captures.forget(paths.found(model))
        if problems.get(name) != str(error):
            print(f"CageR: {name}: {error}")
            # What was baked is better than a model that stands still.
            bake.switch(model, True)
        problems[name] = str(error)


def write(mesh, positions):
    if len(mesh.vertices) != len(positions):
        raise cager.CagerError(
            f"{mesh.name} has {len(mesh.vertices)} vertices where the capture has {len(positions)}: import the capture again"
        )
    places = mesh.attributes["position"].data
    if mesh.library:
        # Blender writes meshes of libraries one by one alone.
        for place, position in zip(places, positions.tolist()):
            place.vector = position
    else:
        places.foreach_set("vector", np.ascontiguousarray(positions, np.float32).ravel())
    mesh.update()


def pose_cages(scene):
    """Lets the cages of a scene follow its time."""
    for model in captures.models(scene):
        cage = model.cager.cage
        if cage and cage.data.shape_keys:
            try:
                frame, part = captures.place_of(model, times.now(scene))
                around = [captures.time_of(model, k) for k in ((frame, frame + 1) if part else (frame,))]
                keys.weigh(cage.data.shape_keys.key_blocks, around, part)
            except (cager.CagerError, OSError):
                # Why, is told as the model is shown.
                pass


def show_all(scene, depsgraph=None):
    for model in captures.models(scene):
        if model != _paused:
            show(model, scene, depsgraph or bpy.context.evaluated_depsgraph_get())


@persistent
def before_frame(scene, _=None):
    pose_cages(scene)


@persistent
def on_frame(scene, depsgraph=None):
    show_all(scene, depsgraph)


@persistent
def on_edit(scene, depsgraph):
    changed = {update.id.original for update in depsgraph.updates if update.is_updated_geometry or update.is_updated_transform}
    for model in captures.models(scene) if changed else ():
        cage = model.cager.cage
        if cage and model != _paused and {cage, cage.data, cage.data.shape_keys} & changed:
            show(model, scene, depsgraph, only_if_new=True)


@persistent
def on_undo(*_):
    _last.clear()
    if bpy.context.scene:
        pose_cages(bpy.context.scene)
        show_all(bpy.context.scene)


@persistent
def on_load(*_):
    captures.forget()
    problems.clear()
    on_undo()


HANDLERS = (
    ("frame_change_pre", before_frame),
    ("frame_change_post", on_frame),
    ("depsgraph_update_post", on_edit),
    ("load_post", on_load),
    ("undo_post", on_undo),
    ("redo_post", on_undo),
)


def register():
    handlers.add(HANDLERS)


def unregister():
    handlers.remove(HANDLERS)
    problems.clear()
    _last.clear()
