"""The sample in the unit disc: constraints told independently, shares in closed form, Tables 3.3 and 3.4 of Fisker2018."""

import numpy as np
import pytest

from batten.measures.lambda_residual import lambda_residual
from batten.studies.projection import random_beziers
from batten.studies.random_sample import (
    ANGLES,
    LENGTHS,
    NEEDED,
    PAPER,
    PAPER_COUNTS,
    ROWS,
    SIMPLE,
    STUDY,
    ZONE,
    RandomPart,
    columns,
    lines,
    run_part,
    statistics,
)
from batten.studies.study import run

SIZE = 200_000


@pytest.fixture(scope="module")
def outcome():
    return run(STUDY, SIZE, seed=5)


def cross(a, b):
    return (a.conjugate() * b).imag


def test_constraints_told_from_the_points_alone():
    """Crossings by orientations, angle and edge-length constraints as printed, with the readings of the errata."""
    z = random_beziers(20_000, 8, 0) @ [1.0, 1.0j]
    part = run_part(8, 0, 20_000)
    p0, p1, p2, p3 = z.T
    one = cross(p1 - p0, p2 - p0) * cross(p1 - p0, p3 - p0) < 0.0
    other = cross(p3 - p2, p0 - p2) * cross(p3 - p2, p1 - p2) < 0.0
    assert np.array_equal(part.satisfying(SIMPLE), ~(one & other))
    e1, e2 = (p1 - p0) / (p3 - p0), (p2 - p3) / (p3 - p0)
    theta1, theta2 = np.angle(e1), np.angle(e2)
    beta1, beta2 = (np.pi - theta1) % (2.0 * np.pi), theta2 % (2.0 * np.pi)
    angles = (np.abs(beta1 - np.pi) < 2.0 * np.pi / 3.0) & (np.abs(beta2 - np.pi) < 2.0 * np.pi / 3.0)
    angles &= np.abs(beta1 - beta2) < 0.4 * np.pi
    assert np.array_equal(part.satisfying(ANGLES), angles)
    delta = np.sign(theta2) * (theta1 - theta2) / np.pi
    least, most = np.fmax(0.4 * (1.0 + 6.0 * delta), 0.27), np.fmax(1.2 * (1.0 + 5.0 * delta), 0.58)
    low, high = np.sort(np.abs([e1, e2]), axis=0)
    inner = np.stack([e1, 1.0 + e2], axis=1)
    phi = np.angle([(p2 - p1) / (p0 - p1), (p3 - p2) / (p1 - p2)]) % (2.0 * np.pi)
    inflectional = (phi[0] - np.pi) * (phi[1] - np.pi) <= 0.0
    lengths = (least <= low) & (high <= most) & (~inflectional | (high < 1.3 * low))
    assert np.array_equal(part.satisfying(LENGTHS | ANGLES), lengths & angles)
    assert part.inner @ [1.0, 1.0j] == pytest.approx(inner, rel=1e-6)
    assert part.phi == pytest.approx(phi.T, abs=1e-6)


def test_residuals_are_those_of_the_curves_in_standard_position(outcome):
    some = np.zeros((500, 4, 2))
    some[:, 3, 0] = 1.0
    some[:, 1:3] = outcome.results.inner[:500]
    assert lambda_residual(some) == pytest.approx(outcome.results.residual[:500], abs=1e-4)


def test_share_of_simple_polygons_in_closed_form(outcome):
    """Four points in a disc are convex with 1 − 35/(12π²) (Sylvester); one of three pairings of those crosses."""
    share = 1.0 - (1.0 - 35.0 / (12.0 * np.pi**2)) / 3.0
    found = outcome.results.satisfying(SIMPLE).mean()
    assert found == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / SIZE))


def test_table_3_4_within_sampling_error(outcome):
    counts, table = statistics(outcome.results)
    n = counts[4]
    assert n > 2000
    best = PAPER[4][0]
    assert table[4, 0] == pytest.approx(best, abs=4.0 * np.sqrt(best * (1.0 - best) / n))
    values = outcome.results.residual[outcome.results.satisfying(NEEDED[4])]
    assert table[4, 4] == pytest.approx(0.15, abs=0.005 + 3.0 * values.std() / np.sqrt(n))
    assert table[4, 2:4].tolist() == [0.0, 0.0]
    assert table[4, 5] < 0.4


def test_other_shares_are_a_few_percent_from_the_papers(outcome):
    """Not within sampling error, see `lines`: the paper's sample is another, but not very different."""
    counts, table = statistics(outcome.results)
    for row, column in ((2, 0), (2, 1), (3, 2), (3, 3), (3, 4)):
        assert table[row, column] == pytest.approx(PAPER[row][column], abs=0.02)
    for row in (3, 4):
        assert counts[row] / counts[row - 1] == pytest.approx(PAPER_COUNTS[row] / PAPER_COUNTS[row - 1], abs=0.02)
    assert counts[2] / SIZE < 0.36  # of eight million the paper keeps 0.542
    assert outcome.results.satisfying(ANGLES).mean() == pytest.approx(0.533, abs=0.005)


def test_statistics_of_known_results():
    residual = np.array([0.1, 0.22, 0.3, 0.4, 0.8, 1.0], np.float32)
    holds = np.array([15, 15, 11, 3, 1, 0], np.uint8)
    part = RandomPart(np.zeros((6, 2, 2), np.float32), np.zeros((6, 2), np.float32), residual, holds)
    counts, table = statistics(part)
    assert counts == [6, 5, 4, 3, 2]
    assert table[0] == pytest.approx([1 / 6, 2 / 6, 1 / 6, 2 / 6, 2.82 / 6, 1.0])
    assert table[4] == pytest.approx([0.5, 0.5, 0.0, 0.0, 0.16, 0.22])
    assert columns(part)["in_zone"].tolist() == [True, True, True, False, False, False]
    assert part.satisfying(SIMPLE | ZONE).sum() == 3


def test_what_is_printed(outcome):
    text = lines(outcome)
    counts, _ = statistics(outcome.results)
    for name, count in zip(ROWS, counts):
        assert any(line.startswith(name) and f"{count:,}" in line for line in text)
    assert max(map(len, text)) <= 120
    assert len(lines(run(STUDY, 1, seed=1))) == len(text)
