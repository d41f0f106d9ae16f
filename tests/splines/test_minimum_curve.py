"""Minimum curves: against exact elastica, circles, another solver for curvatures, and Moreton1995's figures."""

import numpy as np
import pytest
from scipy.optimize import minimize

from batten.curves.spiral import Spiral
from batten.errors import InvalidInputError
from batten.splines.interpolating_spline import interpolating_spline
from batten.splines.minimum_curve import ENERGIES, minimum_closed_curve, minimum_curve
from batten.splines.scale_invariant_spline import scale_invariant_spline

OPEN = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8]])
WOODFORD = np.array([[0, 0], [1, 1.9], [2, 2.7], [3, 2.6], [4, 1.6], [5, 0.89], [6, 1.2]])
RING = np.array([[0.0, 0.0], [2.0, -0.4], [3.0, 0.8], [1.6, 2.0], [0.1, 1.2]])
UP_AND_DOWN = np.array([np.pi / 2, -np.pi / 2])
OPENED = UP_AND_DOWN + np.array([0.1, -0.1])
EIGHT_POINTS = [[-2, 0], [0, 0], [2, 0], [0, 0]]
LOP_SIDED = np.array([1.2, -0.4, 1.9, 2.6])


class Fourier:
    """Σ c_k exp(2πikt) as a closed curve."""

    def __init__(self, terms):
        self.terms = terms

    def _sum(self, t, order):
        t = np.asarray(t, dtype=float)
        z = sum(c * (2j * np.pi * k) ** order * np.exp(2j * np.pi * k * t) for k, c in self.terms.items())
        return np.stack([z.real, z.imag], axis=-1)

    def point(self, t):
        return self._sum(t, 0)

    def derivative(self, t, order=1):
        return self._sum(t, order)

    @property
    def length(self):
        return float(np.hypot(*self._sum(np.arange(4096) / 4096, 1).T).mean())

    def breaks(self):
        return np.array([0.0, 1.0])


ELLIPSE = Fourier({1: 2.0, -1: 0.8})
LIMACON = Fourier({1: 0.6, 2: 1.0})
EIGHT = Fourier({1: 1.0, -1: 1.0, 2: 0.5, -2: -0.5, 3: 0.1, -3: 0.05})


@pytest.mark.parametrize("points", [OPEN, WOODFORD])
def test_energies_are_those_of_exact_elastica(points):
    mec, si_mec = minimum_curve(points, "mec"), minimum_curve(points, "si-mec")
    assert mec.status == si_mec.status == "converged"
    assert mec.energy == pytest.approx(interpolating_spline(points, "mec").bending_energy(), rel=1e-8)
    assert si_mec.energy == pytest.approx(scale_invariant_spline(points).scale_invariant_energy, rel=1e-8)


def test_closed_elastica():
    assert minimum_curve(RING, "mec", closed=True).energy == pytest.approx(
        interpolating_spline(RING, "mec", closed=True).bending_energy(), rel=1e-8
    )


def test_the_energy_falls_with_the_elements_by_the_sixth_order_or_better():
    exact = interpolating_spline(OPEN, "mec").bending_energy()
    error = [minimum_curve(OPEN, "mec", elements=n).energy / exact - 1.0 for n in (1, 2, 4)]
    assert error[0] > 32.0 * error[1] > 0.0
    assert error[1] > 16.0 * error[2] > -1e-12
    assert error[0] < 1e-6


@pytest.mark.parametrize("energy", ["mvc", "si-mec", "si-mvc"])
def test_horns_case_is_a_half_circle(energy):
    horn = minimum_curve([[-1, 0], [1, 0]], energy, tangents=UP_AND_DOWN)
    assert (horn.status, horn.minimum) == ("converged", True)
    assert np.abs(np.hypot(*horn.curve.point(np.linspace(0, 1, 41)).T) - 1.0).max() < 1e-5
    assert horn.length == pytest.approx(np.pi, rel=1e-6)


