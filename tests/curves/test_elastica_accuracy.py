"""Elastica against 35-digit reference values (tests/reference/elastica_reference.py: Taylor series of the equation).

The contract: a position is off by at most 1e-12 × length, or eight times what one unit in the last place of the
stored numbers does to it where that is more; a column of the Jacobian by at most 1e-9 of its size (or, likewise,
eight times its sensitivity).
"""

from __future__ import annotations

import importlib.util
import json
import math
import random
import sys
from pathlib import Path

import mpmath
import numpy as np
import pytest

from batten.curves.elastica import Elastica

REFERENCE = Path(__file__).parents[1] / "reference"


def _load(stem):
    spec = importlib.util.spec_from_file_location(stem, REFERENCE / f"{stem}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[stem] = module  # dataclasses look their module up there
    spec.loader.exec_module(module)
    return module


reference = _load("elastica_reference")
TABLE = json.loads((REFERENCE / "elastica_table.json").read_text(encoding="utf-8"))["cases"]
GROUPS = sorted({case["group"] for case in TABLE})


def _of_group(group):
    return [case for case in TABLE if case["group"] == group]


def _numbers(case):
    return [float.fromhex(v) for v in case["input"]]


def _elastica(numbers):
    x, y, angle, curvature, force_x, force_y, length = numbers
    return Elastica(start=(x, y), start_angle=angle, start_curvature=curvature, force=(force_x, force_y), length=length)


def _values(curve, s):
    """Position relative to the start, angle and curvature at the arc lengths s: shape (n, 4)."""
    s = np.asarray(s)
    shifted = curve.point_at(s) - np.asarray(curve.start)
    return np.column_stack([shifted, curve.angle_at(s), curve.curvature_at(s)])


def _sizes(numbers, s, angle):
    """What the errors of position, angle and curvature are measured against."""
    _, _, start_angle, curvature, force_x, force_y, length = numbers
    root_force = math.sqrt(math.hypot(force_x, force_y))
    turning = 1 + abs(start_angle) + abs(angle - start_angle)
    return length, turning, abs(curvature) + 2 * root_force + 1 / length


def _too_far(numbers, s, row, expected, sensitivity):
    errors = (
        math.hypot(row[0] - expected[0], row[1] - expected[1]),
        abs(row[2] - expected[2]),
        abs(row[3] - expected[3]),
    )
    sizes = _sizes(numbers, s, expected[2])
    out = []
    for name, error, size, moved in zip(("position", "angle", "curvature"), errors, sizes, sensitivity, strict=True):
        allowed = max(1e-12 * size, 8 * moved)
        if not error <= allowed:
            out.append(
                f"{name} off by {error:.2e}, allowed {allowed:.2e} (size {size:.2e}, one-ulp sensitivity {moved:.2e})"
            )
    return out


@pytest.mark.parametrize("group", GROUPS)
def test_position_angle_and_curvature_keep_the_accuracy_contract(group):
    broken = []
    for case in _of_group(group):
        numbers = _numbers(case)
        lengths = [float.fromhex(p["s"]) for p in case["points"]]
        for s, row, point in zip(lengths, _values(_elastica(numbers), lengths), case["points"], strict=True):
            expected = [float(v) for v in point["xyak"]]
            broken += [
                f"{numbers} at s={s!r}: {line}" for line in _too_far(numbers, s, row, expected, point["sensitivity"])
            ]
    assert not broken, f"{len(broken)} values outside the contract:\n" + "\n".join(broken[:12])


@pytest.mark.parametrize("group", GROUPS)
def test_jacobian_columns_keep_the_accuracy_contract(group):
    broken = []
    for case in _of_group(group):
        numbers, end = _numbers(case), case["points"][-1]
        s, length = float.fromhex(end["s"]), numbers[6]
        jacobian = _elastica(numbers).jacobian_at(s)
        assert jacobian.shape == (2, 7)
        np.testing.assert_array_equal(
            jacobian[:, [0, 1, 6]], [[1, 0, 0], [0, 1, 0]]
        )  # by start and, at fixed s, by length
        moved = end.get("jacobian_sensitivity", [0.0] * 4)
        for column, expected, sensitive, power in zip(
            jacobian[:, 2:6].T, end["jacobian"], moved, (1, 2, 3, 3), strict=True
        ):
            size = math.hypot(*expected)
            error = math.hypot(column[0] - expected[0], column[1] - expected[1])
            allowed = max(1e-9 * size, 8 * sensitive, 1e-14 * length**power)
            if not error <= allowed:
                broken.append(
                    f"{numbers} at s={s!r}: {column} for {expected}, off by {error:.2e}, allowed {allowed:.2e}"
                )
    assert not broken, f"{len(broken)} columns outside the contract:\n" + "\n".join(broken[:12])


def test_fresh_random_elastica_match_the_reference():
    rng = random.Random(7)
    for _ in range(25):
        length = 10 ** rng.uniform(-6, 6)
        numbers = [
            rng.uniform(-1, 1) * length,
            rng.uniform(-1, 1) * length,
            rng.uniform(-4, 4),
            rng.uniform(-15, 15) / length,
        ]
        numbers += [rng.uniform(-60, 60) / length**2, rng.uniform(-60, 60) / length**2, length]
        s = length * rng.uniform(0.1, 1.0)
        (point,) = reference.reference_points(numbers[2], numbers[3], (numbers[4], numbers[5]), [s])
        ulps = [math.ulp(v) for v in (*numbers[2:6], s)]
        derivatives = np.array([[float(v) for v in row] for row in point.derivatives])
        moved = [
            ulps[4] + math.fsum(np.hypot(derivatives[:, 0], derivatives[:, 1]) * ulps[:4]),
            abs(float(point.curvature)) * ulps[4] + math.fsum(abs(derivatives[:, 2]) * ulps[:4]),
            math.fsum(abs(derivatives[:, 3]) * ulps[:4]),
        ]
        curve = _elastica(numbers)
        expected = [float(v) for v in (point.x, point.y, point.angle, point.curvature)]
        assert _too_far(numbers, s, _values(curve, [s])[0], expected, moved) == []
        columns = curve.jacobian_at(s)[:, 2:6].T
        sizes = np.hypot(derivatives[:, 0], derivatives[:, 1])
        errors = np.hypot(*(columns - derivatives[:, :2]).T)
        assert np.all(errors <= 1e-9 * sizes), (numbers, s, errors / sizes)


def test_the_reference_agrees_with_elliptic_functions():
    rng = random.Random(3)
    for i in range(12):
        angle, force = rng.uniform(-3, 3), (rng.uniform(-4, 4), rng.uniform(-4, 4))
        curvature = rng.uniform(-4, 4) * (5 if i % 3 == 0 else 1)
        s = rng.choice((1.0, 4.0))
        (point,) = reference.reference_points(angle, curvature, force, [s], derivatives=False)
        with mpmath.workdps(60):
            closed = reference.closed_form_point(angle, curvature, force, s)
            for one, other in zip((point.x, point.y, point.curvature), closed, strict=True):
                assert abs(one - other) < mpmath.mpf(10) ** -45


def test_the_references_derivatives_agree_with_differences():
    numbers, s = [mpmath.mpf(v) for v in (0.3, -1.7, 2.1, 0.9)], 2.5
    (point,) = reference.reference_points(numbers[0], numbers[1], numbers[2:], [s])
    with mpmath.workdps(60):
        h = mpmath.mpf(10) ** -18
        for i in range(4):
            ends = []
            for side in (h, -h):
                moved = [v + side * (i == j) for j, v in enumerate(numbers)]
                ends += reference.reference_points(moved[0], moved[1], moved[2:], [s], derivatives=False)
            for name, exact in zip(("x", "y", "angle", "curvature"), point.derivatives[i], strict=True):
                difference = (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * h)
                assert abs(difference - exact) < mpmath.mpf(10) ** -32
