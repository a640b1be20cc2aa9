"""The whole way from Blender to cages and back, in Blender itself: python round_trip.py PROGRAM, where `import bpy` works."""

import importlib.util
import os
import subprocess
import sys
import tempfile

import bpy
import numpy as np

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
FIRST, LAST = 5, 16
EXACT = 1e-5


def script(name):
    spec = importlib.util.spec_from_file_location("cager_" + name, os.path.join(ROOT, "blender", name + ".py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


blender_export, blender_import = script("export"), script("import")


def scene():
    """A tube that is bent by a modifier and carried about by its own transform, and a cage around it that is split along its edges."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    now = bpy.context.scene
    now.frame_start, now.frame_end, now.render.fps = FIRST, LAST, 30
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.4, depth=4, end_fill_type="TRIFAN")
    tube = bpy.context.object
    tube.name = "Tube"
    cut = tube.modifiers.new("rings", "SUBSURF")
    cut.subdivision_type, cut.levels, cut.render_levels = "SIMPLE", 3, 3
    bend = tube.modifiers.new("bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.deform_axis = "BEND", "X"
    for frame, angle, place in ((FIRST, 0.0, (0, 0, 0)), (LAST, 1.2, (3, 1, -2))):
        bend.angle = angle
        bend.keyframe_insert("angle", frame=frame)
        tube.location, tube.rotation_euler = place, (0.3 * angle, 0, angle)
        tube.keyframe_insert("location", frame=frame)
        tube.keyframe_insert("rotation_euler", frame=frame)
    tube.scale = (1.5, 1, 1)
    bpy.ops.mesh.primitive_cube_add()
    cage = bpy.context.object
    cage.name, cage.scale = "Cage", (0.7, 0.5, 2.2)
    modifier = cage.modifiers.new("more", "SUBSURF")
    modifier.subdivision_type, modifier.levels, modifier.render_levels = "SIMPLE", 2, 2
    cage.modifiers.new("split", "EDGE_SPLIT").split_angle = 0.5
    return tube, cage


def shown(thing):
    """Positions in the world in every frame of the scene, as an artist sees them."""
    return blender_export.positions(thing)[0]


def run(program, folder, line):
    done = subprocess.run([program, *line.split()], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, "%s: %s" % (line, done.stderr)


def equal(what, found, wanted, limit=EXACT):
    apart = np.abs(found - wanted).max()
    assert found.shape == wanted.shape and apart <= limit, "%s: %s apart" % (what, apart)
    print("%s: at most %.1e apart" % (what, apart))


def round_trip(program, folder):
    tube, cage = scene()
    said = blender_export.export(tube, cage, folder)
    assert "%d frames" % (LAST - FIRST + 1) in said and "welded" in said, said
    truth = shown(tube)
    equal("exported frames", np.load(os.path.join(folder, "frames.npy")), truth)

    run(program, folder, "encode --rest rest.obj --cage cage.obj --frames frames.npy -o walk.cager --handles all --spectrum 0")
    run(program, folder, "decode walk.cager -o walk.pc2")
    run(program, folder, "decode walk.cager -o walk.npy")
    decoded = np.load(os.path.join(folder, "walk.npy"))
    size = np.linalg.norm(np.ptp(truth[0], axis=0))
    assert np.sqrt(((decoded - truth) ** 2).sum(2).mean()) < 0.03 * size, "the encoding is far from the animation"
    double = blender_import.play(tube, os.path.join(folder, "walk.pc2"))
    equal("Mesh Cache of the decoded model", shown(double), decoded)

    run(program, folder, "decode walk.cager --cages -o cages.pc2")
    run(program, folder, "decode walk.cager --cages -o cages.npy")
    stored = np.load(os.path.join(folder, "cages.npy"))
    back = blender_import.cages(os.path.join(folder, "cages.cage.obj"), os.path.join(folder, "cages.pc2"))
    equal("shape keys of the cages", shown(back), stored)
    plain = bpy.data.objects.new("plain", bpy.data.meshes["cage"].copy())
    bpy.context.scene.collection.objects.link(plain)
    plain.shape_key_clear()
    blender_import.add_mesh_cache(plain, os.path.join(folder, "cages.pc2"), FIRST)
    equal("Mesh Cache of the cages", shown(plain), stored)

    # An artist moves the cage as a whole, and one of its vertices in one frame.
    blender_export.export(back, None, folder)
    run(program, folder, "decode walk.cager --with-cages edited.npy -o same.npy")
    equal("decoded with cages that were not edited", np.load(os.path.join(folder, "same.npy")), decoded)
    back.location = (0, 0, 2)
    back.data.shape_keys.key_blocks["frame %d" % (FIRST + 3)].data[0].co.x += 0.25
    bpy.context.view_layer.update()
    assert blender_export.export(back, None, folder).startswith("edited.npy"), "a cage is not written as edited"
    run(program, folder, "decode walk.cager --with-cages edited.npy -o edited.pc2")
    run(program, folder, "edit walk.cager --with-cages edited.npy -o edited.cager")
    run(program, folder, "decode edited.cager -o edited-walk.npy")
    edited = np.load(os.path.join(folder, "edited-walk.npy"))
    equal("Mesh Cache of the edited model", shown(blender_import.play(tube, os.path.join(folder, "edited.pc2"))), edited)
    rest = np.arange(LAST - FIRST + 1) != 3
    equal("frames moved as a whole", edited[rest], decoded[rest] + (0, 0, 2))
    assert np.abs(edited[3] - decoded[3] - (0, 0, 2)).max() > 0.01, "the edited vertex moves nothing"


def refusals(folder):
    """What the scripts say where something is wrong."""
    tube, cage = scene()

    def refused(what, words):
        try:
            what()
        except RuntimeError as error:
            assert all(word in str(error) for word in words), error
            print("refused: %s" % error)
        else:
            raise AssertionError("not refused: %s" % words)

    bpy.context.view_layer.objects.active = None
    refused(lambda: blender_export.export(None, None, folder), ["Nothing is active"])
    light = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    refused(lambda: blender_export.export(light, None, folder), ["Lamp is no mesh"])
    build = tube.modifiers.new("build", "BUILD")
    build.frame_start, build.frame_duration = FIRST - 5, 20
    refused(lambda: blender_export.export(tube, None, folder), ["Tube has", "remesh, decimate", "frame %d" % FIRST])
    tube.modifiers.remove(build)
    open_cage = bpy.data.meshes.new("open")
    open_cage.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)], [],
                          [(0, 2, 1), (0, 1, 3), (0, 3, 2), (0, 1, 4)])
    walls = bpy.data.objects.new("Walls", open_cage)
    bpy.context.scene.collection.objects.link(walls)
    refused(lambda: blender_export.export_cage(walls, os.path.join(folder, "bad.obj")), ["Walls stays open"])
    assert not os.path.exists(os.path.join(folder, "bad.obj"))
    holed = bpy.data.meshes.new("holed")
    holed.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [], [(0, 1, 2), (0, 1, 3), (1, 2, 3)])
    lid = bpy.data.objects.new("Lid", holed)
    bpy.context.scene.collection.objects.link(lid)
    assert "holes closed" in blender_export.export_cage(lid, os.path.join(folder, "lid.obj"))
    refused(lambda: blender_import.play(lid, os.path.join(folder, "walk.pc2")), ["Lid has 4 vertices"])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        round_trip(os.path.abspath(sys.argv[1]), place)
        refusals(place)
    print("the round trip through Blender %s is exact" % bpy.app.version_string)
