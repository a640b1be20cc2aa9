"""Encodes the active object, with a progress bar and a button that stops it."""

import os

import bpy
import cager
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from . import captures, import_operators, paths
from .edits import leave_edit_mode
from .encoding import Encoding
from .reading import Refused

running = None
# What the last encoding came to, and whether that is an error.
told = ("", False)


class EncodeSelected(bpy.types.Operator, ExportHelper):
    """Write the active object, as it moves in the scene's frames, as a .cager capture. Blender can be used meanwhile"""

    bl_idname = "cager.encode"
    bl_label = "Encode selected"

    filename_ext = ".cager"
    filepath: paths.file_property("File", "The .cager file to write")
    filter_glob: StringProperty(default="*.cager", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        cls.poll_message_set("Click on the animated object first; one object is encoded at a time")
        return context.object is not None and running is None

    def execute(self, context):
        global running, told
        try:
            path = paths.chosen(self.filepath)
            leave_edit_mode(context)
            running = Encoding(context, context.object, path)
        except (Refused, cager.CagerError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        told = ("", False)
        if not bpy.app.background:
            bpy.app.timers.register(tick)
            return {"FINISHED"}
        # Without windows there are no timers.
        while tick() is not None:
            pass
        words, is_error = told
        self.report({"ERROR" if is_error else "INFO"}, words)
        return {"CANCELLED" if is_error else "FINISHED"}


class CancelEncoding(bpy.types.Operator):
    """Stop the encoding; nothing is written"""

    bl_idname = "cager.cancel_encoding"
    bl_label = "Cancel encoding"

    @classmethod
    def poll(cls, _):
        return running is not None

    def execute(self, _):
        running.cancel()
        return {"FINISHED"}


def tick():
    """Goes on with the encoding; the seconds until it wants to again, None once it is done."""
    global running, told
    context = bpy.context
    if running is None:
        return None
    if running.step(context):
        done, running = running, None
        told = finish(context, done)
        words, is_error = told
        if is_error and not bpy.app.background:
            context.window_manager.popup_menu(lambda menu, _: menu.layout.label(text=words), title="Encoding", icon="ERROR")
    redraw(context)
    return None if running is None else 0.05


def finish(context, done):
    if done.error:
        return done.error, True
    captures.forget(done.path)
    name = os.path.basename(done.path)
    try:
        if done.shows:
            import_operators.imported(context, done.path, done.first, set_range=False)
        return f"{name}: {done.summary()}", False
    except (cager.CagerError, OSError) as error:
        return str(error), True


def redraw(context):
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def stop(*_):
    """Ends what is running, as another file is opened or Blender closed."""
    global running
    if bpy.app.timers.is_registered(tick):
        bpy.app.timers.unregister(tick)
    if running is not None:
        running.cancel()
        if running.thread:
            # It ends at its next report of progress, and writes nothing.
            running.thread.join(5)
        running = None


CLASSES = (EncodeSelected, CancelEncoding)


@bpy.app.handlers.persistent
def on_load(*_):
    stop()


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.app.handlers.load_pre.append(on_load)


def unregister():
    stop()
    if on_load in bpy.app.handlers.load_pre:
        bpy.app.handlers.load_pre.remove(on_load)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
