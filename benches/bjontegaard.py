"""Bjøntegaard's difference of two rate curves: how much more one codec takes than another at the same error, on average over the errors both reach.

The logarithms of the rates are interpolated over that of the error by monotone piecewise cubics (Fritsch and Carlson 1980, with the slopes of
Fritsch and Butland 1984), as in the common test conditions of JVET, and integrated. `python benches/bjontegaard.py` checks a known example.
"""

import math

import numpy as np


def slopes(x, y):
    """Of a monotone piecewise cubic at its knots."""
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    if len(d) == 1:
        return np.array([d[0], d[0]])
    m = np.zeros(len(x))
    a, b = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    same = d[:-1] * d[1:] > 0
    m[1:-1][same] = (a[same] + b[same]) / (a[same] / d[:-1][same] + b[same] / d[1:][same])

    def end(h0, h1, d0, d1):
        m = ((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1)
        if m * d0 <= 0:
            return 0.0
        return 3 * d0 if d0 * d1 < 0 and abs(m) > 3 * abs(d0) else m

    m[0], m[-1] = end(h[0], h[1], d[0], d[1]), end(h[-1], h[-2], d[-1], d[-2])
    return m


def integral(x, y, low, high):
    """Of the piecewise cubic through these points. Each piece is a cubic, of which two Gauss points give the exact integral."""
    m = slopes(x, y)
    total = 0.0
    for k in range(len(x) - 1):
        a, b = max(low, x[k]), min(high, x[k + 1])
        if a >= b:
            continue
        h = x[k + 1] - x[k]
        for at in ((a + b) / 2 - (b - a) / math.sqrt(12), (a + b) / 2 + (b - a) / math.sqrt(12)):
            t = (at - x[k]) / h
            value = (1 + 2 * t) * (1 - t) ** 2 * y[k] + t * (1 - t) ** 2 * h * m[k]
            value += t * t * (3 - 2 * t) * y[k + 1] + t * t * (t - 1) * h * m[k + 1]
            total += (b - a) / 2 * value
    return total


def frontier(points):
    """Of pairs (error, rate) those that no other beats in both, by rising error."""
    kept = []
    for error, rate in sorted(points):
        if not kept or rate < kept[-1][1]:
            kept.append((error, rate))
    return kept


def bd_rate(anchor, test):
    """Percent that `test` takes more than `anchor`, both pairs (distortion, rate), and the part of the wider curve's range it is of; the
    distortion is a logarithm. None where the curves share no range."""
    (x, a), (z, b) = (np.array(sorted(points), float).T for points in (anchor, test))
    if len(x) < 2 or len(z) < 2:
        return None
    low, high = max(x[0], z[0]), min(x[-1], z[-1])
    if low >= high:
        return None
    difference = integral(z, np.log10(b), low, high) - integral(x, np.log10(a), low, high)
    return 100 * (10 ** (difference / (high - low)) - 1), (high - low) / (max(x[-1], z[-1]) - min(x[0], z[0]))


if __name__ == "__main__":
    # The example of the package `bjontegaard` 1.3.0, which finds the same as the spreadsheet of JVET-T2010.
    anchor = [(40.037, 9487.76), (38.615, 4593.60), (36.845, 2486.44), (34.851, 1358.24)]
    test = [(40.121, 9787.80), (38.651, 4469.00), (36.970, 2451.52), (34.987, 1356.24)]
    found = bd_rate(anchor, test)[0]
    print(f"{found:.6f} %")
    assert abs(found - -4.417485350589045) < 1e-6
    # Half the rate at every error, and the other way around.
    half = [(x, rate / 2) for x, rate in anchor]
    assert abs(bd_rate(anchor, half)[0] + 50) < 1e-9 and abs(bd_rate(half, anchor)[0] - 100) < 1e-9
