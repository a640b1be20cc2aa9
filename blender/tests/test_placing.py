"""Captures are where, as large and when they were: positions are compared in place, at their frames, in Blender's own importers too."""

import bpy
import cager
import numpy as np
import pytest

from conftest import add, encoded, part, seen, tube, world

RATE = 24000 / 1001


@pytest.fixture
def shot(scene):
    """A figure of 3 m that stands on the ground in a scene in centimetres, from frame 1001 on, and walks along -Y."""
    scene.unit_settings.system, scene.unit_settings.scale_length = "METRIC", 0.01
    scene.render.fps, scene.render.fps_base = 24, 1.001
    scene.frame_start, scene.frame_end = 1001, 1006
    points, faces = tube(12, 16, 40, 150)
    thing = add("Figure", points + [0, 0, 150], faces)
    # What tells every direction from every other.
    thing.data.vertices[-1].co.x += 30
    thing.data.vertices[-1].co.y += 10
    for frame, place, angle in ((1001, (20, 0, 0), 0.0), (1006, (50, -300, 10), 0.7)):
        thing.location, thing.rotation_euler.z = place, angle
        thing.keyframe_insert("location", frame=frame)
        thing.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.view_layer.objects.active = thing
    scene.cager.vertices, scene.cager.keep, scene.cager.max_error, scene.cager.show = 24, "ERROR", 0.01, False
    return thing


def encode(scene, path, **settings):
    for name, value in settings.items():
        setattr(scene.cager, name, value)
    assert bpy.ops.cager.encode(filepath=path) == {"FINISHED"}
    return cager.open(path)


def in_metres():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module="bl_ext.user_default.cager")
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.001
    return scene


def at(scene, thing, time):
    scene.frame_set(int(np.floor(time)), subframe=time - np.floor(time))
    bpy.context.view_layer.update()
    matrix = np.array(thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world, float)
    return seen(thing) @ matrix[:3, :3].T + matrix[:3, 3]


def test_a_capture_knows_what_the_scene_says(scene, shot, tmp_path):
    capture = encode(scene, str(tmp_path / "figure.cager"))
    assert (capture.unit, capture.up) == (0.01, "z")
    assert capture.times.tolist() == list(range(1001, 1007)) and abs(capture.frame_rate - RATE) < 1e-9
    scene.unit_settings.system = "NONE"
    assert encode(scene, str(tmp_path / "none.cager")).unit is None


def test_frames_are_read_between_frames_where_it_is_wanted(scene, shot, tmp_path):
    capture = encode(scene, str(tmp_path / "figure.cager"), samples=4)
    assert capture.times.tolist() == [1001 + k / 4 for k in range(21)]
    size = np.linalg.norm(np.ptp(capture.rest, axis=0))
    for time in (1001.25, 1003.5, 1005.75):
        truth = at(scene, shot, time)
        assert np.abs(capture[int(4 * (time - 1001))] - truth).max() <= 1.1e-4 * size
    # And played between them.
    bpy.ops.cager.import_capture(filepath=str(tmp_path / "figure.cager"))
    for time in (1001.25, 1003.5, 1004, 1005.75):
        assert np.abs(at(scene, bpy.context.object, time) - at(scene, shot, time)).max() <= 2e-4 * size
    assert (scene.frame_start, scene.frame_end) == (1001, 1006)


@pytest.mark.parametrize("ending", ["usdc", "abc", "glb"])
@pytest.mark.parametrize("up", ["z", "y"])
def test_blenders_own_importers_find_it_in_place(scene, shot, tmp_path, ending, up):
    capture = encode(scene, str(tmp_path / "figure.cager"))
    truth = {frame: world(scene, shot, frame) for frame in (1001, 1004, 1006)}
    if up == "y":
        # As a program with Y up has it.
        frames = capture.decode()[:, :, [0, 2, 1]] * [1, 1, -1]
        rest, cage = capture.rest[:, [0, 2, 1]] * [1, 1, -1], capture.rest_cage[:, [0, 2, 1]] * [1, 1, -1]
        options = {"unit": "cm", "up": "y", "times": capture.times, "frame_rate": capture.frame_rate, "max_error": 1e-4}
        cager.encode(rest, capture.faces, frames, (cage, capture.cage_faces), **options).save(tmp_path / "y.cager")
    scene = in_metres()
    bpy.ops.cager.import_capture(filepath=str(tmp_path / ("figure.cager" if up == "z" else "y.cager")))
    model = bpy.context.object
    size = 0.01 * np.linalg.norm(np.ptp(truth[1001], axis=0))
    # A figure of 3 m, upright, in a scene in metres.
    for frame in truth:
        assert np.abs(world(scene, model, frame) - 0.01 * truth[frame]).max() <= 3e-4 * size
    out = str(tmp_path / f"out.{ending}")
    assert bpy.ops.cager.export(filepath=out, format=ending) == {"FINISHED"}
    scene = in_metres()
    if ending == "usdc":
        bpy.ops.wm.usd_import(filepath=out, **({"apply_unit_conversion_scale": True} if bpy.app.version >= (4, 5) else {"scale": 0.01}))
    elif ending == "abc":
        # Which has no place for a unit.
        bpy.ops.wm.alembic_import(filepath=out, as_background_job=False, scale=0.01)
    else:
        bpy.ops.import_scene.gltf(filepath=out)
    (read,) = [each for each in scene.objects if each.type == "MESH"]
    for frame in truth:
        # A glTF begins at 0 s, and Blender takes 24 frames of it for a second where it has 23.976.
        time = 1.001 * (frame - 1001) if ending == "glb" else frame
        error = np.abs(at(scene, read, time) - 0.01 * truth[frame]).max()
        assert error <= (0.002 if ending == "glb" else 4e-4) * size, (frame, error / size)


def test_frames_and_units_that_are_asked_for_count(scene, tmp_path):
    path = str(tmp_path / "tube.cager")
    capture = encoded(path, unit="cm", up="y", times=[7.5, 8, 10.25, *range(11, 18)], start=None)
    size = np.linalg.norm(np.ptp(capture.rest, axis=0))
    turned = lambda points: np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)

    def imported(**options):
        bpy.ops.cager.import_capture(filepath=path, **options)
        return bpy.context.object

    model = imported()
    assert (scene.frame_start, scene.frame_end) == (7, 17)
    for time, expected in ((7.5, capture[0]), (8, capture[1]), (10.25, capture[2]), (17, capture[9]), (9.125, (capture[1] + capture[2]) / 2)):
        assert np.abs(at(scene, model, time) - 0.01 * turned(expected)).max() <= 1e-7 * size
    keys = model.cager.cage.data.shape_keys.key_blocks
    assert {"frame 7.5", "frame 10.25", "frame 17"} <= set(keys.keys())
    # It is edited there.
    scene.frame_set(10, subframe=0.25)
    assert bpy.ops.cager.edit_frame() == {"FINISHED"} and model.cager.cage.active_shape_key.name == "frame 10.25"
    bpy.ops.object.mode_set(mode="OBJECT")
    keys["frame 10.25"].data[3].co.x += 0.4
    assert part("edits").edited_capture(bpy.context, model)[1] == [10.25]
    model = imported(first=100, up="Z", to_unit=False)
    for time, expected in ((100.5, capture[0]), (101, capture[1]), (103.25, capture[2])):
        assert np.abs(at(scene, model, time) - expected).max() <= 1e-6 * size
    model = imported(own_frames=False)
    assert np.abs(at(scene, model, 1.5) - 0.01 * turned(capture[0])).max() <= 1e-7 * size
