"""Cages are edited with Blender's own tools: the model follows, and files have the edits and nothing else."""

import os
import subprocess
import sys

import bmesh
import bpy
import cager
import numpy as np
import pytest
from mathutils import Vector

from conftest import encoded, part, seen

READ_USD = """
import sys, numpy
from pxr import Usd, UsdGeom
stage = Usd.Stage.Open(sys.argv[1])
(mesh,) = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
points = UsdGeom.Mesh(mesh).GetPointsAttr()
numpy.save(sys.argv[2], [points.Get(time) for time in points.GetTimeSamples()])
"""


@pytest.fixture
def model(scene, small):
    bpy.ops.cager.import_capture(filepath=small.path)
    return bpy.context.object


def move(model, frame, vertices, by):
    """Moves vertices of the cage in a frame, as an artist does in Edit Mode."""
    bpy.context.scene.frame_set(frame)
    assert bpy.ops.cager.edit_frame() == {"FINISHED"}
    cage = model.cager.cage
    mesh = bmesh.from_edit_mesh(cage.data)
    mesh.verts.ensure_lookup_table()
    for vertex in vertices:
        mesh.verts[vertex].co += by
    bmesh.update_edit_mesh(cage.data)
    bpy.context.view_layer.update()


def test_the_blender_day(scene, small, model, tmp_path):
    vertices, by = [3, 4, 11], Vector((0.2, 0.1, 0))
    for frame in (4, 8):
        move(model, frame, vertices, by)
        # It follows while the cage is in Edit Mode.
        expected = small.capture.cages[frame - 1].copy()
        expected[vertices] += np.float32(by)
        assert np.abs(seen(model) - small.capture.pose(expected)).max() <= 1e-6 * small.diagonal
    out, points = str(tmp_path / "edited.usdc"), str(tmp_path / "points.npy")
    assert bpy.ops.cager.export(filepath=out, format="usdc") == {"FINISHED"}
    # Blender's own copy of USD would be in the way of it.
    subprocess.run([sys.executable, "-c", READ_USD, out, points], check=True)
    moved = np.linalg.norm(np.load(points) - small.capture.decode(), axis=2)
    at_all = moved.max(axis=1) > 1e-6 * small.diagonal
    assert at_all.tolist() == [frame in (4, 8) for frame in range(1, 11)]
    assert np.array_equal(moved[~at_all], np.zeros_like(moved[~at_all]))
    # Where those vertices are, it moved most.
    near = np.linalg.norm(small.capture.rest[:, None] - small.capture.rest_cage[vertices], axis=2).min(axis=1)
    for frame in (3, 7):
        assert near[moved[frame].argmax()] <= np.median(near)
        assert moved[frame][near.argsort()[:20]].mean() > 5 * moved[frame][near.argsort()[-20:]].mean()


