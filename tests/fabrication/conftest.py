"""Scans made from a design: noise along the normal, holes, stray points, a pose that nobody knows."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

SHIFT = np.array([812.5, -3140.0, 277.0])


def normals(surface, u, v):
    d = surface.derivatives(u, v, 1)
    n = np.cross(d[1, 0], d[0, 1])
    return d[0, 0], n / np.linalg.norm(n, axis=-1, keepdims=True) * np.sign(n[..., 2:])


def build_scan(surface, count, window, noise, stray=0.1, holes=((0.3, 0.4, 0.12), (0.8, 0.7, 0.1)), seed=3, error=None):
    """Points in the scanner's frame, those in the wall frame, and the rotation and shift from the former to the latter.

    `window` is ((x0, y0), (x1, y1)) for a surface with u, v proportional to x, y; holes are x, y, radius as shares of it;
    `error(x, y)` is what the part has too much of.
    """
    rng = np.random.default_rng(seed)
    low, high = np.array(window, dtype=float)
    (u0, u1), (v0, v1) = surface.domain
    ends = surface.point([u0, u1], [v0, v1])
    plan = rng.uniform(low, high, (count, 2))
    for x, y, r in holes:
        plan = plan[np.linalg.norm((plan - low) / (high - low) - (x, y), axis=1) > r]
    share = (plan - ends[0, :2]) / (ends[1, :2] - ends[0, :2])
    points, up = normals(surface, u0 + (u1 - u0) * share[:, 0], v0 + (v1 - v0) * share[:, 1])
    away = rng.normal(0.0, noise, len(points)) if noise else np.zeros(len(points))
    if error is not None:
        away = away + error(*plan.T)
    points = points + away[:, None] * up
    number = int(stray * len(points))
    margin = 0.1 * (high - low).max()
    where = rng.permutation(len(points))[:number]
    points[where] = rng.uniform(points.min(axis=0) - margin, points.max(axis=0) + margin, (number, 3))
    turn = Rotation.from_euler("xyz", [197.0, 31.0, -64.0], degrees=True).as_matrix()
    return (points - SHIFT) @ turn, points, turn, SHIFT


@pytest.fixture(scope="session")
def made_scan():
    """A function that scans a surface: made_scan(surface, count, window, noise, …)."""
    return build_scan
