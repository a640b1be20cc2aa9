"""Prints what the Alembic library reads of what lies on the faces of the meshes of an archive: a line of each thing, corners clockwise as they are stored."""

import sys

import imath  # noqa: F401  Its types have to be known before those of the library.
from alembic3d import Abc, AbcGeom


def numbers(values):
    """Numbers of vectors, colours or neither, rounded to what an eye tells apart."""
    flat = [x for value in values for x in (value if hasattr(value, "__len__") else [value])]
    return " ".join(f"{x:.3f}".rstrip("0").rstrip(".") for x in flat)


def samples(values):
    times = values.getTimeSampling()
    return [Abc.ISampleSelector(times.getSampleTime(k)) for k in range(values.getNumSamples())]


def show(parent, header, kind):
    mesh = kind(parent, header.getName())
    schema = mesh.getSchema()
    first = schema.getValue(Abc.ISampleSelector(0.0))
    print(mesh.getFullName(), kind.__name__)
    print("faces", *first.getFaceCounts(), ":", *first.getFaceIndices())
    uvs = schema.getUVsParam()
    if uvs.valid():
        value = uvs.getExpandedValue(Abc.ISampleSelector(0.0))
        print("uv", uvs.getMetaData().get("sourceName"), value.getScope(), numbers(value.getVals()))
    if kind is AbcGeom.ISubD:
        sharp = numbers(first.getCreaseSharpnesses() or [])
        print("creases", first.getSubdivisionScheme(), *first.getCreaseIndices() or [], ":", *first.getCreaseLengths() or [], ":", sharp)
    elif schema.getNormalsParam().valid():
        normals = schema.getNormalsParam()
        for sample in samples(normals):
            value = normals.getExpandedValue(sample)
            print("normals", value.getScope(), numbers(value.getVals()))
    others = schema.getArbGeomParams()
    for k in range(others.getNumProperties() if others.valid() else 0):
        name = others.getPropertyHeader(k).getName()
        for kind in [AbcGeom.IV2fGeomParam, AbcGeom.IC4fGeomParam]:
            if kind.matches(others.getPropertyHeader(k)):
                value = kind(others, name).getExpandedValue(Abc.ISampleSelector(0.0))
                print("other", kind.__name__, name, value.getScope(), numbers(value.getVals()))
    for name in schema.getFaceSetNames():
        faces = schema.getFaceSet(name).getSchema()
        print("set", name, faces.getFaceExclusivity(), *faces.getValue(Abc.ISampleSelector(0.0)).getFaces())


def visit(parent):
    for k in range(parent.getNumChildren()):
        child = parent.getChild(k)
        visible = AbcGeom.GetVisibilityProperty(child)
        if visible and visible.getNumSamples() > 1:
            print(child.getFullName(), "shown", *[int(AbcGeom.GetVisibility(child, sample)) for sample in samples(visible)])
        for kind in [AbcGeom.IPolyMesh, AbcGeom.ISubD]:
            if kind.matches(child.getMetaData()):
                show(parent, child, kind)
        visit(child)


visit(Abc.IArchive(sys.argv[1]).getTop())
