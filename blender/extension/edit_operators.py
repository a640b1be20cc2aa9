"""Edits a cage in a frame, saves edited cages, and exports what is seen for other programs."""

import math
import os

import bpy
import cager
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import captures, paths, times
from .edits import edited_capture, leave_edit_mode, spans
from .keys import key_name
from .reading import Refused

FORMATS = (
    ("usdc", "USD (.usdc)", "Universal Scene Description, for Houdini, Maya, Unreal and Omniverse"),
    ("abc", "Alembic (.abc)", "For most programs of animation and effects"),
    ("glb", "glTF (.glb)", "Morph targets, for the web and for engines"),
    ("usdz", "USD package (.usdz)", "Universal Scene Description in one file, for phones"),
    ("pc2", "Point cache (.pc2)", "For 3ds Max, and Blender's Mesh Cache modifier"),
    ("mdd", "Point cache (.mdd)", "For LightWave and Cinema 4D, and Blender's Mesh Cache modifier"),
    ("npy", "NumPy array (.npy)", "Frames, vertices and coordinates for Python"),
)


class OfModel:
    """What works on the active model, or on that of the active cage."""

    @classmethod
    def poll(cls, context):
        cls.poll_message_set("Click on a model that was imported from a .cager file, or on its cage")
        return captures.model_of(context.object) is not None

    def edited(self, context):
        """The capture as it is seen; None after a report of why there is none."""
        model = captures.model_of(context.object)
        try:
            return (model, *edited_capture(context, model))
        except (cager.CagerError, OSError, Refused) as error:
            self.report({"ERROR"}, str(error))
            return None

    def refused_as_linked(self, context):
        """Reports that the capture is of a library, which Blender does not change."""
        library = paths.library_of_edits(captures.model_of(context.object))
        if library:
            self.report(
                {"ERROR"},
                f"The capture is linked from {os.path.basename(library.filepath)}: to edit its cage, append it instead, or choose Object > Relations > Make Local > All.",
            )
        return library is not None

    def warn_of_details(self, model, frames):
        if frames and captures.of_model(model).has_details:
            self.report(
                {"WARNING"},
                "Details that the cage does not follow are left out, as they belong to the cages before they were edited. To keep them, encode with Keep: Motion of the cage",
            )


class EditFrame(OfModel, bpy.types.Operator):
    """Edit the cage as it is in this frame: move its vertices, and the model follows"""

    bl_idname = "cager.edit_frame"
    bl_label = "Edit cage in this frame"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        if self.refused_as_linked(context):
            return {"CANCELLED"}
        model = captures.model_of(context.object)
        cage = model.cager.cage
        keys = cage and cage.data.shape_keys
        frame = math.floor(times.now(context.scene))
        place = keys.key_blocks.find(key_name(frame)) if keys else -1
        if place < 0:
            self.report({"ERROR"}, f"There is no cage for frame {frame}: go to a frame of the capture, and import it with its cage.")
            return {"CANCELLED"}
        leave_edit_mode(context)
        if frame != times.now(context.scene):
            times.go_to(context.scene, frame)
        for each in context.selected_objects:
            each.select_set(False)
        cage.select_set(True)
        context.view_layer.objects.active = cage
        cage.active_shape_key_index = place
        bpy.ops.object.mode_set(mode="EDIT")
        return {"FINISHED"}


class SaveEdits(OfModel, bpy.types.Operator, ExportHelper):
    """Write a .cager file with the cages as they are edited; the model shows it from then on"""

    bl_idname = "cager.save_edits"
    bl_label = "Save edited cages"

    filename_ext = ".cager"
    filepath: paths.file_property("File", "The .cager file to write")
    filter_glob: StringProperty(default="*.cager", options={"HIDDEN"})

    def execute(self, context):
        found = None if self.refused_as_linked(context) else self.edited(context)
        if found is None:
            return {"CANCELLED"}
        model, capture, frames = found
        if not frames:
            self.report({"WARNING"}, "No cage was edited, so nothing is written: move vertices of the cage first.")
            return {"CANCELLED"}
        self.warn_of_details(model, frames)
        try:
            path = paths.chosen(self.filepath)
            capture.save(path, overwrite=True)
        except (cager.CagerError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        captures.forget(path)
        model.cager.file = paths.kept(path)
        times.again(context.scene)
        self.report({"INFO"}, f"{os.path.basename(path)}: edited in frames {spans(frames)}")
        return {"FINISHED"}


class Export(OfModel, bpy.types.Operator, ExportHelper):
    """Write all frames of the capture as they are seen, edits included, for another program"""

    bl_idname = "cager.export"
    bl_label = "Export CageR capture"

    filename_ext = ""
    filepath: paths.file_property("File", "The file to write, with the ending of the format")
    check_extension = None
    format: EnumProperty(name="Format", items=FORMATS)
    with_cage: BoolProperty(name="With cage", description="Keep the cage in USD as a second mesh, a guide that is not rendered")

    def check(self, _):
        path = with_ending(self.filepath, self.format)
        changed, self.filepath = path != self.filepath, path
        return changed

    def execute(self, context):
        found = self.edited(context)
        if found is None:
            return {"CANCELLED"}
        model, capture, frames = found
        self.warn_of_details(model, frames)
        try:
            path = paths.chosen(with_ending(self.filepath, self.format))
            losses = capture.export(path, overwrite=True, with_cage=self.with_cage and self.format in ("usdc", "usdz"))
        except (cager.CagerError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for loss in losses:
            self.report({"INFO"}, loss)
        self.report({"INFO"}, f"{os.path.basename(path)}: {len(capture)} frames" + (f", edited in {spans(frames)}" if frames else ""))
        return {"FINISHED"}


def with_ending(path, ending):
    stem, found = os.path.splitext(path)
    known = {each[0] for each in FORMATS} | {"cager"}
    return (stem if found[1:].lower() in known else path) + "." + ending


def menu(self, _):
    self.layout.operator(Export.bl_idname, text="CageR capture (.usdc, .abc, .glb)")


CLASSES = (EditFrame, SaveEdits, Export)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_export.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(menu)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
