"""What is baked plays in Blender without the extension, edits included, and shows the capture again where that is there."""

import os
import subprocess
import sys
import tempfile

import bpy
import numpy as np
import pytest

from conftest import encoded, part, seen

PLAIN = """
import sys, bpy, numpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
assert not hasattr(bpy.types.Object, "cager")
model = next(each for each in bpy.data.objects if each.modifiers)
found = []
for time in eval(sys.argv[3]):
    bpy.context.scene.frame_set(int(time // 1), subframe=time % 1)
    mesh = model.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points = numpy.empty(3 * len(mesh.vertices), numpy.float32)
    mesh.vertices.foreach_get("co", points)
    found.append(points.reshape(-1, 3))
numpy.save(sys.argv[2], found)
"""


def without_extension(blend, times, tmp_path):
    out = str(tmp_path / "found.npy")
    with tempfile.TemporaryDirectory() as nothing:
        environment = {**os.environ, "BLENDER_USER_RESOURCES": nothing}
        subprocess.run([sys.executable, "-c", PLAIN, blend, out, repr(list(times))], check=True, env=environment)
    return np.load(out)


@pytest.mark.parametrize("times", [[*range(1001, 1011)], [5.5 + k / 2 for k in range(10)], [3, 4, 5.5, 9, 10, 11, 12, 13, 14, 14.25]])
def test_it_plays_without_the_extension(scene, tmp_path, times):
    capture = encoded(str(tmp_path / "tube.cager"), max_error=1e-4, times=times, start=None)
    bpy.ops.cager.import_capture(filepath=str(tmp_path / "tube.cager"))
    model, blend = bpy.context.object, str(tmp_path / "shot.blend")
    with pytest.raises(RuntimeError, match="is not saved yet: save it first"):
        bpy.ops.cager.bake()
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    keys = model.cager.cage.data.shape_keys.key_blocks
    keys[part("keys").key_name(times[4])].data[2].co.x += 0.4
    assert bpy.ops.cager.bake() == {"FINISHED"}
    assert sorted(os.listdir(tmp_path)) == ["shot.blend", "shot_tube_model.pc2", "tube.cager"]
    bpy.ops.wm.save_mainfile()
    between = [times[0], times[3], (times[3] + times[4]) / 2, times[4], times[9], times[9] + 5]
    shown = []
    for time in between:
        scene.frame_set(int(np.floor(time)), subframe=time - np.floor(time))
        shown.append(seen(model).copy())
    size = np.linalg.norm(np.ptp(capture.rest, axis=0))
    assert np.abs(shown[3] - capture[4]).max() > 0.05 * size
    found = without_extension(blend, between, tmp_path)
    assert np.abs(found - shown).max() <= 2e-6 * size
    # Here the capture is shown, so that it can be edited.
    modifier = part("bake").modifier_of(model)
    assert (modifier.show_viewport, modifier.show_render) == (False, False)


def test_what_has_changed_since_is_said(scene, small, tmp_path, capfd):
    bpy.ops.cager.import_capture(filepath=small.path)
    model, bake = bpy.context.object, part("bake")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.cager.bake()
    bpy.ops.wm.save_mainfile()
    assert not bake.stale
    model.cager.cage.data.shape_keys.key_blocks["frame 4"].data[2].co.x += 0.4
    bpy.ops.wm.save_mainfile()
    assert bake.stale == {model.name_full} and "bake it again" in "".join(capfd.readouterr())
    bpy.ops.cager.bake()
    assert not bake.stale and len(model.modifiers) == 2


def test_a_capture_that_is_gone_plays_what_was_baked(scene, small, tmp_path):
    bpy.ops.cager.import_capture(filepath=small.path)
    model, modifier_of = bpy.context.object, part("bake").modifier_of
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.cager.bake()
    os.rename(small.path, small.path + ".away")
    part("captures").forget()
    scene.frame_set(6)
    assert modifier_of(model).show_render
    bpy.context.view_layer.update()
    assert np.abs(seen(model) - small.capture[5]).max() <= 1e-6 * small.diagonal
    os.rename(small.path + ".away", small.path)
    scene.frame_set(7)
    assert not modifier_of(model).show_render
