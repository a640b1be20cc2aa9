"""Blender as a Python module with the extension installed from its zip, CAGER_EXTENSION, and captures to try it on."""

import os
import sys
import tempfile
from types import SimpleNamespace

# Nothing of the user's own Blender is read or changed.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="cager-blender-")

import bpy
import numpy as np
import pytest

ZIP = os.path.abspath(os.environ.get("CAGER_EXTENSION", "target/cager-blender.zip"))
MODULE = "bl_ext.user_default.cager"


def pytest_configure(config):
    config.addinivalue_line("filterwarnings", "ignore::DeprecationWarning")
    bpy.ops.extensions.package_install_files(filepath=ZIP, repo="user_default", enable_on_install=True)


def pytest_sessionfinish(session, exitstatus):
    session.config.exit_status = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config):
    # As a module, Blender 4.2 frees the panels of extensions after Python has ended, and crashes.
    if bpy.app.version < (4, 5):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.exit_status)


@pytest.fixture
def scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=MODULE)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 10
    scene.render.fps, scene.render.fps_base = 25, 1
    return scene


def part(name):
    """A module of the installed extension."""
    return __import__(f"{MODULE}.{name}", fromlist=[name])


def tube(rings, around, radius, ends):
    """Vertices and faces of a closed tube along z."""
    heights, angles = np.linspace(-ends, ends, rings), 2 * np.pi * np.arange(around) / around
    points = np.array([[radius * np.cos(a), radius * np.sin(a), z] for z in heights for a in angles])
    place = lambda ring, a: ring * around + a % around
    faces = [
        [place(r, a), place(r, a + 1), place(r + 1, a + 1), place(r + 1, a)] for r in range(rings - 1) for a in range(around)
    ]
    bottom, top = len(points), len(points) + 1
    faces += [[bottom, place(0, a + 1), place(0, a)] for a in range(around)]
    faces += [[top, place(rings - 1, a), place(rings - 1, a + 1)] for a in range(around)]
    return np.vstack([points, [[0, 0, -ends], [0, 0, ends]]]), faces


def bend(points, t):
    angle = 0.6 * np.sin(t) * points[:, 2]
    x, y, z = (points * (1 + 0.05 * np.sin(2 * t))).T
    return np.stack([x * np.cos(angle) - z * np.sin(angle), y, x * np.sin(angle) + z * np.cos(angle)], axis=1)


def encoded(path, rings=16, around=24, cage_rings=5, cage_around=8, frames=10, start=1, **options):
    import cager

    points, faces = tube(rings, around, 0.5, 1.0)
    cage = tube(cage_rings, cage_around, 0.65, 1.2)
    capture = cager.encode(points, faces, [bend(points, t) for t in np.linspace(0, 2.5, frames)], cage, frame_rate=25, start=start, **options)
    capture.save(path)
    return capture


@pytest.fixture
def small(tmp_path):
    """A capture of ten frames in a file, and the same opened apart from the extension."""
    path = str(tmp_path / "small.cager")
    capture = encoded(path)
    diagonal = np.linalg.norm(np.ptp(capture.rest, axis=0))
    return SimpleNamespace(path=path, capture=capture, diagonal=diagonal)


def seen(thing):
    """Positions of an object in its own coordinates as Blender evaluates them."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3)


def add(name, points, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, point)) for point in points], [], faces)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def world(scene, thing, frame):
    """Positions of an object in the world in a frame."""
    scene.frame_set(frame)
    matrix = np.array(thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)
    return seen(thing) @ matrix[:3, :3].T + matrix[:3, 3]
