"""Heights through scattered points, against the functions that the points come from."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.surfaces.height_surface import height_surface


def scattered(f, n=4000, seed=3):
    p = np.random.default_rng(seed).uniform((0.0, 0.0), (4.0, 3.0), (n, 2))
    return np.column_stack([p, f(*p.T)])


def test_u_and_v_are_x_and_y():
    fit = height_surface(scattered(lambda x, y: np.sin(x) * y), (0, 0), (4, 3), 1e-3)
    x, y = np.random.default_rng(1).uniform((0.0, 0.0), (4.0, 3.0), (100, 2)).T
    assert np.abs(fit.surface.point(x, y)[:, :2] - np.column_stack([x, y])).max() < 1e-13


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3, 1e-4])
def test_the_tolerance_is_kept_at_the_points_and_nearly_so_between(tolerance):
    def f(x, y):
        return np.sin(2.0 * x) * np.cos(y) + 0.3 * np.exp(-40.0 * ((x - 1.0) ** 2 + (y - 1.0) ** 2))

    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 4, 121), np.linspace(0, 3, 91)))
    points = np.column_stack([x, y, f(x, y)])
    fit = height_surface(points, (0, 0), (4, 3), tolerance)
    assert fit.error == np.abs(fit.surface.point(points[:, 0], points[:, 1])[:, 2] - points[:, 2]).max() <= tolerance
    other = scattered(f, seed=4)
    assert np.abs(fit.surface.point(other[:, 0], other[:, 1])[:, 2] - other[:, 2]).max() < 3.0 * tolerance


def test_knots_are_laid_where_the_surface_is_sharp():
    fit = height_surface(scattered(lambda x, y: np.tanh(30.0 * (x - 1.0)) + 0.0 * y, 9000), (0, 0), (4, 3), 1e-3)
    knots = np.unique(fit.surface.knots_u)
    near = np.diff(knots)[np.abs(knots[:-1] - 1.0) < 0.2].max()
    assert near < 0.3 * np.diff(knots)[knots[:-1] > 2.0].max()


def test_without_points_it_goes_on_as_a_plate():
    points = scattered(lambda x, y: 2.0 * x - y + 5.0)
    fit = height_surface(points[points[:, 0] < 2.0], (0, 0), (4, 3), 1e-3)
    assert fit.surface.point(3.9, 1.5)[2] == pytest.approx(2.0 * 3.9 - 1.5 + 5.0, abs=1e-4)


def test_light_points_give_way():
    heavy, light = scattered(lambda x, y: 0.0 * x), scattered(lambda x, y: 0.0 * x + 1.0)
    weights = np.repeat([1.0, 0.01], len(heavy))
    fit = height_surface(np.concatenate([heavy, light]), (0, 0), (4, 3), 0.05, weights=weights)
    assert abs(fit.surface.point(2.0, 1.5)[2] - 1e-4) < 1e-5  # 1 · 0.01² / (1 + 0.01²)


def test_too_few_spans_are_told():
    fit = height_surface(scattered(lambda x, y: np.sin(9.0 * x) * np.sin(9.0 * y)), (0, 0), (4, 3), 1e-6, most=8)
    assert fit.error > 1e-6
    assert len(np.unique(fit.surface.knots_u)) - 1 <= 8


@pytest.mark.parametrize(
    "change",
    [
        {"points": np.zeros((3, 3))},
        {"points": np.full((30, 3), np.nan)},
        {"low": (1, 1)},
        {"high": (0, 3)},
        {"tolerance": 0.0},
        {"weights": 2.0},
    ],
)
def test_what_is_refused(change):
    good = {"points": scattered(lambda x, y: x), "low": (0, 0), "high": (4, 3), "tolerance": 0.1}
    with pytest.raises(InvalidInputError, match="allowed"):
        height_surface(**(good | change))
