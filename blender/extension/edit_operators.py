"""Edits a cage in a frame, saves edited cages, and exports what is seen for other programs."""

import os

import bpy
import cager
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import bake, captures, paths, times
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

    def edited(self, context, name=""):
        """The capture as it is seen, edits in a layer of this name; None after a report of why there is none."""
        model = captures.model_of(context.object)
        try:
            return (model, *edited_capture(context, model, name))
        except (cager.CagerError, OSError, Refused) as error:
            self.report({"ERROR"}, str(error))
            return None

    def refused_as_linked(self, context):
        """Reports that the capture is of a library, which Blender does not change."""
        library = paths.library_of_edits(captures.model_of(context.object))
        if library:
            self.report(
                {"ERROR"},
                f"The capture is linked from {os.path.basename(library.filepath)}: to edit its cage or to bake it, append it instead, or choose Object > Relations > Make Local > All.",
            )
        return library is not None


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
        try:
            now = times.now(context.scene)
            time = captures.time_of(model, captures.place_of(model, now)[0])
        except (cager.CagerError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        is_there = keys and -times.SAME <= now - time < max(1, captures.step_after(model, time))
        place = keys.key_blocks.find(key_name(time)) if is_there else -1
        if place < 0:
            self.report({"ERROR"}, f"There is no cage for frame {times.words(now)}: go to a frame of the capture, and import it with its cage.")
            return {"CANCELLED"}
        leave_edit_mode(context)
        if abs(now - time) > times.SAME:
            times.go_to(context.scene, time)
        for each in context.selected_objects:
            each.select_set(False)
        cage.select_set(True)
        context.view_layer.objects.active = cage
        cage.active_shape_key_index = place
        bpy.ops.object.mode_set(mode="EDIT")
        return {"FINISHED"}


class SaveEdits(OfModel, bpy.types.Operator, ExportHelper):
    """Write a .cager file with the edits as one more layer, all else as it was; the model shows it from then on"""

    bl_idname = "cager.save_edits"
    bl_label = "Save edited cages"

    filename_ext = ".cager"
    filepath: paths.file_property("File", "The .cager file to write")
    filter_glob: StringProperty(default="*.cager", options={"HIDDEN"})
    layer: StringProperty(name="Layer", description="The name of the layer that keeps these edits, which cager edit switches off and takes back")

    def execute(self, context):
        found = None if self.refused_as_linked(context) else self.edited(context, self.layer)
        if found is None:
            return {"CANCELLED"}
        model, capture, frames = found
        if not frames:
            self.report({"WARNING"}, "No cage was edited, so nothing is written: move vertices of the cage first.")
            return {"CANCELLED"}
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
    up: EnumProperty(
        name="Up",
        items=(
            ("AUTO", "As usual", "Y in Alembic and glTF, as programs take it, and as the capture has it in others"),
            ("Y", "Y", "Y points up"),
            ("Z", "Z", "Z points up"),
        ),
    )
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
        try:
            path = paths.chosen(with_ending(self.filepath, self.format))
            up = self.up.lower()
            if self.up == "AUTO":
                up = "y" if self.format == "abc" and capture.up else None
            losses = capture.export(path, overwrite=True, with_cage=self.with_cage and self.format in ("usdc", "usdz"), up=up)
        except (cager.CagerError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for loss in losses:
            self.report({"INFO"}, loss)
        self.report({"INFO"}, f"{os.path.basename(path)}: {len(capture)} frames" + (f", edited in {spans(frames)}" if frames else ""))
        return {"FINISHED"}


class Bake(OfModel, bpy.types.Operator):
    """Write what is seen of the model into a cache beside the .blend file, for machines that render without this extension"""

    bl_idname = "cager.bake"
    bl_label = "Bake for rendering"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        found = None if self.refused_as_linked(context) else self.edited(context)
        if found is None:
            return {"CANCELLED"}
        model, capture, _ = found
        try:
            path = bake.bake(model, capture)
        except (cager.CagerError, OSError, Refused) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        megabytes = os.path.getsize(path) / 1e6
        self.report({"INFO"}, f"{os.path.basename(path)}: {megabytes:.1f} MB. Save the .blend file, and keep the cache beside it")
        return {"FINISHED"}


def with_ending(path, ending):
    stem, found = os.path.splitext(path)
    known = {each[0] for each in FORMATS} | {"cager"}
    return (stem if found[1:].lower() in known else path) + "." + ending


def menu(self, _):
    self.layout.operator(Export.bl_idname, text="CageR capture (.usdc, .abc, .glb)")


CLASSES = (EditFrame, SaveEdits, Export, Bake)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_export.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(menu)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
