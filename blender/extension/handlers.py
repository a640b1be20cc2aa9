"""Handlers of Blender that come and go with the extension: pairs of a list of `bpy.app.handlers` and a function."""

import bpy


def add(handlers):
    for name, handler in handlers:
        getattr(bpy.app.handlers, name).append(handler)


def remove(handlers):
    for name, handler in handlers:
        there = getattr(bpy.app.handlers, name)
        if handler in there:
            there.remove(handler)
