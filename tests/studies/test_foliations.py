"""Tables 5.1 and 5.2 for surfaces whose numbers are found by other means."""

import re

import numpy as np
import pytest
from scipy.spatial import cKDTree

from batten.curves.bspline import BSplineCurve
from batten.curves.cubic_proxy import CubicProxy
from batten.measures.distance import l2_distance
from batten.measures.lambda_residual import lambda_residual
from batten.splines.analytic_description import analytic_description
from batten.studies.foliations import (
    MEASURES,
    PAPER_5_1,
    PAPER_5_2,
    foliation_numbers,
    interpolated_foliations,
    interpolation_lines,
    table_5_1,
    table_5_2,
)
from batten.surfaces.design_surface import spline_curve

X = np.array([0.0, 200, 400, 800, 1000, 1200])
HEIGHTS = (
    (0, 150, 230, 230, 150, 0),
    (0, 170, 190, 40, -60, 0),
    (0, 60, -40, -190, -170, 0),
    (40, -150, -230, -230, -150, 0),
)
SPLINES = [CubicProxy(np.column_stack([X, y])) for y in HEIGHTS]
CURVES = [spline_curve(s) for s in SPLINES]
POSITIONS = np.array([0.0, 200.0, 400.0, 600.0])


@pytest.fixture(scope="module")
def numbers():
    return foliation_numbers("test", CURVES, POSITIONS, 5)


def test_curves_are_the_even_ones_and_the_design_curves(numbers):
    assert numbers.positions == pytest.approx([0.0, 150.0, 200.0, 300.0, 400.0, 450.0, 600.0])
    assert numbers.design.tolist() == [True, False, True, False, True, False, True]
    assert set(numbers.status) == {"converged"}
    assert foliation_numbers("even", CURVES, POSITIONS, 4).design.all()


def test_numbers_of_the_design_curves_by_other_ways(numbers):
    """λ-residual from the Béziers; distances from one curve's own description, by nearest samples and by `l2_distance`."""
    for spline, row in zip(SPLINES, np.flatnonzero(numbers.design)):
        assert numbers.residuals[row] == pytest.approx(lambda_residual(spline.pieces).max(), abs=1e-6)
        rods = analytic_description(spline, 2).curve
        t = np.linspace(0.0, 1.0, 40001)
        a, b = spline.point(t), rods.point(t)
        hausdorff = max(cKDTree(a).query(b)[0].max(), cKDTree(b).query(a)[0].max())
        assert numbers.hausdorff[row] == pytest.approx(hausdorff, abs=2e-3)
        assert numbers.hausdorff[row] > 0.01
        # points at equal fractions of the whole instead of each piece: nearly the same
        assert numbers.l2[row] == pytest.approx(l2_distance(spline, rods), rel=0.05)


def test_statistics_are_those_of_the_table(numbers):
    found = numbers.statistics()
    assert found.shape == (len(MEASURES), 4, 2)
    for values, (greatest, mean, median, variance) in zip((numbers.residuals, numbers.l2, numbers.hausdorff), found):
        for some, j in ((values[[0, 2, 4, 6]], 0), (values, 1)):
            assert greatest[j] == max(some)
            assert mean[j] == pytest.approx(sum(some) / len(some))
            middle = sorted(some)[len(some) // 2 - 1 : len(some) // 2 + 1] if len(some) % 2 == 0 else sorted(some)[3:4]
            assert median[j] == pytest.approx(sum(middle) / len(middle))
            assert variance[j] == pytest.approx(sum((v - mean[j]) ** 2 for v in some) / len(some))


def test_the_tables_show_ours_and_the_thesis_numbers(numbers):
    lines = table_5_1([numbers, numbers])
    assert lines[0].split()[-2:] == ["(1)", "(2)"]
    worst = numbers.residuals[numbers.design].max(), numbers.residuals.max()
    assert round(worst[0], 2) != round(worst[1], 2)  # else the two rows could be exchanged
    for line, value in zip(lines[1:3], worst):
        assert [float(v) for v in line.split()[-2:]] == pytest.approx([value] * 2, abs=0.00501)
    assert [float(v) for v in lines[3].split()[-2:]] == [0.06, 0.10]
    assert [float(v) for v in lines[4].split()[-2:]] == [0.08, 0.10]
    rows = table_5_2(numbers)
    found = np.array([[float(v) for v in re.findall(r"-?\d\.\d\de[+-]\d\d", line)] for line in rows[1:]])
    assert found[0::2] == pytest.approx(numbers.statistics().reshape(3, 8), rel=6e-3)
    assert found[1::2] == pytest.approx(np.array(PAPER_5_2))
    assert all(line.startswith(word) for line, word in zip(rows[1::2], MEASURES))


def test_the_thesis_numbers_are_typed_right():
    """What the text says of Table 5.1: twelve foliations, all below 0.21, all curves at least the design curves."""
    design, every = np.array(PAPER_5_1)
    assert len(design) == len(every) == 12
    assert (design <= every).all()
    assert every.max() == 0.18 < 0.21
    maximum, mean, median, variance = np.moveaxis(np.array(PAPER_5_2).reshape(3, 4, 2), 1, 0)
    assert (maximum >= mean).all()
    assert (mean >= median).all()
    assert (variance < maximum**2).all()


def test_a_curve_that_cannot_be_described_is_told():
    point = BSplineCurve([0, 0, 0, 0, 1, 1, 2, 2, 2, 2], np.zeros((6, 2)))
    numbers = foliation_numbers("point", [point, CURVES[0]], [0.0, 100.0], 3)
    assert numbers.status == ("bad input", "converged", "converged")
    assert np.isnan(numbers.hausdorff[0])
    assert np.isinf(numbers.residuals[0])
    assert np.isfinite(numbers.hausdorff[1:]).all()


def test_the_second_way_has_its_lines():
    pair = interpolated_foliations(CURVES, POSITIONS, 5)
    head, line = interpolation_lines(["test"], [pair])
    words = line.split()
    assert words[0] == "test"
    assert [float(words[1]), float(words[4])] == pytest.approx([leaves.greatest_distance for leaves in pair], abs=0.006)
    assert words[-2:] == ["0,", "0"]
    assert "C²" in head
    assert all(leaves.misses.max() < 1e-9 for leaves in pair)
