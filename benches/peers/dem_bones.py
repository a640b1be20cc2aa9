"""Smooth skinning decomposition by py-dem-bones (Le and Deng 2012): dem_bones.py REST.obj FRAMES.npy BONES [ITERATIONS]

Prints a line of JSON: bones found, the mean over the frames of the points' root mean square error as a fraction of the diagonal, the largest error of a
point, numbers stored for each frame (six for a rigid bone) and for the model (eight weights and eight bones for each point), and seconds of processor time.
"""

import json
import sys
import time

import numpy as np
import py_dem_bones

WEIGHTS = 8


def main():
    iterations = int(sys.argv[4]) if len(sys.argv) > 4 else 30
    frames = np.load(sys.argv[2]).astype(float)
    rest, faces = [], []
    with open(sys.argv[1], encoding="utf-8") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["v"]:
                rest.append([float(x) for x in words[1:4]])
            elif words[:1] == ["f"]:
                faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    rest = np.array(rest)
    count, points, _ = frames.shape
    solver = py_dem_bones.DemBones()
    solver.nV, solver.nF, solver.nS, solver.nB = points, count, 1, int(sys.argv[3])
    solver.nIters, solver.nnz = iterations, WEIGHTS
    solver.fStart, solver.subjectID = np.array([0, count]), np.zeros(count, dtype=np.int32)
    solver.u, solver.v, solver.fv = rest.T.copy(), frames.transpose(0, 2, 1).reshape(3 * count, points).copy(), faces
    begun = time.process_time()
    solver.init()
    solver.compute()
    seconds = time.process_time() - begun
    bones, weights = solver.nB, np.asarray(solver.get_weights())
    moved = np.asarray(solver.m).reshape(count, 4, bones, 4)[:, :3]
    # Each bone's image of the rest pose, weighted.
    weighted = np.einsum("bn,nk->bkn", weights, np.c_[rest, np.ones(points)])
    errors = np.array([np.linalg.norm(np.einsum("cbk,bkn->nc", moved[t], weighted) - frames[t], axis=1) for t in range(count)])
    diagonal = np.linalg.norm(rest.max(0) - rest.min(0))
    found = {"bones": bones, "l2_mean": float(np.sqrt((errors**2).mean(1)).mean() / diagonal), "linf_max": float(errors.max() / diagonal)}
    found |= {"numbers_per_frame": 6 * bones, "numbers_of_model": 2 * WEIGHTS * points, "rmse": float(solver.rmse() / diagonal), "seconds": round(seconds, 1)}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
