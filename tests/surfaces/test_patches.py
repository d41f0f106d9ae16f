"""Faces divided into graphs: how many parts, in what frames, and their heights against the face."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face
from batten.surfaces.patches import patches_of, upright

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def tube(quarters, radius=100.0, length=300.0):
    """So many quarters of a cylinder about y, exact and rational."""
    w = np.sqrt(0.5)
    at = np.arange(2 * quarters + 1)
    angle, reach = 0.25 * np.pi * at, np.where(at % 2, radius / w, radius)
    net = [[(r * np.cos(a), y, r * np.sin(a)) for y in (0.0, length)] for a, r in zip(angle, reach)]
    knots = [0.0, *np.repeat(np.arange(quarters + 1.0), 2), float(quarters)]
    return BSplineSurface(knots, [0, 0, 1, 1], 2, 1, net, [[w if k % 2 else 1.0] * 2 for k in at])


def moved(surface):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = TURN, (1e3, -2e3, 5e2)
    return surface.transformed(pose)


@pytest.mark.parametrize(("quarters", "wanted"), [(1, 1), (2, 2), (3, 2), (4, 3)])
def test_as_few_strips_as_the_spread_allows(quarters, wanted):
    """A strip may turn by twice 70°: 90° and 140° are one, 180° and 270° two, 360° three."""
    patches = patches_of(Face(tube(quarters)), 0.01)
    assert len(patches) == wanted
    assert [np.degrees(p.spread) for p in patches] == pytest.approx([45.0 * quarters / wanted] * wanted, abs=0.8)


def test_a_smaller_spread_divides_more():
    assert len(patches_of(Face(tube(2)), 0.01, spread=np.radians(31.0))) == 3


def test_the_frame_is_upright_in_the_middle(made_surfaces):
    (patch,) = patches_of(Face(moved(made_surfaces.cylinder(200.0, 500.0))), 0.01)
    assert np.abs(patch.frame[:3, :3] @ patch.frame[:3, :3].T - np.eye(3)).max() < 1e-12
    assert np.linalg.det(patch.frame[:3, :3]) == pytest.approx(1.0)
    assert abs(patch.frame[:3, 2] @ TURN @ [0.0, 0.0, 1.0]) == pytest.approx(1.0, abs=1e-4)
    assert np.degrees(patch.spread) == pytest.approx(60.0, abs=0.3)
    corners = np.concatenate(patch.outline)
    assert np.abs(corners.min(axis=0) + corners.max(axis=0)).max() < 1e-6


def test_heights_are_those_of_the_face(made_surfaces):
    face = Face(
        moved(made_surfaces.graph(lambda x, y: 30.0 * np.sin(x / 90.0) * np.cos(y / 120.0), (0, 600), (0, 400)))
    )
    (patch,) = patches_of(face, 1e-2)
    u, v = np.random.default_rng(0).uniform((0, 0), (600, 400), (500, 2)).T
    p = patch.to_frame(face.surface.point(u, v))
    assert np.abs(patch.plan.surface.point(p[:, 0], p[:, 1])[:, 2] - p[:, 2]).max() < 1.5e-2
    assert np.abs(patch.to_design(p) - face.surface.point(u, v)).max() < 1e-9
    assert patch.plan.contains(p[:, 0], p[:, 1]).mean() > 0.99


def test_a_trimmed_face_is_its_trimmed_part(made_surfaces):
    surface = made_surfaces.graph(lambda x, y: 0.001 * x * y, (0, 600), (0, 400))
    t = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    circle = np.column_stack([300.0 + 150.0 * np.cos(t), 200.0 + 150.0 * np.sin(t)])
    (patch,) = patches_of(Face(surface, (circle,)), 1e-2)
    low, high = patch.face.surface.domain[0]
    assert (low, high) == pytest.approx((150.0, 450.0), abs=1.0)
    inside, outside = patch.to_frame(surface.point([300.0, 160.0], [200.0, 60.0]))
    assert patch.plan.contains(inside[0], inside[1])
    assert not patch.plan.contains(outside[0], outside[1])


def test_upright_is_the_middle_of_the_extremes():
    angles = np.radians([-20.0, 0.0, 1.0, 2.0, 70.0])
    axis, spread = upright(np.column_stack([np.sin(angles), 0.0 * angles, np.cos(angles)]))
    assert np.degrees(np.arctan2(axis[0], axis[2])) == pytest.approx(25.0, abs=1.0)
    assert np.degrees(spread) == pytest.approx(45.0, abs=1.0)


def test_a_face_that_folds_everywhere_is_refused_in_words(made_surfaces):
    """Waves so steep that no strip of its parameters is a graph within 20°."""
    waves = made_surfaces.graph(lambda x, y: 60.0 * np.sin(x) * np.sin(y), (0, 60), (0, 60), n=(200, 200), degree=3)
    with pytest.raises(InvalidInputError, match="split it in CAD"):
        patches_of(Face(waves), 1e-2, spread=np.radians(20.0))


@pytest.mark.parametrize(("tolerance", "spread"), [(0.0, 1.0), (0.1, 0.0), (0.1, 2.0)])
def test_bounds(tolerance, spread, made_surfaces):
    with pytest.raises(InvalidInputError, match="allowed"):
        patches_of(Face(made_surfaces.cylinder(100.0, 100.0)), tolerance, spread=spread)