def test_horns_case_is_no_half_circle_for_the_mec_and_escapes_when_opened():
    # ½(∫√sin)²: the energy of the rectangular elastica on a chord of 2, 2.8711 (Levien2009 §3.7).
    horn = minimum_curve([[-1, 0], [1, 0]], "mec", tangents=UP_AND_DOWN)
    assert horn.energy == pytest.approx(2.871080, abs=1e-5)
    assert horn.energy < np.pi
    opened = minimum_curve([[-1, 0], [1, 0]], "mec", tangents=OPENED, elements=4)
    assert opened.status == "escaped"
    for energy in ("mvc", "si-mec", "si-mvc"):
        assert minimum_curve([[-1, 0], [1, 0]], energy, tangents=OPENED).status == "converged"


@pytest.mark.parametrize("energy", ENERGIES)
def test_three_points(energy):
    angle = 2.0 * np.pi * np.arange(3) / 3
    even = minimum_curve(np.stack([np.cos(angle), np.sin(angle)], axis=1), energy, closed=True)
    flat = minimum_curve([[0, 0], [4, 0], [2, 0.5]], energy, closed=True, elements=4)
    radius = np.hypot(*even.curve.point(np.linspace(0, 1, 61)).T)
    assert even.status == "converged"
    assert abs(even.turning) == pytest.approx(1.0, abs=1e-9)
    if energy == "mec":
        assert radius.max() == pytest.approx(1.035, abs=5e-4)  # Levien2009
        assert flat.status == "escaped"
        assert "si-mec" in flat.message
    else:
        assert np.abs(radius - 1.0).max() < 1e-5
        assert flat.status == "converged"
        assert flat.scale_invariant_bending == pytest.approx(4.0 * np.pi**2, rel=1e-7)


@pytest.mark.parametrize(("energy", "least"), [("si-mec", 112.4396), ("si-mvc", 4498.589)])
def test_the_lop_sided_eight_stays_where_the_energy_does_not_depend_on_scale(energy, least):
    eight = minimum_curve(EIGHT_POINTS, energy, closed=True, start_angles=LOP_SIDED, elements=8)
    assert eight.energy == pytest.approx(least, rel=1e-6)
    assert eight.turning == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("energy", ["mec", "mvc"])
def test_the_lop_sided_eight_escapes(energy):
    eight = minimum_curve(EIGHT_POINTS, energy, closed=True, start_angles=LOP_SIDED, elements=8)
    assert eight.status == "escaped"
    assert not eight.minimum
    assert "escapes" in eight.message


def lemnoid_by_curvature(power):
    """L∫κ² or L³∫κ′² of the least closed curve with κ = Σ aⱼ sin(2π(2j + 1)s), L = 1: no points, no elements."""
    s = (np.arange(2048) + 0.5) / 2048
    k = 2.0 * np.pi * (2 * np.arange(8) + 1)

    def energy(a):
        return float((a**2 * (k**2 if power == 3 else 1.0)).sum() / 2.0)

    def gap(a):  # θ = −Σ aⱼ cos(kⱼ s)/kⱼ is even about 0 and odd about ¼: only ∫cos θ is left
        return float(np.cos((a / k) @ np.cos(np.outer(k, s))).mean())

    found = minimize(
        energy, [14.0] + [0.0] * 7, constraints={"type": "eq", "fun": gap}, method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 500},
    )  # fmt: skip
    return energy(found.x)


@pytest.mark.parametrize(("energy", "power"), [("si-mec", 1), ("si-mvc", 3)])
def test_lemnoids_are_those_of_another_solver(energy, power):
    lemnoid = minimum_closed_curve(EIGHT, energy, elements=24)
    assert lemnoid.status == "converged"
    assert lemnoid.minimum
    assert lemnoid.energy == pytest.approx(lemnoid_by_curvature(power), rel=1e-6)
    if energy == "si-mec":
        assert lemnoid.energy == pytest.approx(112.4396, abs=1e-4)
    else:
        assert lemnoid.energy < 4501.25  # Moreton1995 Fig. 5, stopped early


@pytest.mark.parametrize("energy", ["si-mec", "si-mvc", "mvc"])
@pytest.mark.parametrize(("start", "turns"), [(ELLIPSE, 1), (LIMACON, 2)])
def test_without_inflections_closed_curves_become_circles(energy, start, turns):
    ring = minimum_closed_curve(start, energy, elements=16 * turns)
    assert ring.status == "converged"
    assert ring.turning == pytest.approx(turns, abs=1e-6)
    assert ring.scale_invariant_bending == pytest.approx((2.0 * np.pi * turns) ** 2, rel=1e-8)


