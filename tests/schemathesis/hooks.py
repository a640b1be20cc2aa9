"""What a description of an API cannot say: which sessions there are, and what whole frames are."""

import itertools
import os
import random
import struct

import schemathesis
from hypothesis import strategies as st

READY, DONE = os.environ["CAGER_READY"], os.environ["CAGER_DONE"]
# Points, unknowns and handles of the sessions: bodies of frames and of cages have the same length.
ROWS = 8
KEYS = itertools.count(10**9)


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def rows(values):
    return struct.pack(f"<{len(values)}f", *values)


def record(frame, values):
    payload = rows(values)
    return struct.pack("<4sHHIIffI", b"CGRF", 1, 1, frame, ROWS, float("nan"), float("nan"), crc32c(payload)) + payload


FRAME = st.lists(st.floats(-10, 10, width=32), min_size=3 * ROWS, max_size=3 * ROWS)
schemathesis.openapi.media_type("application/octet-stream", st.lists(FRAME, max_size=4).map(lambda all: b"".join(map(rows, all))))
schemathesis.openapi.media_type(
    "application/vnd.cager.frames",
    st.lists(st.tuples(st.integers(0, 2**32 - 1), FRAME), max_size=4).map(lambda all: b"".join(record(*one) for one in all)),
)


@schemathesis.hook
def map_path_parameters(ctx, path_parameters):
    """Mostly a session that is there."""
    label = ctx.operation.label
    if path_parameters and "id" in path_parameters and "DELETE" not in label and random.random() < 0.8:
        path_parameters["id"] = DONE if label.endswith("/complete") or random.random() < 0.3 else READY
    return path_parameters


@schemathesis.hook
def before_call(ctx, case, **kwargs):
    """Where the answer of a session at work would not end, one that is completed; and no idempotency key twice."""
    label = ctx.operation.label
    key = (case.headers or {}).get("Idempotency-Key")
    if isinstance(key, str) and 0 < len(key) <= 200 and key.isascii() and key.isprintable():
        case.headers["Idempotency-Key"] = key + str(next(KEYS))
    follows = label.endswith("/capture.cager") and "follow" in (case.query or {})
    if label.endswith("/events") or label.endswith("/cages") or follows:
        session = str((case.path_parameters or {}).get("id"))
        if len(session) == 32 and session.isalnum():
            case.path_parameters["id"] = DONE


@schemathesis.hook
def map_body(ctx, body):
    """Half of the new sessions have a model in them, not only bytes."""
    if isinstance(body, dict) and isinstance(body.get("frames"), float) and body["frames"].is_integer():
        # JSON Schema calls 3.0 an integer; the service wants it written as one.
        body["frames"] = int(body["frames"])
    if isinstance(body, dict) and "rest" in body and "cage" in body and random.random() < 0.5:
        body["rest"], body["cage"] = model(0.5), model(1.0)
    return body


def model(scale):
    """A cube as OBJ."""
    corners = [(x * scale, y * scale, z * scale) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    quads = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join("f %d %d %d %d\n" % quad for quad in quads)
    return text.encode()
