"""The panel draws what there is: properties, operators and icons that Blender knows."""

import bpy

from conftest import part

ICONS = {item.identifier for item in bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items}


class Layout:
    """Stands in for the layout that Blender hands out where it has windows."""

    use_property_split = False

    def __init__(self, drawn):
        self.drawn = drawn

    def box(self):
        return self

    def column(self, align=False):
        return self

    def label(self, text, icon="NONE"):
        assert icon in ICONS
        self.drawn.append(text)

    def prop(self, data, name, text=None):
        assert name in data.bl_rna.properties
        self.drawn.append(name)

    def operator(self, name, text=None, icon="NONE"):
        assert icon in ICONS
        getattr(bpy.ops.cager, name.removeprefix("cager.")).get_rna_type()
        self.drawn.append(name)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.drawn.append(text)


def drawn(panel):
    class Drawn:
        layout = Layout([])

    getattr(part("panel"), panel).draw(Drawn, bpy.context)
    return Drawn.layout.drawn


def test_the_panel_shows_what_can_be_done(scene, small):
    assert drawn("CapturePanel")[:1] == ["cager.import_capture"] and "cager.export" not in drawn("CapturePanel")
    bpy.ops.cager.import_capture(filepath=small.path)
    model = bpy.context.object
    for active in (model, model.cager.cage, model.parent):
        bpy.context.view_layer.objects.active = active
        assert {"small.cager", "cager.edit_frame", "cager.save_edits", "cager.export", "cager.bake"} <= set(drawn("CapturePanel"))
    assert "Without this extension the model stands still" in " ".join(drawn("CapturePanel"))
    model.cager.file = "/nowhere/gone.cager"
    scene.frame_set(5)
    assert "gone.cager" in "".join(drawn("CapturePanel")) and "cager.export" not in drawn("CapturePanel")


def test_the_panel_shows_how_far_an_encoding_is(scene, small, monkeypatch):
    operators = part("encode_operators")
    assert {"cage", "vertices", "samples", "keep", "show", "cager.encode"} <= set(drawn("EncodePanel"))
    scene.cager.keep = "ERROR"
    assert "max_error" in drawn("EncodePanel")
    bpy.ops.cager.import_capture(filepath=small.path)
    job = part("encoding").Encoding(bpy.context, bpy.context.object, "unused.cager")
    job.step(bpy.context, seconds=0)
    monkeypatch.setattr(operators, "running", job)
    assert drawn("EncodePanel") == ["small model: reading frames", "cager.cancel_encoding"]
    monkeypatch.setattr(operators, "running", None)
    monkeypatch.setattr(operators, "told", ("It went wrong.", True))
    assert drawn("EncodePanel")[-1] == "It went wrong."
