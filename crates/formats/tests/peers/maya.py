"""Prints what a Maya geometry cache of one channel in one file holds: a line of the time in ticks and the positions for each frame.

The layout is that of files of Maya 2022. Whatever is not as in these files is an error.
"""

import struct
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

text = Path(sys.argv[1])
root = ElementTree.parse(text).getroot()
assert root.tag == "Autodesk_Cache_File" and root.find("cacheVersion").get("Version") == "2.0"
kind = root.find("cacheType")
assert kind.get("Type") == "OneFile"
wide = {"mcx": True, "mcc": False}[kind.get("Format")]
[channel] = root.find("Channels")
assert channel.tag == "channel0" and channel.get("ChannelInterpretation") == "positions"
data = text.with_suffix(".mcx" if wide else ".mc").read_bytes()
unit, head = (8, struct.Struct(">4s4xQ")) if wide else (4, struct.Struct(">4sI"))


def chunks(at, end):
    """The chunks between two places, padded to multiples of the unit."""
    while at < end:
        tag, size = head.unpack_from(data, at)
        at += head.size
        yield tag, data[at : at + size]
        at += -(-size // unit) * unit
    assert at == end


def groups():
    """The groups of the file: their kind, and where their chunks are."""
    at = 0
    while at < len(data):
        tag, size = head.unpack_from(data, at)
        assert tag == (b"FOR8" if wide else b"FOR4")
        at += head.size
        yield data[at : at + 4], at + 4, at + size
        at += size
    assert at == len(data)


(kind, *where), *frames = groups()
assert kind == b"CACH" and [tag for tag, _ in chunks(*where)] == [b"VRSN", b"STIM", b"ETIM"]
times = []
for kind, *where in frames:
    (one, time), (two, name), (three, count), (array, values) = chunks(*where)
    assert (kind, one, two, three) == (b"MYCH", b"TIME", b"CHNM", b"SIZE")
    assert name == channel.get("ChannelName").encode() + b"\0"
    letter = {b"FVCA": "f", b"DVCA": "d"}[array]
    assert channel.get("ChannelType") == {"f": "FloatVectorArray", "d": "DoubleVectorArray"}[letter]
    numbers = struct.unpack(f">{3 * struct.unpack('>I', count)[0]}{letter}", values)
    times += struct.unpack(">i", time)
    print(times[-1], *map(repr, numbers))
assert root.find("time").get("Range") == f"{times[0]}-{times[-1]}"