def test_a_mec_without_points_escapes():
    assert minimum_closed_curve(ELLIPSE, "mec", elements=16).status == "escaped"


def test_constraints_hold_and_the_mvc_is_continuous():
    tangents = np.array([0.8, np.nan, -0.5, np.nan, np.nan])
    curvatures = np.array([np.nan, -0.4, np.nan, np.nan, 0.0])
    made = minimum_curve(OPEN, "si-mvc", tangents=tangents, curvatures=curvatures, elements=4)
    knots = made.curve.point(np.arange(5) / 4)
    np.testing.assert_allclose(knots, OPEN, atol=1e-12)
    d, dd = made.curve.derivative(np.arange(5) / 4), made.curve.derivative(np.arange(5) / 4, 2)
    angle = np.arctan2(d[:, 1], d[:, 0])
    kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.hypot(*d.T) ** 3
    np.testing.assert_allclose(angle[[0, 2]], tangents[[0, 2]], atol=1e-10)
    np.testing.assert_allclose(kappa[[1, 4]], curvatures[[1, 4]], atol=1e-9)
    joints = made.curve.joints()
    assert np.abs(joints.tangent_jumps).max() < 1e-12
    assert np.abs(joints.curvature_jumps).max() < 1e-10


def test_a_held_tangent_lets_the_curvature_of_a_mec_jump_but_not_of_an_mvc():
    points, tangents = [[0, 0], [1, 1], [2, 0.5]], [1.5, 0.6, -1.0]
    jump = {
        e: np.abs(minimum_curve(points, e, tangents=tangents, elements=2).curve.joints().curvature_jumps)
        for e in ENERGIES
    }
    assert jump["mec"].max() > 0.01 < jump["si-mec"].max()
    assert max(jump["mvc"].max(), jump["si-mvc"].max()) < 1e-10


def test_conjugate_gradients_end_at_the_same_energy_later():
    slow, fast = (minimum_curve(WOODFORD, "mec", elements=2, method=m) for m in ("cg", "newton"))
    assert slow.status == "converged"
    assert slow.energy == pytest.approx(fast.energy, rel=1e-6)
    assert slow.evaluations > 5 * fast.evaluations


def test_scaling_moves_the_curve_and_scales_the_energy():
    one, big = (minimum_curve(k * WOODFORD + [5.0, -3.0], "mvc", elements=2) for k in (1.0, 40.0))
    assert big.energy * 40.0**3 == pytest.approx(one.energy, rel=1e-7)
    np.testing.assert_allclose((big.curve.point(0.4) - [5, -3]) / 40.0, one.curve.point(0.4) - [5, -3], atol=1e-5)


def test_no_euler_spiral_spline_varies_less():
    other = sum(s.length * s.curvatures[1] ** 2 for s in interpolating_spline(WOODFORD, "euler").segments)
    assert minimum_curve(WOODFORD, "mvc").energy < other


@pytest.mark.parametrize("energy", ENERGIES)
def test_points_on_a_line_give_the_line(energy):
    line = minimum_curve([[0, 0], [1, 0], [3, 0]], energy)
    assert (line.status, line.energy) == ("converged", pytest.approx(0.0, abs=1e-12))
    assert line.length == pytest.approx(3.0, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"energy": "mek"}, "mec, mvc"),
        ({"method": "bfgs"}, "newton, cg"),
        ({"elements": 0}, "1 to 256"),
        ({"elements": 2.5}, "1 to 256"),
        ({"tangents": [0.0]}, "5 points"),
        ({"tangents": [np.inf] * 5}, "infinite"),
        ({"energy": "mec", "curvatures": [0.0] * 5}, "cannot hold a curvature"),
        ({"points": [[0, 0], [0, 0]]}, "the same"),
    ],
)
def test_bad_input(change, words):
    with pytest.raises(InvalidInputError, match=words):
        minimum_curve(**{"points": OPEN, **change})


def test_open_starts_are_refused():
    with pytest.raises(InvalidInputError, match="gap"):
        minimum_closed_curve(Spiral([0, 0], 0.0, [1.0], 3.0))
