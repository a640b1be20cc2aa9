"""Captures follow the scene's time as Blender's own animation does: between frames, remapped, and back where it was."""

import time

import bpy
import numpy as np
import pytest

from conftest import encoded, part, seen


@pytest.fixture
def coded(scene, tmp_path):
    """A capture whose cage is so coarse that most of the motion is in its details."""
    path = str(tmp_path / "coded.cager")
    capture = encoded(path, cage_rings=3, cage_around=6, max_error=1e-4)
    bpy.ops.cager.import_capture(filepath=path)
    return bpy.context.object, capture, np.linalg.norm(np.ptp(capture.rest, axis=0))


def test_between_frames_details_stay(scene, coded):
    model, capture, diagonal = coded
    assert np.abs(capture.pose(capture.cages[3]) - capture[3]).max() > 0.01 * diagonal
    for part_of_way in (0, 0.001, 0.25, 0.5, 0.999):
        scene.frame_set(4, subframe=part_of_way)
        between = (1 - part_of_way) * capture[3] + part_of_way * capture[4]
        assert np.abs(seen(model) - between).max() <= 1e-5 * diagonal
    assert part("edits").edited_capture(bpy.context, model)[1] == []


def test_between_frames_edits_come_and_go(scene, small):
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    model.cager.cage.data.shape_keys.key_blocks["frame 5"].data[2].co.x += 0.4
    edited = small.capture.cages.copy()
    edited[4, 2, 0] += np.float32(0.4)
    for frame, part_of_way in ((4, 0.25), (5, 0.75)):
        scene.frame_set(frame, subframe=part_of_way)
        between = (1 - part_of_way) * edited[frame - 1] + part_of_way * edited[frame]
        assert np.abs(seen(model) - small.capture.pose(between)).max() <= 1e-5 * small.diagonal


def test_details_stay_where_a_cage_is_edited(scene, coded):
    model, capture, diagonal = coded
    key = model.cager.cage.data.shape_keys.key_blocks["frame 5"]
    key.data[2].co.x += 0.4
    cage = capture.cages[4].copy()
    cage[2, 0] += np.float32(0.4)
    details = [capture[k] - capture.pose(capture.cages[k]) for k in range(10)]
    frames = {4: capture[3], 5: capture.pose(cage) + details[4], 6: capture[5]}
    for frame, part_of_way in ((4, 0), (4, 0.01), (4, 0.7), (5, 0), (5, 0.3), (6, 0)):
        scene.frame_set(frame, subframe=part_of_way)
        between = (1 - part_of_way) * frames[frame] + part_of_way * frames.get(frame + 1, 0)
        assert np.abs(seen(model) - between).max() <= 1e-5 * diagonal
    # Also where it is edited over many frames.
    model.cager.cage.location.z = 2
    scene.frame_set(4, subframe=0.5)
    cages = 0.5 * capture.cages[3] + 0.5 * cage
    expected = capture.pose(cages + [0, 0, 2]) + 0.5 * (details[3] + details[4])
    assert np.abs(seen(model) - expected).max() <= 1e-5 * diagonal


def test_a_cage_is_edited_in_a_whole_frame(scene, small):
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    scene.frame_set(3, subframe=0.75)
    assert bpy.ops.cager.edit_frame() == {"FINISHED"}
    assert (scene.frame_current, scene.frame_subframe) == (3, 0)
    assert np.abs(seen(model) - small.capture[2]).max() <= 1e-6 * small.diagonal
    bpy.ops.object.mode_set(mode="OBJECT")


def test_time_remapping_slows_a_capture_and_edits_nothing(scene, small):
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    for old, new in ((100, 200), (100, 70)):
        scene.render.frame_map_old, scene.render.frame_map_new = old, new
        assert part("edits").edited_capture(bpy.context, model)[1] == []
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    scene.frame_set(6)
    assert np.abs(seen(model) - small.capture[2]).max() <= 1e-6 * small.diagonal
    model.cager.cage.data.shape_keys.key_blocks["frame 4"].data[2].co.x += 0.4
    assert part("edits").edited_capture(bpy.context, model)[1] == [4]


def test_the_scene_stays_between_its_frames(scene, small, tmp_path):
    scene.frame_set(3, subframe=0.25)
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    assert scene.frame_subframe == 0.25
    model.cager.cage.data.shape_keys.key_blocks["frame 4"].data[2].co.x += 0.4
    assert bpy.ops.cager.save_edits(filepath=str(tmp_path / "edited.cager")) == {"FINISHED"}
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.25)
    scene.cager.vertices = 20
    bpy.context.view_layer.objects.active = model
    assert bpy.ops.cager.encode(filepath=str(tmp_path / "again.cager")) == {"FINISHED"}
    assert (scene.frame_current, scene.frame_subframe) == (3, 0.25)


def test_a_capture_that_would_end_after_blenders_last_frame_is_refused(scene, small):
    there = set(bpy.data.objects), set(bpy.data.meshes)
    for first in (2**31 - 2, 1_048_566):
        with pytest.raises(RuntimeError, match="Blender's last is 1048574") as refused:
            bpy.ops.cager.import_capture(filepath=small.path, first=first)
        assert "Traceback" not in str(refused.value) and (set(bpy.data.objects), set(bpy.data.meshes)) == there
    bpy.ops.cager.import_capture(filepath=small.path, first=1_048_565)
    scene.frame_set(1_048_574)
    assert np.abs(seen(bpy.context.object) - small.capture[9]).max() <= 1e-6 * small.diagonal


def test_long_captures_play_as_fast_as_short_ones(scene, tmp_path):
    def milliseconds(frames):
        path = str(tmp_path / f"{frames}.cager")
        encoded(path, frames=frames)
        bpy.ops.cager.import_capture(filepath=path)
        times = []
        for frame in list(range(1, 13)) * 4:
            busy = time.process_time()
            scene.frame_set(frame)
            times.append(time.process_time() - busy)
        bpy.data.objects.remove(bpy.context.object)
        return 1000 * float(np.median(times))

    short, long = milliseconds(12), milliseconds(1000)
    print(f"{short:.2f} ms a frame of 12, {long:.2f} ms a frame of 1000")
    assert long <= short + 4
