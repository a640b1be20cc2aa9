"""The library of Alembic beside us. `make_alembic.py FILE` writes a triangle below a transform that moves, an instance of it below one that stands still,
and an instance of the transform below one that moves."""

import sys

import imath
from alembic3d import Abc, AbcCoreAbstract, AbcGeom

top = Abc.OArchive(sys.argv[1]).getTop()
times = AbcCoreAbstract.TimeSampling(1 / 24, 1 / 24)


def place(parent, name, *at):
    xform = AbcGeom.OXform(parent, name)
    xform.getSchema().setTimeSampling(times)
    for x, y, z in at:
        sample = AbcGeom.XformSample()
        sample.setTranslation(imath.V3d(x, y, z))
        xform.getSchema().set(sample)
    return xform


tree = place(top, "tree", (0, 0, 0), (0, 0, 1))
leaf = AbcGeom.OPolyMesh(tree, "leaf")
points, corners, counts = imath.V3fArray(3), imath.IntArray(3), imath.IntArray(1)
for k, point in enumerate([(0, 0, 0), (1, 0, 0), (0, 1, 0)]):
    points[k], corners[k] = imath.V3f(*point), 2 - k
counts[0] = 3
leaf.getSchema().set(AbcGeom.OPolyMeshSchemaSample(points, corners, counts))
red = leaf.getSchema().createFaceSet("red")
faces = imath.IntArray(1)
faces[0] = 0
red.getSchema().set(AbcGeom.OFaceSetSchemaSample(faces))
assert place(top, "a", (10, 0, 0)).addChildInstance(leaf, "leaf_a")
assert place(top, "b", (0, 20, 0), (0, 30, 0)).addChildInstance(tree, "tree_b")
