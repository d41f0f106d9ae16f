"""Method 1: its linear algebra against dense one, its shapes against elastica, the gradient method, the fall."""

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.errors import ConvergenceError, InvalidInputError, NoSolutionError
from batten.solvers import discrete_chain
from batten.solvers.discrete_rod import DiscreteRod

ARCH = Elastica((0.3, -0.2), 0.9, -2.1, (1.5, -2.0), 1.0)  # no inflection
WAVE = Elastica((0.0, 0.0), 0.4, 3.0, (4.0, 9.0), 1.0)  # one inflection
LARGE = Elastica((-50.0, 20.0), 0.9 + 4 * np.pi, -2.1 / 40, (1.5 / 1600, -2.0 / 1600), 40.0)


def _rod(elastica, **options):
    points = elastica.point_at([0.0, elastica.length])
    angles = elastica.angle_at([0.0, elastica.length])
    return DiscreteRod(points[0], angles[0], points[1], angles[1], elastica.length, **options)


def _errors(elastica, ends, edges):
    result = _rod(elastica, edges=edges, ends=ends).solve()
    assert result.converged
    assert result.stable
    middle = elastica.angle_at((np.arange(edges) + 0.5) / edges * elastica.length)
    corners = elastica.point_at(np.linspace(0.0, elastica.length, edges + 1))
    return np.array(
        [
            np.abs(result.angles - middle).max(),
            np.abs(result.curve.points - corners).max() / elastica.length,
            abs(result.energy / elastica.bending_energy() - 1.0),
            np.hypot(*(result.force - elastica.force)) / np.hypot(*elastica.force),
        ]
    )


@pytest.mark.parametrize("elastica", [ARCH, WAVE, LARGE])
@pytest.mark.parametrize(("ends", "order"), [("edges", 1), ("points", 2)])
def test_order_of_convergence(elastica, ends, order):
    """Clamped edges are the paper's and of first order (each end is straight on half an edge); clamped points of second."""
    errors = np.stack([_errors(elastica, ends, edges) for edges in (100, 200, 400)])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(np.full((2, 4), order), abs=0.1)
    assert np.all(errors[-1] < (0.2 if order == 1 else 2e-4))


@pytest.mark.parametrize("ends", ["edges", "points"])
def test_constraints_are_held(ends):
    rod = _rod(LARGE, edges=250, ends=ends)
    result = rod.solve()
    assert result.end_error < 1e-12 * 40.0
    assert result.curve.points[0] == pytest.approx(rod.start)
    assert abs(result.length_error) < 1e-12 * 40.0
    assert np.hypot(*np.diff(result.curve.points, axis=0).T) == pytest.approx(np.full(250, 0.16), rel=1e-9)
    if ends == "edges":
        assert result.angles[[0, -1]] == pytest.approx([rod.start_angle, rod.end_angle], abs=1e-12)
    turns = np.diff(result.angles)
    at_clamps = 2 * (result.angles[0] - rod.start_angle) ** 2 + 2 * (rod.end_angle - result.angles[-1]) ** 2
    assert result.energy == pytest.approx((turns @ turns + at_clamps * (ends == "points")) / 0.16, rel=1e-12)


def _dense(diagonal):
    return np.diag(diagonal) - np.eye(len(diagonal), k=1) - np.eye(len(diagonal), k=-1)


def _chain(edges=30):
    return _rod(WAVE, edges=edges)._chain(WAVE.angle_at(1.0))


def test_derivatives_are_those_of_differences():
    chain = _chain()
    rng = np.random.default_rng(1)
    u, force, h = rng.normal(size=chain.unknowns), np.array([0.3, -0.7]), 1e-6
    along, gap = chain.residual(u, force)
    hessian = _dense(chain.hessian(u, force))
    for i, e in enumerate(np.eye(chain.unknowns)):
        up, down = u + h * e, u - h * e
        difference = (chain.energy(up) - chain.energy(down) + force @ (chain.gap(up) - chain.gap(down))) / (2 * h)
        assert along[i] == pytest.approx(difference, abs=1e-8)
        assert chain.slopes(u)[:, i] == pytest.approx((chain.gap(up) - chain.gap(down)) / (2 * h), abs=1e-9)
        both = (chain.residual(up, force)[0] - chain.residual(down, force)[0]) / (2 * h)
        assert hessian[i] == pytest.approx(both, abs=1e-8)
    assert gap == pytest.approx(chain.edge * np.array([np.cos(u).sum(), np.sin(u).sum()]) - chain.goal)


