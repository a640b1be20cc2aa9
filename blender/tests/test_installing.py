"""The zip is valid, and the extension comes and goes without a trace."""

import os
import subprocess
import sys

import bpy

from conftest import MODULE, ZIP


def traces():
    handlers = [h for name in dir(bpy.app.handlers) if isinstance(there := getattr(bpy.app.handlers, name), list) for h in there]
    menus = [
        draw
        for menu in (bpy.types.TOPBAR_MT_file_import, bpy.types.TOPBAR_MT_file_export)
        for draw in getattr(menu.draw, "_draw_funcs", ())
    ]
    ours = [each.__name__ for each in handlers + menus if each.__module__.startswith(MODULE)]
    classes = [name for name in dir(bpy.types) if "cager" in name.lower()]
    return ours, classes + [where.__name__ for where in (bpy.types.Object, bpy.types.Scene) if hasattr(where, "cager")]


def test_blenders_own_tool_finds_nothing_wrong_with_the_zip():
    tool = os.path.join(bpy.utils.system_resource("SCRIPTS"), "addons_core", "bl_pkg", "cli", "blender_ext.py")
    done = subprocess.run([sys.executable, tool, "validate", ZIP], capture_output=True, text=True)
    assert done.returncode == 0 and "rror" not in done.stdout + done.stderr, done.stdout + done.stderr


def test_the_extension_comes_and_goes_without_a_trace(scene):
    there = traces()
    # One of each kind: saving (before, after and where it fails, of paths and of what was baked), frame (before and after), edit, load (before and after), undo and redo;
    # import and export.
    frames = ["before_frame", "on_edit", "on_frame", "on_load", "on_load", "on_undo", "on_undo"]
    assert sorted(there[0]) == sorted([*["after_saving"] * 5, *["before_saving"] * 2, *frames, "menu", "menu"])
    for _ in range(2):
        bpy.ops.preferences.addon_disable(module=MODULE)
        assert traces() == ([], [])
        bpy.ops.preferences.addon_enable(module=MODULE)
        assert traces() == there


def test_it_is_removed_and_installed_again(scene):
    bpy.ops.extensions.package_uninstall(repo_index=1, pkg_id="cager")
    assert traces() == ([], [])
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)
    assert bpy.ops.cager.import_capture.idname()
    assert traces()[0]
