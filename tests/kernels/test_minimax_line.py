"""The best straight line against linear programming and a scan of all slopes."""

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

from batten.kernels.minimax_line import minimax_line_batch


def best_lines(x, y):
    out = np.empty((len(x), 3))
    minimax_line_batch(np.ascontiguousarray(x), np.ascontiguousarray(y), out)
    return out


def least_vertical(x, y):
    """min over a, b of max |y − a − b x|, by linear programming."""
    ones = np.ones_like(x)
    upper = np.concatenate([np.stack([ones, x, -ones], axis=1), np.stack([-ones, -x, -ones], axis=1)])
    done = linprog([0, 0, 1], upper, np.concatenate([y, -y]), bounds=[(None, None)] * 2 + [(0, None)])
    assert done.status == 0
    return done.x[2]


def widths(x, y, angles):
    """Half the extent of points across lines of the given inclinations."""
    across = np.outer(np.cos(angles), y) - np.outer(np.sin(angles), x)
    return 0.5 * np.ptp(across, axis=1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 3, 7, 40])
def test_the_best_line_against_linear_programming_and_a_scan_of_all_slopes(seed, count) -> None:
    rng = np.random.default_rng([seed, count])
    x = np.sort(rng.uniform(-3.0, 5.0, count))
    y = 1.7 * x * rng.normal() + rng.normal(0.0, (0.01, 0.3)[seed % 2], count) + 0.1 * x**2
    (start, slope, off), turn = best_lines(x[None], y[None])[0], None
    distance = np.abs(y - start - slope * (x - x[0])) / np.hypot(1.0, slope)
    assert distance.max() == pytest.approx(off, abs=1e-12)
    # In the frame of the best line vertical distances are no better: any line there is no nearer than it is high.
    turn = np.arctan(slope)
    along, across = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    assert least_vertical(along, across) == pytest.approx(off, abs=1e-9)
    # No other slope is better: those through two points hold the best one, and a scan holds the rest.
    pairs = [np.arctan2(y[j] - y[i], x[j] - x[i]) for i, j in itertools.combinations(range(count), 2)]
    assert widths(x, y, np.array(pairs)).min() == pytest.approx(off, abs=1e-12)
    assert widths(x, y, np.linspace(-1.55, 1.55, 4001)).min() >= off - 1e-12


def test_points_that_do_not_count_and_rows_without_any() -> None:
    x = np.tile(np.arange(5.0), (4, 1))
    y = np.full((4, 5), np.nan)
    y[0, [1, 3]] = 2.0, 6.0
    y[1, 2] = 7.0
    y[2] = 0.0, 9.0, 0.0, 9.0, 0.0
    got = best_lines(x, y)
    assert got[0] == pytest.approx([0.0, 2.0, 0.0], abs=1e-15)
    assert got[1].tolist() == [7.0, 0.0, 0.0]
    assert np.isnan(got[3]).all()
    y[2, [1, 3]] = np.nan
    assert best_lines(x, y)[2] == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)
