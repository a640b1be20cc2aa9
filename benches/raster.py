"""Shaded pictures of meshes, by a depth buffer in numpy: no window, no graphics card."""

import numpy as np
from deformation import normals, unit
from PIL import Image, ImageDraw, ImageFont

FINER = 2
LIGHTS = [((-0.45, 0.55, 0.7), 0.75), ((0.8, 0.1, 0.45), 0.25), ((0.0, -0.6, 0.5), 0.08)]
AMBIENT = 0.2
EDGE = np.array([0.25, 0.25, 0.28])


def view(up, azimuth, elevation):
    """The rotation after which x goes right, y up and z towards the eye."""
    a, e = np.radians([azimuth, elevation])
    upright = {"y": np.eye(3), "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])}[up]
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    tilt = np.array([[1, 0, 0], [0, np.cos(e), -np.sin(e)], [0, np.sin(e), np.cos(e)]])
    return tilt @ turn @ upright


def render(points, faces, colour, rotation, frame, size, edges=None):
    """One mesh as size[0] × size[1] pixels. `frame` is (centre, height) of what is seen; `edges` says of each triangle which of its sides are drawn, the one
    against each corner."""
    width, height = size[0] * FINER, size[1] * FINER
    centre, extent = frame
    scale = height / extent
    seen = (points - centre) @ rotation.T * scale
    x, y, depth = seen[:, 0] + width / 2, height / 2 - seen[:, 1], seen[:, 2]
    shade = np.zeros_like(points)
    area = normals(points, faces)
    for k in range(3):
        np.add.at(shade, faces[:, k], area)
    shade = unit(shade) @ rotation.T

    corner_x, corner_y = x[faces], y[faces]
    left, right = (np.clip(part, 0, width).astype(int) for part in (np.floor(corner_x.min(1)), np.ceil(corner_x.max(1)) + 1))
    top, bottom = (np.clip(part, 0, height).astype(int) for part in (np.floor(corner_y.min(1)), np.ceil(corner_y.max(1)) + 1))
    columns, rows = right - left, bottom - top
    count = columns * rows
    triangle = np.repeat(np.arange(len(faces)), count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    column, row = left[triangle] + within % columns[triangle], top[triangle] + within // columns[triangle]
    ax, bx, cx = (corner_x[triangle, k] for k in range(3))
    ay, by, cy = (corner_y[triangle, k] for k in range(3))
    double = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    double[double == 0] = 1e-12
    px, py = column + 0.5, row + 0.5
    weight_b = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / double
    weight_c = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / double
    weights = np.stack([1 - weight_b - weight_c, weight_b, weight_c], axis=1)
    inside = (weights >= -1e-9).all(axis=1)
    triangle, column, row, weights = triangle[inside], column[inside], row[inside], weights[inside]
    far_to_near = np.argsort((weights * depth[faces[triangle]]).sum(1), kind="stable")
    pixel = (row * width + column)[far_to_near]
    nearest = np.full(width * height, -1)
    nearest[pixel] = far_to_near
    hit = np.flatnonzero(nearest >= 0)
    triangle, weights = triangle[nearest[hit]], weights[nearest[hit]]

    normal = unit(np.einsum("nk,nki->ni", weights, shade[faces[triangle]]))
    normal[normal[:, 2] < 0] *= -1
    light = AMBIENT + sum(strength * np.clip(normal @ unit(np.array(way)), 0, None) for way, strength in LIGHTS)
    tone = np.clip(light[:, None] * np.array(colour), 0, 1)
    if edges is not None:
        sides = np.stack([np.linalg.norm(seen[faces[triangle, (k + 1) % 3], :2] - seen[faces[triangle, (k + 2) % 3], :2], axis=1) for k in range(3)], axis=1)
        corners = seen[faces[triangle], :2]
        one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
        distance = weights * across[:, None] / np.maximum(sides, 1e-9)
        near = ((distance < 0.5 * FINER) & edges[triangle]).any(axis=1)
        tone[near] = 0.45 * tone[near] + 0.55 * EDGE
    image = np.ones((width * height, 3))
    image[hit] = tone
    image = image.reshape(size[1], FINER, size[0], FINER, 3).mean(axis=(1, 3))
    return Image.fromarray((255 * image).astype(np.uint8))


def sheet(rows, path, size):
    """Rows of (title, picture), as one .png of few colours."""
    font, head = ImageFont.load_default(13), 20
    wide = max(len(row) for row in rows)
    whole = Image.new("RGB", (wide * size[0], len(rows) * (size[1] + head)), "white")
    draw = ImageDraw.Draw(whole)
    for r, row in enumerate(rows):
        for c, (title, picture) in enumerate(row):
            at = c * size[0], r * (size[1] + head)
            draw.text((at[0] + size[0] // 2, at[1] + head // 2), title, fill=(40, 40, 40), font=font, anchor="mm")
            if picture is not None:
                whole.paste(picture, (at[0], at[1] + head))
    whole.quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)
