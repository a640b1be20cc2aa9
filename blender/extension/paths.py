"""Paths of captures: `//` is the folder of the .blend file, as everywhere in Blender, and stays right where that is saved elsewhere."""

import os

import bpy
import cager
from bpy.app.handlers import persistent
from bpy.props import StringProperty

from . import handlers

# Files of objects as they were, until the .blend file is written.
_before = {}


def file_property(name, description):
    """A path that may begin with `//`, which Blender 4.5 and later have to be told of."""
    options = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5) else set()
    return StringProperty(name=name, description=description, subtype="FILE_PATH", maxlen=1024, options=options)


def library_of(thing):
    """The library that an object, or that which it overrides, is linked from; None where it is of this .blend file."""
    override = thing.override_library
    return override.reference.library if override else thing.library


def library_of_edits(model):
    """The library of a model or of its cage's mesh, in which nothing can be edited here; None where both are of this .blend file."""
    cage = model.cager.cage
    return library_of(model) or (cage.data.library if cage else None)


def absolute(path, owner=None):
    """A path from the root of the disk; of the file that an object shows, which may be of a library in another folder."""
    return bpy.path.abspath(path, library=owner and library_of(owner))


def found(model):
    """The whole path of the capture that a model shows. A model that was appended from another folder has it where it was found there."""
    link = model.cager
    path = absolute(link.file, model)
    if link.file.startswith("//") and not os.path.exists(path) and os.path.exists(link.found):
        if os.path.basename(link.found) == os.path.basename(path):
            link.file = kept(link.found)
            return link.found
    return path


def chosen(path):
    """A path that was chosen, from the root of the disk. Raises CagerError."""
    if path.startswith("//") and not bpy.data.filepath:
        raise cager.CagerError(f"{path}: // is the folder of the .blend file, which is not saved yet: save it first, or give the whole path")
    return absolute(path)


def kept(path):
    """A path as the .blend file keeps it: relative to its folder where the preferences say so."""
    if bpy.data.filepath and not path.startswith("//"):
        return relative(path, bpy.data.filepath) if bpy.context.preferences.filepaths.use_relative_paths else path
    return path


def relative(path, blend):
    try:
        return bpy.path.relpath(path, start=os.path.dirname(blend))
    except ValueError:
        # It is on another drive.
        return path


@persistent
def before_saving(blend):
    """Follows the .blend file into another folder. Saved for the first time, it has a folder that paths can be relative to."""
    if not blend or os.path.dirname(blend) == os.path.dirname(bpy.data.filepath):
        return
    if bpy.data.filepath:
        goes_along = lambda path: path.startswith("//")
    else:
        goes_along = lambda path: os.path.isabs(path) and bpy.context.preferences.filepaths.use_relative_paths
    for thing in bpy.data.objects:
        path = thing.cager.file
        if goes_along(path) and not library_of(thing):
            _before[thing] = path
            thing.cager.file = relative(bpy.path.abspath(path), blend)


@persistent
def after_saving(blend):
    """A copy that was saved leaves this file where it is."""
    if blend != bpy.data.filepath:
        for thing, path in _before.items():
            thing.cager.file = path
    _before.clear()


HANDLERS = (("save_pre", before_saving), ("save_post", after_saving), ("save_post_fail", after_saving))


def register():
    handlers.add(HANDLERS)


def unregister():
    handlers.remove(HANDLERS)
    _before.clear()