def test_bordered_systems_and_their_inertia_against_dense_ones():
    rng = np.random.default_rng(2)
    counts = set()
    for _ in range(40):
        m = 12
        diagonal, slopes = rng.uniform(-1.0, 3.0, size=m), rng.normal(size=(2, m))
        along, gap = rng.normal(size=m), rng.normal(size=2)
        x, y = discrete_chain.bordered_solution(diagonal, slopes, along, gap)
        matrix = np.block([[_dense(diagonal), slopes.T], [slopes, np.zeros((2, 2))]])
        expected = np.linalg.solve(matrix, np.concatenate([along, gap]))
        assert np.concatenate([x, y]) == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())
        basis = np.linalg.svd(slopes)[2][2:].T
        negative = int((np.linalg.eigvalsh(basis.T @ _dense(diagonal) @ basis) < 0.0).sum())
        assert discrete_chain.descents(diagonal, slopes) == negative
        counts.add(negative)
    assert len(counts) >= 4


def test_a_nearly_singular_tridiagonal_block_does_no_harm():
    m = 20
    lowest = 2.0 - 2.0 * np.cos(np.pi / (m + 1))  # D is singular to 1e-13, the bordered matrix is not
    diagonal, slopes = np.full(m, 2.0 - lowest + 1e-13), np.stack([np.ones(m), np.linspace(-1.0, 1.0, m)])
    along, gap = np.sin(np.arange(m)), np.array([0.2, -0.1])
    x, y = discrete_chain.bordered_solution(diagonal, slopes, along, gap)
    assert np.abs(_dense(diagonal) @ x + y @ slopes - along).max() < 1e-9
    assert np.abs(slopes @ x - gap).max() < 1e-9


def test_only_banded_systems_are_solved(monkeypatch):
    """O(edges) a step: every system has three bands, or is 2 × 2."""
    sizes = []
    banded, least_squares = discrete_chain.solve_banded, np.linalg.lstsq

    def counted(bands, matrix, right, **options):
        assert bands == (1, 1)
        assert right.size <= 3 * matrix.shape[1]
        sizes.append(matrix.shape)
        return banded(bands, matrix, right, **options)

    def small(matrix, right, rcond=None):
        assert min(matrix.shape) == 2
        return least_squares(matrix, right, rcond=rcond)

    def refuse(*_, **__):
        raise AssertionError("a dense system")

    monkeypatch.setattr(discrete_chain, "solve_banded", counted)
    monkeypatch.setattr(np.linalg, "lstsq", small)
    for name in ("inv", "pinv", "eigh", "qr"):
        monkeypatch.setattr(np.linalg, name, refuse)
    result = _rod(WAVE, edges=300).solve()
    assert result.converged
    assert set(sizes) == {(3, 298)}
    assert len(sizes) <= 3 * result.iterations + 2


# A loop that Newton's method does not find from the Bézier: the norm of the gradient grows.
HARD = ((0.0, 0.0), 1.0, (-0.2, 0.3), 2.0, 1.0)


def test_the_gradient_method_takes_over_where_newton_fails():
    rod = DiscreteRod(*HARD, edges=200)
    chain = rod._chain(rod._reached_end_angle(rod._bezier_angles()))
    assert not discrete_chain.newton(chain, rod._inner(rod._bezier_angles()))[3]
    as_printed = rod.solve(polish=False)
    assert as_printed.fallback
    assert "gradient method" in as_printed.status
    assert not as_printed.converged
    assert 1e-12 < as_printed.end_error < 1e-3  # about λ/ρ
    polished = rod.solve()
    assert polished.fallback
    assert polished.converged
    assert polished.stable
    assert polished.end_error < 1e-12
    assert polished.energy == pytest.approx(as_printed.energy, rel=1e-2)


def test_windings_are_those_of_the_start():
    rod = _rod(ARCH, edges=200, ends="points")
    plain = rod.solve()
    assert plain.end_angle == pytest.approx(rod.end_angle, abs=1e-12)
    ramp = np.linspace(0.0, 2.0 * np.pi, 200)
    wound = rod.solve(plain.angles + ramp)
    assert wound.converged
    assert wound.end_angle == pytest.approx(rod.end_angle + 2.0 * np.pi, abs=1e-12)
    assert wound.energy > plain.energy
    shifted = DiscreteRod(
        rod.start, rod.start_angle - 6 * np.pi, rod.end, rod.end_angle - 6 * np.pi, 1.0, 200, "points"
    )
    again = shifted.solve(wound.angles)
    assert again.angles == pytest.approx(wound.angles - 6 * np.pi, abs=1e-9)
    assert again.end_angle == pytest.approx(wound.end_angle - 6 * np.pi, abs=1e-12)


