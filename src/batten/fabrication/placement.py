"""Pieces of elastica, extended to the length of the rod: where the rod lies along its own curve."""

from __future__ import annotations

import numpy as np

from batten.curves.elastica import states_along
from batten.errors import InvalidInputError
from batten.fabrication.job import GripperJob, RodJob
from batten.surfaces.plane import Plane
from batten.typing import FloatArray, IntArray

_CHOICES = 21  # positions of the piece along the rod
_STATIONS = 49  # along the rod


def rod_placement(
    parameters: FloatArray,
    planes: tuple[Plane, ...],
    low: FloatArray,
    high: FloatArray,
    blocks: IntArray,
    rod: RodJob,
    gripper: GripperJob,
) -> FloatArray:
    """How much of the rod lies before each piece: one share of what is left over for all rods of a block.

    One share, so that the grippers move evenly from leaf to leaf. Among 21 shares those come first that keep, for every rod,
    both grippers at their distance from the block and the least bow; then those that keep the distance; of these the one
    with the least greatest curvature is taken. If there is none, the one with the greatest least distance.

    Parameters:
        parameters: (n, 7), the pieces in the coordinates of their planes.
        planes: n planes.
        low, high: (n, 3), corners of each rod's block in the wall frame.
        blocks: (n,), which block each rod belongs to, any integers.
        rod, gripper: length, least bow, radius and clearance.

    Returns:
        before_mm, shape (n,).

    Raises:
        InvalidInputError: a rod that is shorter than a piece.
    """
    spare = rod.length_mm - parameters[:, 6]
    if not (spare > 0.0).all():
        raise InvalidInputError(
            f"the rod of {rod.length_mm:g} mm is shorter than a leaf: a piece is {parameters[:, 6].max():.1f} mm long "
            "between two block borders, and the grippers are outside the block; take a longer rod or narrower blocks"
        )
    origin = np.array([p.origin for p in planes])
    x_axis, y_axis = np.array([p.x_axis for p in planes]), np.array([p.y_axis for p in planes])
    fractions = np.linspace(0.0, 1.0, _STATIONS)
    shares = np.linspace(0.0, 1.0, _CHOICES)
    shares = shares[np.argsort(np.abs(shares - 0.5), kind="stable")]  # of equals, the one next to the middle
    names, group = np.unique(blocks, return_inverse=True)
    bend = np.zeros((_CHOICES, len(names)))
    gap, arch = np.full_like(bend, np.inf), np.full_like(bend, np.inf)
    for i, share in enumerate(shares):
        s = -(share * spare)[:, None] + fractions * rod.length_mm
        state = states_along(parameters, s)
        ends = state[:, [0, -1], :2]
        world = origin[:, None] + ends[..., :1] * x_axis[:, None] + ends[..., 1:] * y_axis[:, None]
        outside = np.maximum(np.maximum(low[:, None] - world, world - high[:, None]), 0.0)
        np.maximum.at(bend[i], group, np.abs(state[..., 3]).max(axis=1))
        np.minimum.at(gap[i], group, np.linalg.norm(outside, axis=-1).min(axis=1))
        np.minimum.at(arch[i], group, _height_over_chord(state[..., :2]))
    score = -gap
    clear = gap >= gripper.radius_mm + gripper.clearance_mm
    for good in (clear, clear & (arch >= rod.min_bow_mm)):
        score = np.where(good.any(axis=0), np.where(good, bend, np.inf), score)
    return np.asarray(shares[np.argmin(score, axis=0)][group] * spare)


def bow(parameters: FloatArray, before: FloatArray, length_mm: float) -> FloatArray:
    """Greatest distance of each whole rod from its chord, mm, shape (n,)."""
    s = -before[:, None] + np.linspace(0.0, 1.0, _STATIONS) * length_mm
    return _height_over_chord(states_along(parameters, s)[..., :2])


def _height_over_chord(points: FloatArray) -> FloatArray:
    """Greatest distance of points (n, k, 2) from the chord of their first and last, shape (n,)."""
    chord = points[:, -1] - points[:, 0]
    run = points - points[:, :1]
    cross = run[..., 0] * chord[:, None, 1] - run[..., 1] * chord[:, None, 0]
    return np.asarray(np.abs(cross).max(axis=1) / np.maximum(np.hypot(chord[:, 0], chord[:, 1]), 1e-9))
