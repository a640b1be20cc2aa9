"""What is kept in the .blend file: which object shows which capture, and how selected objects are encoded."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import paths, times


def is_mesh(_, thing):
    return thing.type == "MESH"


class CagerLink(bpy.types.PropertyGroup):
    """The capture that an object shows; none where it has no file."""

    file: paths.file_property("File", "The .cager file that this object shows")
    found: StringProperty(options={"HIDDEN"}, description="The whole path of the file where it was last")
    first: times.first_frame_property()
    baked: StringProperty(options={"HIDDEN"}, description="What tells whether the cache for rendering shows what is seen")
    cage: PointerProperty(name="Cage", type=bpy.types.Object, poll=is_mesh, description="The object that is edited")


class CagerEncoding(bpy.types.PropertyGroup):
    """How a selected object is encoded."""

    cage: PointerProperty(
        name="Cage",
        type=bpy.types.Object,
        poll=is_mesh,
        description="A closed mesh around the object, as it is in the first frame. Without it a cage is made, which takes about half a minute",
    )
    keep: EnumProperty(
        name="Keep",
        items=(
            ("CAGE", "Motion of the cage", "The model follows its cage exactly, and is what the cage says alone"),
            ("ERROR", "Details up to an error", "Details that the cage does not follow are kept as well, in a smaller file, also where the cage is edited"),
        ),
        default="CAGE",
    )
    max_error: FloatProperty(
        name="Largest error",
        subtype="PERCENTAGE",
        min=0.001,
        max=10,
        default=0.1,
        precision=3,
        description="No vertex is farther from its place than this part of the model's size (the diagonal of its bounding box)",
    )
    vertices: IntProperty(
        name="Vertices", min=0, max=5000, default=0, description="Vertices of the cage that is made; 0 chooses a number that suits"
    )
    samples: IntProperty(
        name="Samples",
        min=1,
        max=64,
        default=1,
        description="How often each frame is read: more than once for motion that is fast within a frame, which the capture then has between frames",
    )
    show: BoolProperty(name="Import when done", default=True, description="Add the encoded capture to the scene")


CLASSES = (CagerLink, CagerEncoding)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Object.cager = PointerProperty(type=CagerLink)
    bpy.types.Scene.cager = PointerProperty(type=CagerEncoding)


def unregister():
    del bpy.types.Scene.cager, bpy.types.Object.cager
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
