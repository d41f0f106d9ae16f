"""Polylines within a tolerance, over tolerances from 1e-1 to 1e-7, against dense samples of the curve."""

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.flatten import flatten
from batten.curves.piecewise import PiecewiseCurve
from batten.curves.polyline import Polyline
from batten.errors import InvalidInputError

CURVES = {
    "arch": CubicBezier([(0, 0), (0, 1), (1, 1), (1, 0)]),
    "s-shape": CubicBezier([(0, 0), (1, 1), (0, -1), (1, 0)]),
    "cusp": CubicBezier([(0, 0), (1, 1), (0, 1), (1, 0)]),
    "near-cusp": CubicBezier([(0, 0), (1, 1), (0.001, 1), (1, 0)]),
    "spline": BSplineCurve.interpolate([(0, 0), (1, 0.2), (1.5, 1.5), (0.2, 1.1), (0, 2.5)]),
    "corner": PiecewiseCurve([CubicBezier([(0, 0), (0, 1), (1, 1), (1, 0)]), Polyline([(1, 0), (3, 1)])]),
}


def _distance_to_polyline(p, polyline):
    a, d = polyline[:-1], np.diff(polyline, axis=0)
    w = np.clip(((p[:, None] - a) * d).sum(-1) / np.maximum((d**2).sum(-1), 1e-300), 0, 1)
    return np.linalg.norm(p[:, None] - a - w[..., None] * d, axis=-1).min(axis=1)


@pytest.mark.parametrize("name", CURVES)
def test_stays_within_the_tolerance(name):
    curve = CURVES[name]
    samples = curve.point(np.linspace(0, 1, 1501))
    counts = []
    for tolerance in (1e-1, 1e-2, 1e-3, 1e-5, 1e-7):
        points = flatten(curve, tolerance)
        counts.append(len(points))
        for chunk in np.array_split(samples, 20 if tolerance < 1e-4 else 1):
            # Only the neighbourhood of the chunk, so that the finest polylines stay cheap.
            near = slice(None)
            if tolerance < 1e-4:
                low, high = chunk.min(axis=0) - 0.1, chunk.max(axis=0) + 0.1
                inside = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
                near = slice(max(inside[0] - 1, 0), inside[-1] + 2)
            assert _distance_to_polyline(chunk[::7], points[near]).max() <= tolerance
    assert counts == sorted(counts)
    # Points grow like the inverse square root of the tolerance, not faster.
    assert counts[-1] < 14 * counts[-2]


def test_breaks_are_kept():
    corner = Polyline([(0, 0), (1, 0), (1, 1), (3, 1)])
    points = flatten(corner, 1e-3)
    for vertex in corner.points:
        assert np.abs(points - vertex).max(axis=1).min() < 1e-15


def test_a_gap_is_one_segment():
    path = PiecewiseCurve([Polyline([(0, 0), (1, 0)]), Polyline([(1, 5), (2, 5)])])
    points = flatten(path, 1e-3)
    assert np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) > 1.0).size == 1
    assert np.abs(points[:, 1] * (points[:, 1] - 5.0)).max() < 1e-12


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_refuses(bad):
    with pytest.raises(InvalidInputError, match="positive tolerance"):
        flatten(CURVES["arch"], bad)
