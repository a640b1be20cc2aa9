"""Import, play, edit and encode .cager captures of animated meshes."""

from . import bake, captures, edit_operators, encode_operators, import_operators, live, panel, paths, settings

PARTS = (settings, import_operators, edit_operators, encode_operators, panel, paths, live, bake)


def register():
    for part in PARTS:
        part.register()


def unregister():
    for part in reversed(PARTS):
        part.unregister()
    captures.forget()