def test_keys_of_ones_own_over_many_frames_and_a_moved_cage_are_edits(scene, small, model):
    cage = model.cager.cage
    key = cage.shape_key_add(name="wider", from_mix=False)
    for point in key.data:
        point.co.x *= 1.5
    for frame, value in ((3, 0), (5, 1), (7, 0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    capture, frames = part("edits").edited_capture(bpy.context, model)
    assert frames == [4, 5, 6]
    assert np.allclose(capture.cages[4], small.capture.cages[4] + small.capture.rest_cage * [0.5, 0, 0], atol=1e-5)
    assert np.array_equal(capture.cages[8], small.capture.cages[8])
    key.mute = True
    for frame, height in ((9, 0), (10, 2)):
        cage.location.z = height
        cage.keyframe_insert("location", frame=frame)
    capture, frames = part("edits").edited_capture(bpy.context, model)
    assert frames == [10]
    scene.frame_set(10)
    assert np.allclose(seen(model), small.capture[9] + [0, 0, 2], atol=1e-5)
    assert np.allclose(capture[9], small.capture[9] + [0, 0, 2], atol=1e-5)


def test_saved_edits_are_shown_from_the_new_file(scene, small, model, tmp_path):
    path = str(tmp_path / "edited.cager")
    assert bpy.ops.cager.save_edits(filepath=path) == {"CANCELLED"}
    assert not os.path.exists(path)
    move(model, 6, [0, 1, 2], Vector((0, 0, 0.3)))
    assert bpy.ops.cager.save_edits(filepath=path) == {"FINISHED"}
    again = cager.open(path)
    changed = np.abs(again.cages - small.capture.cages).max(axis=(1, 2)) > 0
    assert np.flatnonzero(changed).tolist() == [5]
    assert np.array_equal(np.delete(again.decode(), 5, axis=0), np.delete(small.capture.decode(), 5, axis=0))
    assert model.cager.file == path
    for frame in (6, 7):
        scene.frame_set(frame)
        assert np.abs(seen(model) - again[frame - 1]).max() <= 1e-6 * small.diagonal
    assert part("edits").edited_capture(bpy.context, model)[1] == []


def test_edits_are_rendered_and_shown_while_the_cage_is_hidden(scene, small, model, tmp_path):
    cage = model.cager.cage
    cage.data.shape_keys.key_blocks["frame 3"].data[5].co.x += 0.4
    expected = small.capture.cages[2].copy()
    expected[5, 0] += np.float32(0.4)
    truth = {2: small.capture[1], 3: small.capture.pose(expected), 4: small.capture[3]}
    cage.hide_set(True)
    for frame in truth:
        scene.frame_set(frame)
        assert np.abs(seen(model) - truth[frame]).max() <= 1e-6 * small.diagonal
    assert cage.hide_render
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    scene.camera, scene.render.engine, scene.cycles.samples = camera, "CYCLES", 1
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.frame_start, scene.frame_end, scene.render.filepath = 2, 4, str(tmp_path / "rendered")
    rendered = {}

    def keep(now, *_):
        points = np.empty(3 * len(model.data.vertices), np.float32)
        model.data.attributes["position"].data.foreach_get("vector", points)
        rendered[now.frame_current] = points.reshape(-1, 3)

    bpy.app.handlers.render_post.append(keep)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.render_post.remove(keep)
    for frame in truth:
        assert np.abs(rendered[frame] - truth[frame]).max() <= 1e-6 * small.diagonal, frame


@pytest.mark.parametrize("ending", ["usdc", "abc", "glb", "pc2", "npy"])
def test_what_is_not_edited_is_exported_as_it_is(scene, small, model, tmp_path, ending):
    # The ending is that of the format.
    assert bpy.ops.cager.export(filepath=str(tmp_path / "out.cager"), format=ending, with_cage=True) == {"FINISHED"}
    assert set(os.listdir(tmp_path)) == {"small.cager", f"out.{ending}"}
    if ending == "npy":
        assert np.array_equal(np.load(tmp_path / "out.npy"), small.capture.decode())


def test_what_does_not_fit_the_capture_is_said(scene, small, model, tmp_path):
    scene.frame_set(50)
    with pytest.raises(RuntimeError, match="There is no cage for frame 50"):
        bpy.ops.cager.edit_frame()
    scene.frame_set(5)
    cage = model.cager.cage
    cage.modifiers.new("more", "SUBSURF").levels = 1
    bpy.context.view_layer.update()
    assert "neither add nor remove any" in part("live").problems[model.name]
    with pytest.raises(RuntimeError, match="has .* vertices where the capture's cage has 42"):
        bpy.ops.cager.export(filepath=str(tmp_path / "out.usdc"))
    cage.modifiers.clear()
    scene.frame_set(6)
    assert model.name not in part("live").problems
    bpy.context.view_layer.objects.active = model.parent
    assert bpy.ops.cager.export.poll()
    bpy.context.view_layer.objects.active = None
    assert not bpy.ops.cager.export.poll()


def test_a_cage_that_cannot_be_edited_is_said_in_blenders_words(scene, tmp_path):
    path = str(tmp_path / "free.cager")
    encoded(path, coordinates="green-free")
    bpy.ops.cager.import_capture(filepath=path)
    model = bpy.context.object
    move(model, 2, [5], Vector((0.3, 0, 0)))
    assert "choose Encode selected" in part("live").problems[model.name]
    for run in (bpy.ops.cager.save_edits, lambda filepath: bpy.ops.cager.export(filepath=filepath, format="npy")):
        with pytest.raises(RuntimeError, match="green-free .* choose Encode selected") as refused:
            run(filepath=str(tmp_path / "edited.cager"))
        assert "--" not in str(refused.value)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert os.listdir(tmp_path) == ["free.cager"]


def test_a_hidden_capture_is_exported_as_it_is(scene, small, model, tmp_path):
    for each in (model, model.cager.cage):
        each.hide_viewport = True
    scene.frame_set(4)
    assert bpy.ops.cager.export(filepath=str(tmp_path / "out.npy"), format="npy") == {"FINISHED"}
    assert np.array_equal(np.load(tmp_path / "out.npy"), small.capture.decode())
    assert model.hide_viewport and model.cager.cage.hide_viewport
    for each in (model, model.cager.cage):
        each.keyframe_insert("hide_viewport", frame=1)
    with pytest.raises(RuntimeError, match="small model is hidden in frame 1: take off the animation"):
        bpy.ops.cager.export(filepath=str(tmp_path / "out.npy"), format="npy")


def test_edits_are_a_layer_that_leaves_all_else_as_it_was(scene, tmp_path):
    path, out = str(tmp_path / "coded.cager"), str(tmp_path / "edited.cager")
    capture = encoded(path, max_error=1e-4)
    size = np.linalg.norm(np.ptp(capture.rest, axis=0))
    bpy.ops.cager.import_capture(filepath=path)
    model = bpy.context.object
    move(model, 2, [5], Vector((0.3, 0, 0)))
    shown = seen(model).copy()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.cager.save_edits(filepath=out, layer="bump") == {"FINISHED"}
    edited = cager.open(out)
    (layer,) = edited.layers
    assert (layer["name"], layer["frames"], layer["vertices"].tolist()) == ("bump", range(1, 2), [5])
    assert 0 < os.path.getsize(out) - os.path.getsize(path) < 2000
    assert np.array_equal(np.delete(edited.decode(), 1, axis=0), np.delete(capture.decode(), 1, axis=0))
    # What the cage left over is kept: it was shown, and is in the file.
    phi = cager.coordinates(capture.rest, capture.rest_cage, capture.cage_faces)
    expected = capture[1] + phi @ (edited.cages[1] - capture.cages[1].astype(float))
    for positions in (edited[1], shown):
        assert np.abs(positions - expected).max() <= 2e-6 * size
    assert edited.remove_layer().layers == [] and np.array_equal(edited.remove_layer().decode(), capture.decode())
    # One more, into the file that is shown.
    move(model, 4, [7], Vector((0, 0.2, 0)))
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.cager.save_edits(filepath=out) == {"FINISHED"}
    assert [layer["vertices"].tolist() for layer in cager.open(out).layers] == [[5], [7]]
