"""docs/approximation.md says what the code gives."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from batten.curves.bezier import CubicBezier
from batten.measures.distance import l2_distance
from batten.measures.lambda_residual import lambda_residual

ROOT = Path(__file__).parents[2]
MAY_DIFFER = ("‖∇F‖", "iter.", "iter.*")  # rounding decides them


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("approximation_table", ROOT / "examples" / "approximation_table.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def table(script):
    return script.rows()


def _cells(text):
    return [[c.strip() for c in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]


def test_the_page_holds_the_table(script, table):
    written, computed = (
        _cells(text) for text in ((ROOT / "docs" / "approximation.md").read_text(), script.page(table))
    )
    assert len(computed) == 14  # heading, rule, twelve curves
    assert len(written) == len(computed)
    keep = [i for i, name in enumerate(script.HEAD) if name not in MAY_DIFFER]
    for old, new in zip(written, computed):
        assert [old[i] for i in keep] == [new[i] for i in keep]
    assert (ROOT / "docs" / "pictures" / "approximation.png").stat().st_size < 200_000


def test_its_numbers_are_those_of_the_measures(script, table):
    for row in table:
        curve = CubicBezier(script.CURVES[row.name])
        assert row.r1 == pytest.approx(lambda_residual(curve), rel=0.02)
        assert row.r4_guess == pytest.approx(l2_distance(curve, row.guess), rel=1e-3)
        assert row.r4_free == pytest.approx(l2_distance(curve, row.free), rel=1e-3)
        assert row.r4_fixed == pytest.approx(l2_distance(curve, row.fixed), rel=1e-3)
        assert row.r4_free <= row.r4_fixed
        assert row.r4_free <= row.r4_guess
        assert row.gradient < 1e-9
        assert row.iterations < 100
        np.testing.assert_allclose(row.fixed.point([0.0, 1.0]), curve.point([0.0, 1.0]), atol=1e-10)


def test_the_curves_are_of_the_kinds_they_are_named_for(script, table):
    kinds = {row.name: row for row in table}
    assert len(kinds) == 12
    assert kinds["arch"].inflections == kinds["near line"].inflections == kinds["horseshoe"].inflections == 0
    assert kinds["flat s-shape"].inflections == 1
    assert kinds["near cusp"].r1 > 0.9
    assert kinds["near line"].r4_free < 1e-5
    for name in ("loop", "leaning loop"):  # the fit turns by more than half a turn as the curve does
        free = kinds[name].free
        assert abs(np.ptp(free.angle_at(np.linspace(0.0, free.length, 200)))) > np.pi