@pytest.mark.parametrize("ends", ["edges", "points"])
def test_a_rod_falls_to_a_stable_shape_and_its_energy_never_rises(ends):
    rng = np.random.default_rng(3)
    s = (np.arange(150) + 0.5) / 150
    for elastica in (ARCH, WAVE, LARGE):
        rod = _rod(elastica, edges=150, ends=ends)
        for _ in range(3):
            waves = sum(rng.normal() * np.sin(np.pi * k * s) for k in (1, 2, 3))
            rest = rod.relax(rod.start_angle + (rod.end_angle - rod.start_angle) * s + waves)
            assert np.all(np.diff(rest.energies) <= 0.0)
            assert rest.energies[-1] == rest.energy
            assert rest.end_error < 1e-12 * elastica.length
            there = rod.solve(rest.angles)
            assert there.stable
            assert there.angles == pytest.approx(rest.angles, abs=1e-8)


def test_a_rod_on_a_saddle_falls_off_it():
    """The symmetric second mode of a compressed rod is stationary, but no minimum."""
    rod = DiscreteRod((0, 0), 0.0, (0.8, 0), 0.0, 1.0, edges=120, ends="points")
    s = (np.arange(120) + 0.5) / 120
    saddle = rod.solve(0.9 * np.sin(2.0 * np.pi * s) * np.cos(2.0 * np.pi * s))
    assert saddle.converged
    assert not saddle.stable
    rest = rod.relax(saddle.angles)
    assert rest.energy < 0.7 * saddle.energy
    assert np.all(np.diff(rest.energies) <= 0.0)
    arch = rod.solve(0.9 * np.sin(2.0 * np.pi * s))
    assert arch.stable
    assert rest.energy == pytest.approx(arch.energy, rel=1e-9)
    assert np.abs(rest.angles) == pytest.approx(np.abs(arch.angles), abs=1e-6)
    assert rest.largest_turn > 0.3


def test_a_stable_rod_stays():
    rod = _rod(WAVE, edges=150, ends="points")
    angles = rod.solve().angles
    rest = rod.relax(angles)
    assert rest.largest_turn < 1e-9
    assert len(rest.energies) <= 3


def test_the_fall_after_a_snap():
    """An arch turned in at its clamps snaps through; what it falls to is the one stable shape that is left on its side."""
    clamps = np.linspace(0.6, -1.2, 60)
    angles, snapped = None, []
    s = (np.arange(100) + 0.5) / 100
    for angle in clamps:
        rod = DiscreteRod((0, 0), angle, (0.95, 0), -angle, 1.0, edges=100, ends="points")
        angles = angle * (1 - 2 * s) if angles is None else angles
        rest = rod.relax(angles)
        assert rod.solve(rest.angles).stable
        snapped.append(rest.largest_turn > 0.3)
        angles = rest.angles
    assert sum(snapped) == 1
    middle = rest.curve.points[50, 1]
    assert middle < 0.0


def test_a_straight_rod():
    rod = DiscreteRod((1.0, 1.0), np.pi / 4, (4.0, 4.0), np.pi / 4, 3 * np.sqrt(2.0))
    result = rod.solve()
    assert result.converged
    assert result.energy < 1e-20
    assert result.end_error < 1e-12
    assert rod.relax(result.angles).energy == 0.0


def test_refusals():
    with pytest.raises(NoSolutionError, match="cannot reach"):
        DiscreteRod((0, 0), 0.0, (2, 0), 0.0, 1.9)
    with pytest.raises(NoSolutionError, match="more edges"):
        DiscreteRod((0, 0), np.pi, (0.95, 0), 0.0, 1.0, edges=20)
    for options in ({"edges": 5}, {"edges": 10.0}, {"ends": "corners"}):
        with pytest.raises(InvalidInputError):
            DiscreteRod((0, 0), 0.0, (1, 0), 0.0, 2.0, **options)
    with pytest.raises(InvalidInputError):
        DiscreteRod((0, np.inf), 0.0, (1, 0), 0.0, 2.0)
    rod = DiscreteRod((0, 0), 1.0, (1, 0), -1.0, 1.5, edges=50)
    for call in (rod.solve, rod.relax):
        with pytest.raises(InvalidInputError):
            call(np.zeros(49))
        with pytest.raises(InvalidInputError):
            call(np.full(50, np.nan))
    with pytest.raises(InvalidInputError):
        rod.relax(np.zeros(50), largest_step=0.0)
    with pytest.raises(ConvergenceError) as caught:
        rod.relax(np.linspace(1.0, -1.0, 50) + np.sin(np.arange(50)), max_steps=2)
    assert caught.value.best.shape == (50,)
