"""SI-MEC through points, against elastic splines of given length (another solver) and against other splines."""

import numpy as np
import pytest

from batten.errors import InvalidInputError, NoSolutionError
from batten.splines.elastic_spline import elastic_spline
from batten.splines.interpolating_spline import interpolating_spline
from batten.splines.scale_invariant_spline import scale_invariant_spline

OPEN = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8]])
RING = np.array([[0.0, 0.0], [2.0, -0.4], [3.0, 0.8], [1.6, 2.0], [0.1, 1.2]])


def test_the_free_rod_is_that_of_the_elastic_spline():
    """Two ways to the MEC: equal curvatures at joints here, descent of the energy in `elastic_spline`."""
    ours, other = interpolating_spline(OPEN, "mec"), elastic_spline(OPEN)
    assert ours.bending_energy() == pytest.approx(sum(p.bending_energy() for p in other.pieces), rel=1e-9)
    assert ours.curve.length == pytest.approx(sum(p.length for p in other.pieces), rel=1e-9)


def test_length_times_energy_is_least_among_rods_of_other_lengths():
    rod = scale_invariant_spline(OPEN)

    def value(length: float) -> float:
        return length * sum(p.bending_energy() for p in elastic_spline(OPEN, length=length).pieces)

    assert value(rod.length) == pytest.approx(rod.scale_invariant_energy, rel=1e-10)
    assert value(rod.length * 1.002) > rod.scale_invariant_energy < value(rod.length * 0.998)


@pytest.mark.parametrize(("points", "closed"), [(OPEN, False), (RING, True)])
def test_no_other_spline_has_less(points, closed):
    rod = scale_invariant_spline(points, closed=closed)
    assert rod.tension == pytest.approx(rod.energy / rod.length, rel=1e-12)
    assert np.abs(rod.spline.curve.joints().curvature_jumps).max() < 1e-11
    for method in ("mec", "euler", "kurgla1", "log-aesthetic", "circle", "hobby"):
        other = interpolating_spline(points, method, closed=closed)
        assert other.curve.length * other.bending_energy() > rod.scale_invariant_energy


def test_it_does_not_depend_on_scale():
    a, b = scale_invariant_spline(RING, closed=True), scale_invariant_spline(7.0 * RING, closed=True)
    assert b.scale_invariant_energy == pytest.approx(a.scale_invariant_energy, rel=1e-11)
    np.testing.assert_allclose(b.spline.curve.point(0.3), 7.0 * a.spline.curve.point(0.3), atol=1e-10)


def test_degenerate_and_bad_points():
    line = scale_invariant_spline([[0, 0], [1, 0], [3, 0]])
    assert (line.energy, line.tension, line.length) == (0.0, 0.0, 3.0)
    with pytest.raises(InvalidInputError, match="the same"):
        scale_invariant_spline([[0, 0], [0, 0]])
    random = np.random.default_rng(19)
    with pytest.raises(NoSolutionError, match="kurgla1"):
        scale_invariant_spline(random.uniform(0.0, 1.0, (random.integers(3, 9), 2)))
