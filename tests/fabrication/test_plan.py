"""What a plan says of its rods, against direct integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from batten.curves.elastica import Elastica
from batten.fabrication.plan import RodPlacement, gripper_frames
from batten.surfaces.plane import Plane


def placements(count):
    """Rods in turned and tilted planes."""
    rng = np.random.default_rng(3)
    for i in range(count):
        plane = Plane(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))
        rod = Elastica(rng.normal(size=2), rng.normal(), rng.normal(), rng.normal(size=2), 1.5)
        yield RodPlacement(1, i + 1, plane, rod.point_at([0.5, 1.0]), rod.extended(-0.5, -0.5), rod, 0.5)


def end_of(rod):
    """Position and tangent at the rod's end, from θ′ = κ₀ + (γ − γ₀) × force."""

    def slope(_, state):
        x, y = state[:2] - rod.start
        return [np.cos(state[2]), np.sin(state[2]), rod.start_curvature + x * rod.force[1] - y * rod.force[0]]

    begin = [*rod.start, rod.start_angle]
    x, y, angle = solve_ivp(slope, (0.0, rod.length), begin, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    return np.array([x, y]), np.array([np.cos(angle), np.sin(angle)])


def test_frames_of_both_grippers():
    rods = list(placements(4))
    frames = gripper_frames(rods)
    assert frames.positions_mm.shape == frames.tangents.shape == (4, 2, 3)
    for i, rod in enumerate(rods):
        tangent = np.array([np.cos(rod.rod.start_angle), np.sin(rod.rod.start_angle)])
        for side, (place, along) in enumerate(((rod.rod.start, tangent), end_of(rod.rod))):
            flat = np.array([rod.plane.x_axis, rod.plane.y_axis])
            assert frames.positions_mm[i, side] == pytest.approx(rod.plane.origin + place @ flat, abs=1e-9)
            assert frames.tangents[i, side] == pytest.approx(along @ flat, abs=1e-9)
            assert frames.tangents[i, side] @ frames.normals[i] == pytest.approx(0.0, abs=1e-12)
            one = rod.grippers()[side]
            assert np.array_equal(one.position_mm, frames.positions_mm[i, side])
            assert np.array_equal(one.tangent, frames.tangents[i, side])
            assert np.array_equal(one.normal, frames.normals[i])
        assert frames.normals[i] == pytest.approx(-np.cross(rod.plane.x_axis, rod.plane.y_axis))


def test_no_rods():
    frames = gripper_frames([])
    assert [v.shape for v in frames] == [(0, 2, 3), (0, 2, 3), (0, 3)]
