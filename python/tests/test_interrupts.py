"""Ctrl-C is answered at once, also by what does not look up until it is done, and leaves nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

# It counts how long the interrupt waits, half a second after what is named has begun.
SCRIPT = """
import os, signal, sys, threading, time
import numpy as np
import cager
from conftest import bend, tube

def grid(rings, radius, ends):
    points, quads, caps = tube(rings, rings, radius, ends)
    return points, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])] + caps)

def interrupt():
    global sent
    time.sleep(0.5)
    sent = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)

def begin(stage="", fraction=0.0):
    global begun
    if stage == awaited and not begun:
        begun = True
        threading.Thread(target=interrupt).start()

begun, awaited = False, {awaited!r}
cage = grid(24, 0.65, 1.2)
try:
    {call}
    print("too fast")
except KeyboardInterrupt:
    print(time.monotonic() - sent)
"""


@pytest.mark.skipif(os.name != "posix", reason="processes are interrupted otherwise here")
@pytest.mark.parametrize(
    "awaited, call",
    [
        ("", "points, _ = grid(100, 0.5, 1.0); begin(); cager.coordinates(points, *cage, 'harmonic')"),
        (
            "coordinates",
            "points, _ = grid(100, 0.5, 1.0);"
            "cager.encode(points, None, [bend(points, 0.1)], cage, coordinates='harmonic', progress=begin)",
        ),
        (
            "estimating sizes of cages",
            "points, _ = grid(200, 0.5, 1.0);"
            "cager.encode(points, None, [bend(points, 0.1 * t) for t in range(12)], max_error=1e-3, progress=begin)",
        ),
    ],
)
def test_an_interrupt_is_answered_at_once_and_leaves_nothing(tmp_path, awaited, call):
    script = SCRIPT.format(awaited=awaited, call=call)
    surroundings = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(Path(__file__).parent)}
    done = subprocess.run([sys.executable, "-c", script], env=surroundings, capture_output=True, text=True, timeout=120)
    if "too fast" in done.stdout:
        pytest.skip("the work was over before the interrupt came")
    assert done.returncode == 0 and float(done.stdout) < 1, done
    assert os.listdir(tmp_path) == []
