"""Animated objects are encoded, in the background and until the user stops it."""

import os

import bpy
import cager
import numpy as np
import pytest

from conftest import add, part, seen, tube, world


def animated(scene, name="Tube"):
    """A tube that a modifier bends and its own transform carries about, and a cage around it whose faces are apart."""
    points, faces = tube(12, 16, 0.4, 1.0)
    thing = add(name, points, faces)
    bend = thing.modifiers.new("bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.deform_axis = "BEND", "X"
    for frame, angle, place in ((scene.frame_start, 0.0, (0, 0, 0)), (scene.frame_end, 0.9, (1, 0.5, -1))):
        bend.angle, thing.location, thing.rotation_euler.z = angle, place, angle
        bend.keyframe_insert("angle", frame=frame)
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_euler", frame=frame)
    thing.scale = (1.5, 1, 1)
    cage = add("Cage", *tube(6, 8, 0.6, 1.3))
    cage.scale = (1.5, 1, 1)
    cage.modifiers.new("apart", "EDGE_SPLIT").split_angle = 0.1
    bpy.context.view_layer.objects.active = thing
    return thing, cage


def test_the_selected_object_becomes_a_capture_that_is_shown(scene, tmp_path):
    thing, cage = animated(scene)
    chosen, path = scene.cager, str(tmp_path / "tube.cager")
    chosen.cage, chosen.keep, chosen.max_error = cage, "ERROR", 0.05
    scene.frame_set(7)
    assert bpy.ops.cager.encode(filepath=path) == {"FINISHED"}
    assert scene.frame_current == 7
    capture = cager.open(path)
    assert capture.frame_rate == 25 and len(capture) == 10
    # Its faces, which were apart, are one mesh again.
    assert len(capture.rest_cage) == len(cage.data.vertices)
    model = next(each for each in scene.objects if each.cager.file)
    for frame in (1, 4, 10):
        truth = world(scene, thing, frame)
        diagonal = np.linalg.norm(np.ptp(world(scene, thing, 1), axis=0))
        assert np.linalg.norm(capture[frame - 1] - truth, axis=1).max() <= 0.00051 * diagonal
        scene.frame_set(frame)
        assert np.abs(seen(model) - capture[frame - 1]).max() <= 1e-6 * diagonal
    words, is_error = part("encode_operators").told
    assert words.startswith("tube.cager: 10 frames of 194 vertices, largest error 0.0") and not is_error


def test_a_cage_is_made_where_none_is_chosen(scene, tmp_path):
    thing, _ = animated(scene)
    scene.frame_end, scene.cager.vertices, scene.cager.show = 4, 24, False
    path = str(tmp_path / "tube.cager")
    bpy.ops.cager.encode(filepath=path)
    assert 4 <= len(cager.open(path).rest_cage) <= 24
    assert not any(each.cager.file for each in scene.objects)


def test_it_goes_on_in_the_background_and_tells_how_far_it_is(scene, tmp_path):
    thing, cage = animated(scene)
    scene.cager.cage = cage
    scene.frame_set(3)
    job = part("encoding").Encoding(bpy.context, thing, str(tmp_path / "tube.cager"))
    told = []
    while not job.step(bpy.context, seconds=0):
        told.append((job.stage, job.fraction))
        assert scene.frame_current == 3
    assert told[0] == ("reading frames", 0.1) and ("reading frames", 0.9) in told
    assert job.error is None and len(job.capture) == 10
    assert job.thread and not job.thread.is_alive()


@pytest.mark.parametrize("when", ["reading", "encoding"])
def test_it_is_cancelled_without_a_trace(scene, tmp_path, when):
    thing, cage = animated(scene)
    scene.cager.cage = None if when == "encoding" else cage
    operators = part("encode_operators")
    operators.running = job = part("encoding").Encoding(bpy.context, thing, str(tmp_path / "tube.cager"))
    operators.running.step(bpy.context, seconds=0 if when == "reading" else 10)
    assert (job.thread is not None) == (when == "encoding")
    assert bpy.ops.cager.cancel_encoding() == {"FINISHED"}
    while operators.tick() is not None:
        pass
    assert operators.running is None and operators.told == ("Encoding was cancelled; nothing was written.", True)
    assert os.listdir(tmp_path) == [] and scene.frame_current == 1
    assert not bpy.ops.cager.cancel_encoding.poll()


def test_opening_another_file_ends_it(scene, tmp_path):
    thing, _ = animated(scene)
    operators = part("encode_operators")
    operators.running = job = part("encoding").Encoding(bpy.context, thing, str(tmp_path / "tube.cager"))
    job.step(bpy.context, seconds=10)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert operators.running is None and not job.thread.is_alive() and os.listdir(tmp_path) == []


def test_what_cannot_be_encoded_is_said(scene, tmp_path):
    thing, cage = animated(scene)
    path = str(tmp_path / "tube.cager")

    def refused(words):
        with pytest.raises(RuntimeError, match=words) as error:
            bpy.ops.cager.encode(filepath=path)
        assert "Traceback" not in str(error.value) and os.listdir(tmp_path) == []

    scene.cager.cage = thing
    refused("Tube is its own cage")
    scene.cager.cage = add("Walls", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (0, 1, 4)])
    refused("Walls stays open")
    scene.cager.cage = add("Dots", [(0, 0, 0)], [])
    refused("Dots has no faces")
    scene.cager.cage = cage
    build = thing.modifiers.new("build", "BUILD")
    build.frame_start, build.frame_duration = -5, 20
    refused("Tube has .* vertices in frame 1 and .* in frame 2: .* remesh, decimate")
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    scene.collection.objects.link(lamp)
    bpy.context.view_layer.objects.active = lamp
    refused("Lamp is no mesh")
    thing.modifiers.remove(build)
    bpy.context.view_layer.objects.active = thing
    path = str(tmp_path / "nowhere" / "tube.cager")
    refused("create its folder first")
    bpy.context.view_layer.objects.active = None
    assert not bpy.ops.cager.encode.poll()
