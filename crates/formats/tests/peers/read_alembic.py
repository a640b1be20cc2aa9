"""Prints what the Alembic library reads of an archive of one mesh below one transform: faces, then a time and the positions of each frame."""

import sys

import imath  # noqa: F401  Its types have to be known before those of the library.
from alembic3d import Abc, AbcGeom

archive = Abc.IArchive(sys.argv[1])
transform = AbcGeom.IXform(archive.getTop(), archive.getTop().getChild(0).getName())
schema = AbcGeom.IPolyMesh(transform, transform.getChild(0).getName()).getSchema()
times = schema.getTimeSampling()
first = schema.getValue(Abc.ISampleSelector(times.getSampleTime(0)))
print(*first.getFaceCounts())
print(*first.getFaceIndices())
for frame in range(schema.getNumSamples()):
    # The library takes a number for a time, not for the number of a sample.
    time = times.getSampleTime(frame)
    matrix = transform.getSchema().getValue(Abc.ISampleSelector(time)).getMatrix()
    points = schema.getValue(Abc.ISampleSelector(time)).getPositions()
    rows = [matrix[k] for k in range(4)]
    moved = [sum(p[k] * rows[k][axis] for k in range(3)) + rows[3][axis] for p in points for axis in range(3)]
    print(repr(time), *map(repr, moved))
