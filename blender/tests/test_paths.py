"""Paths are relative to the .blend file where Blender's preferences say so, and stay right where that goes."""

import os
import shutil
import warnings

import bpy
import numpy as np
import pytest

from conftest import part, seen


@pytest.fixture
def saved(scene, tmp_path):
    """The folder of a .blend file."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.context.preferences.filepaths.use_relative_paths = True
    return tmp_path


def imported(path):
    bpy.ops.cager.import_capture(filepath=path)
    return bpy.context.object


def is_shown(model, small, frame):
    bpy.context.scene.frame_set(frame)
    return np.abs(seen(model) - small.capture[frame - 1]).max() <= 1e-6 * small.diagonal


def test_what_is_written_beside_the_blend_file_is_there(saved, small):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = imported("//small.cager")
    assert is_shown(model, small, 3)
    model.cager.cage.data.shape_keys.key_blocks["frame 4"].data[2].co.x += 0.3
    bpy.ops.cager.export(filepath="//out.npy", format="npy")
    bpy.ops.cager.save_edits(filepath="//edited.cager")
    assert model.cager.file == "//edited.cager"
    bpy.context.scene.frame_end, bpy.context.scene.cager.vertices = 3, 20
    bpy.ops.cager.encode(filepath="//again.cager")
    assert {"out.npy", "edited.cager", "again.cager"} <= set(os.listdir(saved))


def test_without_a_blend_file_there_is_no_folder_beside_it(scene, small):
    imported(small.path)
    operators = bpy.ops.cager
    for run in (operators.import_capture, operators.encode, lambda filepath: operators.export(filepath=filepath, format="npy")):
        with pytest.raises(RuntimeError, match="// is the folder of the .blend file, which is not saved yet"):
            run(filepath="//out.cager")


@pytest.mark.parametrize("is_relative", [True, False])
def test_the_preference_is_followed(saved, small, is_relative):
    bpy.context.preferences.filepaths.use_relative_paths = is_relative
    assert imported(small.path).cager.file == ("//small.cager" if is_relative else small.path)


def test_a_first_saving_makes_paths_relative(scene, small, tmp_path):
    model = imported(small.path)
    assert model.cager.file == small.path
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert model.cager.file == "//small.cager" and is_shown(model, small, 5)


def test_relative_paths_follow_the_blend_file(saved, small):
    model = imported(small.path)
    name = model.name
    os.mkdir(saved / "sub")
    bpy.ops.wm.save_as_mainfile(filepath=str(saved / "sub" / "copy.blend"), copy=True)
    assert model.cager.file == "//small.cager"
    bpy.ops.wm.open_mainfile(filepath=str(saved / "sub" / "copy.blend"))
    model = bpy.data.objects[name]
    assert model.cager.file == "//../small.cager" and is_shown(model, small, 4)
    bpy.ops.wm.save_as_mainfile(filepath=str(saved / "scene.blend"))
    assert model.cager.file == "//small.cager" and is_shown(model, small, 5)


def test_a_folder_is_moved_with_all_in_it(saved, small, tmp_path):
    name = imported(small.path).name
    bpy.ops.wm.save_mainfile()
    os.mkdir(tmp_path / "moved")
    for file in ("scene.blend", "small.cager"):
        shutil.move(tmp_path / file, tmp_path / "moved")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "moved" / "scene.blend"))
    assert is_shown(bpy.data.objects[name], small, 6) and not part("live").problems
