"""Cages by `lazy_cage` of gpytoolbox (Sellán et al. 2023), from the rest pose alone: lazy_cage.py REST.obj VERTICES GRID OUT.obj

Prints a line of JSON: what was asked for, what came out, and the seconds of processor time. An offset surface of the unsigned distance on a grid of
so many cells a side is decimated, and the offset is halved while the cage does not meet the model.
"""

import json
import sys
import time

import numpy as np
from gpytoolbox.copyleft import lazy_cage


def read_obj(path):
    """Points and triangles; polygons become fans."""
    points, faces = [], []
    with open(path, encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) - 1 for word in words[1:]]
                faces += [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
    return np.array(points), np.array(faces, dtype=np.int32)


def main():
    rest, vertices, grid, out = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    points, faces = read_obj(rest)
    begun = time.process_time()
    # A closed surface of one component without handles has two faces a vertex, less four.
    cage, triangles = lazy_cage(points, faces, grid_size=grid, num_faces=2 * vertices - 4)
    seconds = time.process_time() - begun
    with open(out, "w", encoding="utf-8") as file:
        file.writelines(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in cage)
        file.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles)
    print(json.dumps({"asked": vertices, "vertices": len(cage), "faces": len(triangles), "grid": grid, "seconds": round(seconds, 2)}))


if __name__ == "__main__":
    main()
