"""File > Import > CageR capture, also by dropping a file on the 3D view."""

import math

import bpy
import cager
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ImportHelper

from . import captures, objects, paths, times


class ImportCapture(bpy.types.Operator, ImportHelper):
    """Add a .cager capture to the scene: a model that is decoded as it plays, and the cage that moves it"""

    bl_idname = "cager.import_capture"
    bl_label = "Import CageR capture"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".cager"
    filepath: paths.file_property("File", "The .cager file to add")
    filter_glob: StringProperty(default="*.cager", options={"HIDDEN"})
    own_frames: BoolProperty(
        name="At its own frames", default=True, description="Show the capture at the frames that it was made of, from 0 where it does not say"
    )
    # Not remembered: it counts where it is given.
    first: times.first_frame_property(options={"SKIP_SAVE"})
    up: EnumProperty(
        name="Up",
        items=(
            ("AUTO", "As it says", "Turn the capture where it says that Y points up"),
            ("Y", "Y", "Turn a capture of a program whose upward axis is Y, such as Maya"),
            ("Z", "Z", "Leave the capture as it is"),
        ),
    )
    to_unit: BoolProperty(
        name="Scale to the scene's unit", default=True, description="Let the capture be as large as it was, where it says its unit and the scene has one"
    )
    with_cage: BoolProperty(name="Cage", default=True, description="Add the cage, with a shape key for each frame to edit")
    set_range: BoolProperty(
        name="Set frame range", default=True, description="Let the scene begin and end with the capture, at its frame rate where it has one"
    )

    def execute(self, context):
        try:
            first = None if self.own_frames and not self.properties.is_property_set("first") else self.first
            up = None if self.up == "AUTO" else self.up.lower()
            model = imported(context, self.filepath, first, up, self.with_cage, self.set_range, self.to_unit)
        except (cager.CagerError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for each in context.selected_objects:
            each.select_set(False)
        model.select_set(True)
        context.view_layer.objects.active = model
        return {"FINISHED"}

    def draw(self, _):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "own_frames")
        if not self.own_frames:
            layout.prop(self, "first")
        for name in ("up", "to_unit", "with_cage", "set_range"):
            layout.prop(self, name)


def imported(context, path, first=None, up=None, with_cage=True, set_range=True, to_unit=True):
    """Adds a capture to the scene and shows it; returns its model. Raises CagerError."""
    scene = context.scene
    model = objects.add(context, path, first, up, with_cage, to_unit)
    if set_range:
        capture = captures.of_model(model).capture
        # Scenes do not begin below 0.
        begin, end = math.floor(captures.time_of(model, 0)), math.ceil(captures.time_of(model, len(capture) - 1) - times.SAME)
        scene.frame_start, scene.frame_end = max(begin, 0), max(end, 0)
        if capture.frame_rate:
            # Blender keeps a whole number and what it is divided by.
            scene.render.fps = max(1, round(capture.frame_rate))
            scene.render.fps_base = scene.render.fps / capture.frame_rate
    # The model is written while frames are rendered.
    scene.render.use_lock_interface = True
    times.again(scene)
    return model


class CaptureFiles(bpy.types.FileHandler):
    bl_idname = "CAGER_FH_capture"
    bl_label = "CageR capture"
    bl_import_operator = "cager.import_capture"
    bl_file_extensions = ".cager"

    @classmethod
    def poll_drop(cls, context):
        return context.area and context.area.type == "VIEW_3D"


def menu(self, _):
    self.layout.operator(ImportCapture.bl_idname, text="CageR capture (.cager)")


CLASSES = (ImportCapture, CaptureFiles)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_import.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(menu)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
