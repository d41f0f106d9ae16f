"""The affine fit of curvature against adaptive quadrature, mpmath, circles and integrated elastica."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from batten.curves.bezier import CubicBezier
from batten.curves.bspline import BSplineCurve
from batten.curves.elastica import Elastica
from batten.curves.polyline import Polyline
from batten.curves.similarity import Similarity
from batten.errors import InvalidInputError
from batten.measures.curvature_fit import basic_length, curvature_fit, multipliers

FIELDS = ("length", "bending_energy", "residual_norm", "lambda_1", "lambda_2", "alpha", "lambda_residual")
ARCH = np.array([(0, 0), (0.1, 0.7), (0.9, 0.7), (1, 0)])


def _columns(fit):
    return np.stack([np.asarray(getattr(fit, name)) for name in FIELDS], axis=-1)


def test_everything_agrees_with_adaptive_quadrature(random_cubics):
    control, expected = random_cubics
    found = _columns(curvature_fit(control, tolerance=1e-10))
    size = np.stack(
        [
            expected[:, 0],
            expected[:, 1],
            np.sqrt(expected[:, 1]),
            *[np.linalg.norm(expected[:, 3:6], axis=1)] * 3,
            np.ones(len(expected)),
        ],
        axis=1,
    )
    np.testing.assert_array_less(np.abs(found - expected) / size, 1e-8)


def test_a_curve_object_gives_the_numbers_of_its_row(random_cubics):
    control, _ = random_cubics
    batch = _columns(curvature_fit(control[:6]))
    for row, points in zip(batch, control):
        np.testing.assert_array_equal(_columns(curvature_fit(CubicBezier(points))), row)
        # The same curve through the path for any `Curve`: other panels, other algebra.
        spline = BSplineCurve([0, 0, 0, 0, 1, 1, 1, 1], points)
        np.testing.assert_allclose(_columns(curvature_fit(spline)), row, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("angle", "curvature", "force", "length"),
    [
        (0.3, 2.0, (3.0, -1.0), 3.0),
        (0.0, 0.5, (-2.0, 4.0), 2.5),
        (1.0, 4.0, (0.5, 0.2), 2.0),
        (2.0, 0.0, (9.0, 3.0), 3.0),
    ],
)
def test_the_multipliers_of_an_elastica_come_back(elastica_from, angle, curvature, force, length):
    start = (0.4, -0.7)
    curve = elastica_from(angle, curvature, force, length, start)
    fit = curvature_fit(curve)
    assert fit.length == pytest.approx(length, rel=1e-11)
    assert fit.lambda_1 == pytest.approx(force[0], abs=1e-6)
    assert fit.lambda_2 == pytest.approx(force[1], abs=1e-6)
    # κ at the start, and with it α.
    assert fit.alpha + fit.lambda_2 * start[0] - fit.lambda_1 * start[1] == pytest.approx(curvature, abs=1e-6)
    assert fit.lambda_residual < 1e-7
    assert multipliers(curve) == (fit.lambda_1, fit.lambda_2, fit.alpha)
    assert basic_length(curve) == pytest.approx(length**2 * np.hypot(*force), rel=1e-6)


@pytest.mark.parametrize(
    ("start_angle", "curvature", "force", "length"),
    [
        (0.3, 2.0, (3.0, -1.0), 6.0),
        (-1.0, 0.0, (40.0, 10.0), 9.0),
        (0.0, 5.0, (1.0, 1.0), 12.0),
        (0.5, 1e-3, (0.1, 0.2), 1.0),
    ],
)
def test_our_own_elastica_have_no_residual(start_angle, curvature, force, length):
    elastica = Elastica(
        start=(0.2, 0.1), start_angle=start_angle, start_curvature=curvature, force=force, length=length
    )
    fit = curvature_fit(elastica)
    assert fit.lambda_residual < 1e-12
    assert complex(fit.lambda_1, fit.lambda_2) == pytest.approx(complex(*force), abs=1e-9)
    assert fit.bending_energy == pytest.approx(elastica.bending_energy(), rel=1e-7)
    assert fit.length == pytest.approx(length, rel=1e-13)


def test_a_circle(arc):
    fit = curvature_fit(arc(2.0, 0.3, 5.0, centre=(7.0, -3.0)))
    assert fit.length == pytest.approx(10.0, rel=1e-14)
    assert fit.bending_energy == pytest.approx(2.5, rel=1e-13)
    assert fit.alpha == pytest.approx(0.5, abs=1e-13)
    assert max(abs(fit.lambda_1), abs(fit.lambda_2), fit.lambda_residual) < 1e-14
    clockwise = curvature_fit(arc(2.0, 0.3, -5.0))
    assert clockwise.alpha == pytest.approx(-0.5, abs=1e-13)


def _near_line(sagitta):
    return np.array([(0.0, 0.0), (1.0, sagitta), (2.2, -0.4 * sagitta), (3.0, 0.3 * sagitta)])


@pytest.mark.parametrize("sagitta", [1e-3, 1e-6, 1e-9, 1e-12])
def test_near_lines_against_mpmath(sagitta):
    control = _near_line(sagitta)
    with mpmath.workdps(50):
        p = [[mpmath.mpf(float(v)) for v in row] for row in control]

        def nodes(t):
            u = 1 - t
            values = []
            for k in (0, 1):
                a, b, c, d = (row[k] for row in p)
                values.append(a * u**3 + 3 * b * t * u**2 + 3 * c * t**2 * u + d * t**3)
                values.append(3 * ((b - a) * u**2 + 2 * (c - b) * t * u + (d - c) * t**2))
                values.append(6 * ((c - 2 * b + a) * u + (d - 2 * c + b) * t))
            x, dx, ddx, y, dy, ddy = values
            speed = mpmath.hypot(dx, dy)
            return speed, x, y, (dx * ddy - dy * ddx) / speed**3

        x, w = np.polynomial.legendre.leggauss(60)
        moments = mpmath.zeros(4, 4)
        for node, weight in zip(x, w):
            speed, px, py, kappa = nodes((1 + mpmath.mpf(node)) / 2)
            row = mpmath.matrix([1, px, py, kappa])
            moments += row * row.T * (speed * mpmath.mpf(weight) / 2)
        solution = mpmath.lu_solve(moments[:3, :3], moments[:3, 3])
        rest = moments[3, 3] - sum(solution[i] * moments[i, 3] for i in range(3))
        energy, exact = float(moments[3, 3]), float(mpmath.sqrt(rest / moments[3, 3]))
    assert 0.1 < exact < 1.0
    turned = Similarity(0.8, 1.1, (0.3, 0.2))
    for similarity, slack in ((Similarity(), 1e-12), (turned, 1e-13 + 4e-15 / sagitta)):
        control_here = similarity.apply(control)
        for curve in (control_here, BSplineCurve([0, 0, 0, 0, 1, 1, 1, 1], control_here)):
            fit = curvature_fit(curve, tolerance=1e-10)
            assert fit.lambda_residual == pytest.approx(exact, abs=1e-10 + slack)
            assert fit.bending_energy * similarity.scale == pytest.approx(energy, rel=1e-10 + slack)


@given(st.floats(0.2, 5.0), st.floats(-4.0, 4.0), st.tuples(st.floats(-5, 5), st.floats(-5, 5)))
@settings(max_examples=50, deadline=None)
def test_how_the_multipliers_transform(scale, rotation, translation):
    control = np.array([(0, 0), (0.2, 0.7), (0.9, 0.9), (1, 0)])
    before = multipliers(control)
    moved = Similarity(scale, rotation, translation).apply(control)
    after = multipliers(moved)
    turned = complex(before.lambda_1, before.lambda_2) * np.exp(1j * rotation) / scale**2
    size = abs(turned)
    assert complex(after.lambda_1, after.lambda_2) == pytest.approx(turned, abs=1e-10 * size)
    # κ at the start: the affine function takes the same value, over the scale, at corresponding points.
    there = after.alpha + after.lambda_2 * moved[0, 0] - after.lambda_1 * moved[0, 1]
    here = before.alpha / scale
    assert there == pytest.approx(here, abs=1e-10 * max(1.0, abs(here)))
    back = multipliers(moved[::-1])
    np.testing.assert_allclose(back, np.negative(after), rtol=1e-9, atol=1e-9)


def test_lines_points_and_cusps():
    line = [(1e6, 1e6), (1e6 + 0.1, 1e6 + 0.2), (1e6 + 0.3, 1e6 + 0.6), (1e6 + 1.0, 1e6 + 2.0)]
    doubled = [(0, 0), (2, 2), (-1, -1), (1, 1)]
    cusp = [(0, 0), (1, 1), (0, 1), (1, 0)]
    retracted = [(0, 0), (0, 0), (1, 1), (2, 0)]
    control = np.array([line, doubled, cusp, retracted, [(1, 0), (-1, 1), (0, 1), (0, 1)]])
    splines = [BSplineCurve([0, 0, 0, 0, 1, 1, 1, 1], c) for c in control]
    for rows in (_columns(curvature_fit(control)), np.stack([_columns(curvature_fit(c)) for c in splines])):
        assert rows[0, 0] == pytest.approx(np.sqrt(5), rel=1e-9)
        np.testing.assert_array_equal(rows[0, 1:], np.zeros(6))
        for row in rows[1:]:
            assert row[1] == row[2] == np.inf
            assert row[6] == 1.0
        assert np.isfinite(rows[1:, [0, 3, 4, 5]]).all()
    point = curvature_fit(CubicBezier([(1, 2)] * 4))
    assert point.length == 0.0
    assert np.isnan(_columns(point)[1:]).all()


def test_shapes_of_batches():
    rows = np.broadcast_to(ARCH, (2, 3, 4, 2))
    assert np.shape(curvature_fit(rows).alpha) == (2, 3)
    assert np.shape(curvature_fit(ARCH).alpha) == ()
    assert np.shape(curvature_fit(np.zeros((0, 4, 2))).alpha) == (0,)


@pytest.mark.parametrize(
    ("curve", "keywords", "word"),
    [
        (np.zeros((5, 2)), {}, "shape"),
        (np.zeros(4), {}, "shape"),
        ("arch", {}, "expected a curve"),
        (ARCH, {"tolerance": 0.0}, "tolerance"),
        (ARCH, {"tolerance": -1e-3}, "tolerance"),
        (ARCH, {"tolerance": np.nan}, "tolerance"),
        (ARCH, {"tolerance": 1e-12}, "tolerance"),
        (Polyline([(0, 0), (1, 1), (2, 0)]), {}, "polyline has no curvature"),
    ],
)
def test_refuses(curve, keywords, word):
    with pytest.raises(InvalidInputError, match=word):
        curvature_fit(curve, **keywords)
