"""The tab CageR in the sidebar of the 3D view."""

import os
import textwrap

import bpy

from . import bake, captures, encode_operators, live, paths


class CagerPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "CageR"


class CapturePanel(CagerPanel, bpy.types.Panel):
    bl_idname = "VIEW3D_PT_cager_capture"
    bl_label = "Capture"

    def draw(self, context):
        layout = self.layout
        layout.operator("cager.import_capture", text="Import", icon="IMPORT")
        model = captures.model_of(context.object)
        if model is None:
            lines(layout, "Click on an imported model or its cage to edit or export it.")
            return
        link = model.cager
        column = layout.column(align=True)
        column.label(text=os.path.basename(link.file), icon="MESH_DATA")
        column.prop(link, "file", text="")
        column.prop(link, "cage")
        problem = live.problems.get(model.name_full)
        if problem:
            lines(layout.box(), problem, icon="ERROR")
            return
        if paths.library_of_edits(model):
            lines(layout.box(), "Linked: it plays here. To edit its cage, append it, or choose Object > Relations > Make Local > All.", icon="LINKED")
            layout.operator("cager.export", text="Export", icon="EXPORT")
            return
        column = layout.column(align=True)
        column.operator("cager.edit_frame", icon="EDITMODE_HLT")
        column.operator("cager.save_edits", icon="FILE_TICK")
        column.operator("cager.export", text="Export", icon="EXPORT")
        draw_bake(layout, model)


class EncodePanel(CagerPanel, bpy.types.Panel):
    bl_idname = "VIEW3D_PT_cager_encode"
    bl_label = "Encode"

    def draw(self, context):
        layout, chosen, running = self.layout, context.scene.cager, encode_operators.running
        if running is not None:
            layout.progress(factor=running.fraction, text=f"{running.name}: {running.stage}")
            layout.operator("cager.cancel_encoding", text="Cancel", icon="CANCEL")
            return
        layout.use_property_split = True
        layout.prop(chosen, "cage")
        if chosen.cage is None:
            layout.prop(chosen, "vertices")
        layout.prop(chosen, "samples")
        layout.prop(chosen, "keep")
        if chosen.keep == "ERROR":
            layout.prop(chosen, "max_error")
        layout.prop(chosen, "show")
        layout.operator("cager.encode", icon="RENDER_ANIMATION")
        words, is_error = encode_operators.told
        if words:
            lines(layout.box(), words, icon="ERROR" if is_error else "CHECKMARK")


def draw_bake(layout, model):
    column = layout.column(align=True)
    column.operator("cager.bake", icon="RENDER_ANIMATION")
    if bake.modifier_of(model) is None:
        lines(column, "Without this extension the model stands still, as on render farms, unless it is baked.", icon="INFO")
    elif model.name_full in bake.stale:
        lines(column, "It has changed since it was baked: bake it again.", icon="ERROR")
    else:
        lines(column, "Baked: it plays without this extension, too.", icon="CHECKMARK")


def lines(layout, words, icon="NONE"):
    column = layout.column(align=True)
    for k, line in enumerate(textwrap.wrap(words, 40)):
        column.label(text=line, icon="NONE" if k else icon)


CLASSES = (CapturePanel, EncodePanel)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
