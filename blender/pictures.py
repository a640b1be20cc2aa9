"""Renders a capture beside one whose cage was edited, as the documentation shows it: python pictures.py CAPTURE PICTURE, with the extension's zip built."""

import os
import sys
import tempfile

os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="cager-blender-")

import bpy
import numpy as np
from mathutils import Vector

MODULE, WIDTH, HEIGHT = "bl_ext.user_default.cager", 400, 450


def material(name, color, shine=0.0):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    surface = made.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*color, 1)
    surface.inputs["Roughness"].default_value = 0.6
    surface.inputs["Emission Color"].default_value = (*color, 1)
    surface.inputs["Emission Strength"].default_value = shine
    return made


def stage(model):
    """A camera and light that see the whole model and its cage, which is rendered as thin rods."""
    scene, cage = bpy.context.scene, model.cager.cage
    bpy.context.view_layer.update()
    corners = np.array([model.matrix_world @ Vector(corner) for corner in cage.bound_box])
    center, size = corners.mean(axis=0), np.linalg.norm(np.ptp(corners, axis=0))
    model.data.materials.append(material("model", (0.55, 0.6, 0.7)))
    cage.data.materials.append(material("cage", (0.9, 0.3, 0.03), 0.25))
    cage.hide_render, cage.display_type = False, "TEXTURED"
    rods = cage.modifiers.new("rods", "WIREFRAME")
    # Rods have other vertices than the cage, so they are of the picture alone.
    rods.thickness, rods.show_viewport = 0.003 * size, False
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = center + size * np.array([0.62, -1.08, 0.25])
    camera.rotation_euler = (Vector(center) - camera.location).to_track_quat("-Z", "Y").to_euler()
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 2, (0.8, 0.2, 0.6)
    for each in (camera, sun):
        scene.collection.objects.link(each)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.5, 0.52, 0.55, 1)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 24, False
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT


def render(folder, name):
    path = os.path.join(folder, name + ".png")
    bpy.context.scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    pixels = np.empty(WIDTH * HEIGHT * 4, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(HEIGHT, WIDTH, 4)


def edit(model, frame):
    """Pulls the vertices at the top of the cage, as proportional editing does."""
    key = model.cager.cage.data.shape_keys.key_blocks[f"frame {frame}"]
    points = np.array([point.co for point in key.data])
    height = points[:, 2]
    weight = np.clip((height - np.quantile(height, 0.8)) / np.ptp(height[height > np.quantile(height, 0.8)]), 0, 1)
    points += 0.2 * np.ptp(height) * weight[:, None] * [0.8, 0, 0.1]
    key.data.foreach_set("co", points.astype(np.float32).ravel())
    model.cager.cage.data.update()


def main(capture, picture):
    bpy.ops.extensions.package_install_files(
        filepath=os.path.abspath("target/cager-blender.zip"), repo="user_default", enable_on_install=True
    )
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.preferences.addon_enable(module=MODULE)
    bpy.ops.cager.import_capture(filepath=os.path.abspath(capture))
    model, frame = bpy.context.object, 12
    bpy.context.scene.frame_set(frame)
    stage(model)
    with tempfile.TemporaryDirectory() as folder:
        bpy.context.scene.frame_set(frame)
        before = render(folder, "before")
        edit(model, frame)
        bpy.context.scene.frame_set(frame)
        after = render(folder, "after")
    both = np.concatenate([before, after], axis=1)
    image = bpy.data.images.new("both", 2 * WIDTH, HEIGHT)
    image.pixels.foreach_set(both.ravel())
    image.filepath_raw, image.file_format = os.path.abspath(picture), "PNG"
    image.save()


if __name__ == "__main__":
    main(*sys.argv[1:3])
