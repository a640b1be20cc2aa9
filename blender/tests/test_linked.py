"""Captures of other .blend files play: linked, overridden, appended, and as instances of collections."""

import os

import bpy
import numpy as np
import pytest

from conftest import MODULE, part, seen
from test_panel import drawn


@pytest.fixture
def library(scene, small, tmp_path):
    """A .blend file with a capture in the collection `asset`, and a path that is relative to its folder."""
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.cager.import_capture(filepath=small.path)
    assert bpy.context.object.cager.file == "//small.cager"
    asset(list(scene.objects))
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=MODULE)
    os.mkdir(tmp_path / "elsewhere")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "elsewhere" / "scene.blend"))
    return path


def asset(things):
    scene = bpy.context.scene
    collection = bpy.data.collections.new("asset")
    scene.collection.children.link(collection)
    for each in things:
        scene.collection.objects.unlink(each)
        collection.objects.link(each)
    return collection


def loaded(library, link):
    with bpy.data.libraries.load(library, link=link) as (_, there):
        there.collections = ["asset"]
    return there.collections[0]


def models():
    return [each for each in bpy.context.scene.objects if each.type == "MESH" and each.cager.file]


@pytest.mark.parametrize("how", ["linked", "overridden", "appended"])
def test_captures_of_another_file_play(library, small, how):
    scene, collection = bpy.context.scene, loaded(library, link=how != "appended")
    if how == "overridden":
        collection.override_hierarchy_create(scene, bpy.context.view_layer)
    else:
        scene.collection.children.link(collection)
    (model,) = models()
    for frame in (1, 4, 7):
        scene.frame_set(frame)
        assert np.abs(seen(model) - small.capture[frame - 1]).max() <= 1e-6 * small.diagonal
        assert np.abs(seen(model.cager.cage) - small.capture.cages[frame - 1]).max() <= 1e-6 * small.diagonal
    assert not part("live").problems


def test_what_is_linked_says_how_it_is_edited(library, tmp_path):
    scene = bpy.context.scene
    scene.collection.children.link(loaded(library, link=True))
    (model,) = models()
    bpy.context.view_layer.objects.active = model
    assert "append it" in " ".join(drawn("CapturePanel")) and "cager.edit_frame" not in drawn("CapturePanel")
    for operator in (bpy.ops.cager.edit_frame, lambda: bpy.ops.cager.save_edits(filepath=str(tmp_path / "edited.cager"))):
        with pytest.raises(RuntimeError, match="linked from library.blend: .* Make Local"):
            operator()
    # Made local without its mesh, it cannot be edited yet; with all that it is made of, it can.
    for kind, can_be in (("SELECT_OBJECT", False), ("ALL", True)):
        for each in scene.objects:
            each.select_set(True)
        bpy.ops.object.make_local(type=kind)
        bpy.context.view_layer.objects.active = model = models()[0]
        assert ("cager.edit_frame" in drawn("CapturePanel")) == can_be
    assert bpy.ops.cager.edit_frame() == {"FINISHED"}
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.cager.export(filepath=str(tmp_path / "out.npy"), format="npy") == {"FINISHED"}


@pytest.mark.parametrize("link", [False, True])
def test_instances_of_collections_play(library, small, link):
    scene = bpy.context.scene
    empty = bpy.data.objects.new("instance", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", loaded(library, link)
    scene.collection.objects.link(empty)
    for frame in (2, 7):
        scene.frame_set(frame)
        shown = [each.object for each in bpy.context.evaluated_depsgraph_get().object_instances if each.object.name == "small model"]
        points = np.empty(3 * len(shown[0].data.vertices), np.float32)
        shown[0].data.vertices.foreach_get("co", points)
        assert np.abs(points.reshape(-1, 3) - small.capture[frame - 1]).max() <= 1e-6 * small.diagonal
