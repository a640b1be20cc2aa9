"""What is encoded is what is seen: of other captures, of hidden and mirrored objects, and of what is being edited."""

import bpy
import cager
import numpy as np
import pytest

from conftest import add, part, seen, tube, world


def encoded(thing, path, **settings):
    scene = bpy.context.scene
    bpy.context.view_layer.objects.active = thing
    for name, value in ({"vertices": 20, "show": False} | settings).items():
        setattr(scene.cager, name, value)
    assert bpy.ops.cager.encode(filepath=path) == {"FINISHED"}
    return cager.open(path)


def is_as_seen(capture, thing, frames=(1, 6, 10), error=0.05):
    scene = bpy.context.scene
    size = np.linalg.norm(np.ptp(world(scene, thing, 1), axis=0))
    return all(np.abs(capture[frame - 1] - world(scene, thing, frame)).max() <= error * size for frame in frames)


@pytest.fixture
def moving(scene):
    """A tube that is carried along, and grows by a shape key."""
    thing = add("Tube", *tube(12, 16, 0.4, 1.0))
    thing.shape_key_add(name="rest")
    key = thing.shape_key_add(name="thick")
    for point in key.data:
        point.co *= 1.5
    for frame, place, value in ((1, 0, 0), (10, 0.8, 1)):
        thing.location.x, key.value = place, value
        thing.keyframe_insert("location", frame=frame)
        key.keyframe_insert("value", frame=frame)
    return thing


def test_a_shown_capture_is_encoded_as_it_plays(scene, small, tmp_path):
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    capture = encoded(model, str(tmp_path / "again.cager"), keep="ERROR", max_error=0.1)
    assert np.abs(capture.decode() - small.capture.decode()).max() <= 0.0011 * small.diagonal


def test_a_capture_that_does_not_play_is_refused(scene, small, tmp_path):
    bpy.ops.cager.import_capture(filepath=small.path)
    bpy.context.object.cager.file = "/nowhere/gone.cager"
    with pytest.raises(RuntimeError, match="small model does not play: .*gone.cager"):
        encoded(bpy.context.object, str(tmp_path / "again.cager"))


def test_what_hangs_on_a_shown_capture_moves_with_it(scene, small, tmp_path):
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    scene.frame_set(1)
    garment = add("Garment", *tube(8, 12, 0.55, 0.8))
    bound = garment.modifiers.new("bound", "SURFACE_DEFORM")
    bound.target = model
    bpy.context.view_layer.objects.active = garment
    bpy.ops.object.surfacedeform_bind(modifier="bound")
    assert bound.is_bound
    capture = encoded(garment, str(tmp_path / "garment.cager"))
    assert np.abs(capture[5] - capture[0]).max() > 0.1 and is_as_seen(capture, garment)


def test_a_cage_that_hangs_on_another_capture_is_saved_as_it_is_seen(scene, small):
    bpy.ops.cager.import_capture(filepath=small.path)
    other = bpy.context.object
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    cage = model.cager.cage
    scene.frame_set(1)
    cage.modifiers.new("bound", "SURFACE_DEFORM").target = other
    bpy.context.view_layer.objects.active = cage
    bpy.ops.object.surfacedeform_bind(modifier="bound")
    scene.frame_set(6)
    there = seen(cage).copy()
    assert np.abs(there - small.capture.cages[5]).max() > 0.1 * small.diagonal
    scene.frame_set(1)
    capture, _ = part("edits").edited_capture(bpy.context, model)
    assert np.abs(capture.cages[5] - there).max() <= 1e-5 * small.diagonal


def hide_by_collection(thing, excluded):
    collection = bpy.data.collections.new("hidden")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(thing)
    bpy.context.scene.collection.objects.unlink(thing)
    bpy.context.view_layer.objects.active = thing
    if excluded:
        bpy.context.view_layer.layer_collection.children["hidden"].exclude = True
    else:
        collection.hide_viewport = True


HIDING = {
    "viewports": lambda thing: setattr(thing, "hide_viewport", True),
    "eye": lambda thing: thing.hide_set(True),
    "collection": lambda thing: hide_by_collection(thing, False),
    "excluded": lambda thing: hide_by_collection(thing, True),
}


@pytest.mark.parametrize("how", ["viewports", "eye", "collection"])
def test_a_hidden_object_is_read_as_if_it_was_shown(scene, moving, tmp_path, how):
    truth = [world(scene, moving, frame) for frame in (1, 10)]
    scene.frame_set(1)
    HIDING[how](moving)
    collections = list(moving.users_collection)
    capture = encoded(moving, str(tmp_path / "tube.cager"))
    assert all(np.abs(capture[frame] - points).max() <= 0.05 for frame, points in zip((0, 9), truth))
    assert not moving.visible_get() and list(moving.users_collection) == collections


@pytest.mark.parametrize("how", HIDING)
def test_a_hidden_cage_is_read_where_it_is(scene, moving, tmp_path, how):
    points, faces = tube(6, 8, 0.9, 1.6)
    cage = add("Cage", points, faces)
    bpy.context.view_layer.update()
    HIDING[how](cage)
    cage.scale = (2, 2, 2)
    capture = encoded(moving, str(tmp_path / "tube.cager"), cage=cage)
    assert np.allclose(np.ptp(capture.rest_cage, axis=0), 2 * np.ptp(points, axis=0), atol=1e-5)
    assert not cage.visible_get()


def test_what_an_animation_hides_is_refused(scene, moving, tmp_path):
    moving.hide_viewport = True
    moving.keyframe_insert("hide_viewport", frame=1)
    scene.frame_set(2)
    with pytest.raises(RuntimeError, match="Tube is hidden in frame 1: show it in the viewport"):
        encoded(moving, str(tmp_path / "tube.cager"))


def test_shape_keys_count_in_edit_mode_too(scene, moving, tmp_path):
    bpy.context.view_layer.objects.active = moving
    bpy.ops.object.mode_set(mode="EDIT")
    assert is_as_seen(encoded(moving, str(tmp_path / "tube.cager")), moving)
    job = part("encoding").Encoding(bpy.context, moving, "unused.cager")
    job.step(bpy.context, seconds=0)
    bpy.ops.object.mode_set(mode="EDIT")
    assert job.step(bpy.context, seconds=0) and "stay in Object Mode" in job.error
    bpy.ops.object.mode_set(mode="OBJECT")


def test_another_scene_meanwhile_ends_the_reading(scene, moving):
    job = part("encoding").Encoding(bpy.context, moving, "unused.cager")
    job.step(bpy.context, seconds=0)
    bpy.context.window.scene = bpy.data.scenes.new("second")
    assert job.step(bpy.context, seconds=0) and "stay in its scene" in job.error


def volume(capture):
    points = capture.rest
    corners = [(face[0], face[k], face[k + 1]) for face in capture.faces for k in range(1, len(face) - 1)]
    return sum(np.dot(points[a], np.cross(points[b], points[c])) for a, b, c in corners) / 6


def test_what_is_mirrored_keeps_its_outside(scene, tmp_path):
    points, faces = tube(12, 16, 0.4, 1.0)
    quads = [face for face in faces if len(face) == 4]
    for kind, faces in (("all", faces), ("quads", quads)):
        volumes = []
        for scale in (1, -1):
            thing = add(kind, points, faces)
            thing.scale.x = scale
            volumes.append(volume(encoded(thing, str(tmp_path / f"{kind}{scale}.cager"))))
        assert volumes[0] > 0 and np.isclose(*volumes, rtol=1e-3)
