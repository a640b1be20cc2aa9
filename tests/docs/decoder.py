# A decoder of .cager files written from docs/FORMAT.md and the papers that it names, not from the program: the document's own reader stands
# before it. Usage: decoder.py FILE ARRAY prints how far the decoded positions are from those of the array, of the model's diagonal.
# Points have to lie inside the cage, as those of tests/golden do; harmonic coordinates are not computed.
import math, struct, sys

def sub(a, b): return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
def dot(a, b): return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
def cross(a, b): return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
def norm(a): return math.sqrt(dot(a, a))
def scaled(a, s): return [a[0] * s, a[1] * s, a[2] * s]

def mean_value(x, vertices, faces):
    """Ju, Schaefer and Warren 2005, figure 4."""
    lengths = [norm(sub(v, x)) for v in vertices]
    units = [scaled(sub(v, x), 1 / d) for v, d in zip(vertices, lengths)]
    weights = [0.0] * len(vertices)
    for face in faces:
        u, d = [units[i] for i in face], [lengths[i] for i in face]
        angles = [2 * math.asin(norm(sub(u[(i + 1) % 3], u[(i + 2) % 3])) / 2) for i in range(3)]
        half = sum(angles) / 2
        sines = [math.sin(a) for a in angles]
        c = [2 * math.sin(half) * math.sin(half - angles[i]) / (sines[(i + 1) % 3] * sines[(i + 2) % 3]) - 1 for i in range(3)]
        side = math.copysign(1, dot(u[0], cross(u[1], u[2])))
        s = [side * math.sqrt(max(0, 1 - value * value)) for value in c]
        if min(map(abs, s)) < 1e-12:
            continue
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            weights[face[i]] += (angles[i] - c[j] * angles[k] - c[k] * angles[j]) / (d[i] * sines[j] * s[k])
    total = sum(weights)
    return [w / total for w in weights]

def triangle_integral(p, a, b, eta):
    """Lipman, Levin and Cohen-Or 2008, appendix."""
    def angle(u, v): return math.acos(max(-1, min(1, dot(u, v) / (norm(u) * norm(v)))))
    alpha, beta = angle(sub(b, a), sub(p, a)), angle(sub(a, p), sub(b, p))
    lam, c = dot(sub(p, a), sub(p, a)) * math.sin(alpha) ** 2, dot(sub(p, eta), sub(p, eta))
    def part(theta):
        sin, cos = math.sin(theta), math.cos(theta)
        inner = 1 - 2 * c * cos / (c * (1 + cos) + lam + math.sqrt(lam * lam + lam * c * sin * sin))
        log = math.log(2 * math.sqrt(lam) * sin * sin / (1 - cos) ** 2 * inner)
        return -math.copysign(1, sin) / 2 * (2 * math.sqrt(c) * math.atan(math.sqrt(c) * cos / math.sqrt(lam + sin * sin * c)) + math.sqrt(lam) * log)
    return -abs(part(math.pi - alpha) - part(math.pi - alpha - beta) - math.sqrt(c) * beta) / (4 * math.pi)

def green(x, vertices, faces):
    """Coordinates of the vertices, then those of the faces' unit normals."""
    phi, psi, origin = [0.0] * len(vertices), [], [0.0, 0.0, 0.0]
    for face in faces:
        v = [sub(vertices[i], x) for i in face]
        n = cross(sub(v[1], v[0]), sub(v[2], v[0]))
        n = scaled(n, 1 / norm(n))
        p = scaled(n, dot(v[0], n))
        total, w, normals = 0.0, [0.0, 0.0, 0.0], []
        for i in range(3):
            a, b = v[i], v[(i + 1) % 3]
            sign = math.copysign(1, dot(cross(sub(a, p), sub(b, p)), n))
            total += sign * triangle_integral(p, a, b, origin)
            q = cross(b, a)
            q = scaled(q, 1 / norm(q))
            normals.append(q)
            part = triangle_integral(origin, b, a, origin)
            w = [w[k] + q[k] * part for k in range(3)]
        total = -abs(total)
        psi.append(-total)
        w = [w[k] + n[k] * total for k in range(3)]
        if norm(w) > 1e-13:
            for i in range(3):
                q = normals[(i + 1) % 3]
                phi[face[i]] += dot(q, w) / dot(q, v[i])
    return phi + psi

def edges(vertices, face):
    return [sub(vertices[face[1]], vertices[face[0]]), sub(vertices[face[2]], vertices[face[0]])]

def normals(cage, rest, faces):
    """Normals of a deformed cage, by the document."""
    areas = [norm(cross(*edges(rest, face))) / 2 for face in faces]
    length = math.sqrt(sum(areas) / len(areas))
    out = []
    for face, area in zip(faces, areas):
        (u, v), (du, dv) = edges(rest, face), edges(cage, face)
        s = math.sqrt(max(0, dot(du, du) * dot(v, v) - 2 * dot(du, dv) * dot(u, v) + dot(dv, dv) * dot(u, u)) / (2 * (2 * area) ** 2))
        n = cross(du, dv)
        out.append(scaled(n, length * s / norm(n)))
    return out, length

def threes(numbers): return [list(numbers[i:i + 3]) for i in range(0, len(numbers), 3)]

header, found, frames = read(sys.argv[1])
points, rest, faces = threes(found["RPTS"]), threes(found["CVTX"]), threes(found["CTRI"])
system = header["coordinates"]
if system == "mvc":
    rows = [mean_value(x, rest, faces) for x in points]
else:
    _, length = normals(rest, rest, faces)
    rows = [green(x, rest, faces) for x in points]
    rows = [row[:len(rest)] + [value / length for value in row[len(rest):]] for row in rows]
decoded, origin = [], found.get("ORIG", (0, 0, 0))
for frame in frames:
    values = threes(frame)
    if system == "green":
        values += normals(values, rest, faces)[0]
    decoded += [sum(c * value[k] for c, value in zip(row, values)) + origin[k] for row in rows for k in range(3)]
array = open(sys.argv[2], "rb").read()
width, kind = (8, "d") if b"<f8" in array[:128] else (4, "f")
array = array[10 + struct.unpack_from("<H", array, 8)[0]:]
expected = struct.unpack(f"<{len(array) // width}{kind}", array)
assert len(expected) == len(decoded), (len(expected), len(decoded))
diagonal = norm([max(p[k] for p in points) - min(p[k] for p in points) for k in range(3)])
print(max(abs(a - b) for a, b in zip(expected, decoded)) / diagonal)
