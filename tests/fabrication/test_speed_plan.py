"""Ways and speeds of points of the blade against closed forms: shifts, turns, slides; and times against a search."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.job import BladeJob, CutJob, KerfJob, SurfaceJob
from batten.fabrication.kerf import KerfLaw
from batten.fabrication.plan import Block, RodPlacement
from batten.fabrication.speed_plan import STATIONS, leaf_seconds, local_ways_mm, seconds_for_kerf
from batten.surfaces.plane import Plane

BLOCK = Block(1, 0, 0, np.zeros(3), np.array([600.0, 600.0, 400.0]))
LAWS = {
    "sum": KerfLaw(formula="a + b / v", a=0.4, b=12.0),
    "power": KerfLaw(formula="a * v^-b", a=6.0, b=0.6),
    "table": KerfLaw((5.0, 10.0, 20.0, 40.0), (2.8, 1.6, 1.0, 0.7)),
}


def rod(y=100.0, *, angle=0.0, curvature=0.0, start=(0.0, 200.0), length=600.0, before=200.0, turn=0.0, leaf=1):
    """A line or an arc in the vertical plane through (0, y), turned in plan by `turn`."""
    piece = Elastica(start, angle, curvature, (0.0, 0.0), length)
    plane = Plane((0.0, y, 0.0), (np.cos(turn), np.sin(turn), 0.0), (0.0, 0.0, 1.0))
    return RodPlacement(1, leaf, plane, np.zeros((0, 2)), piece, piece.extended(before, 200.0), before)


def test_a_shift_moves_all_points_alike() -> None:
    ways = local_ways_mm([rod(100.0), rod(120.0), rod(125.0, start=(0.0, 212.0))], BLOCK)
    assert ways.shape == (2, STATIONS)
    assert ways[0] == pytest.approx(np.full(STATIONS, 20.0), abs=1e-9)
    assert ways[1] == pytest.approx(np.full(STATIONS, 13.0), abs=1e-9)


def test_a_turn_about_the_end_moves_each_point_by_the_chord_of_its_arc() -> None:
    turn = 0.08
    # In plan: the planes turn about the vertical through the piece's start; and the rod in its own plane, about the same.
    for other in (rod(100.0, turn=turn), rod(100.0, angle=turn)):
        ways = local_ways_mm([rod(100.0), other], BLOCK)[0]
        s = np.linspace(0.0, 600.0, STATIONS)
        assert ways == pytest.approx(2.0 * s * np.sin(0.5 * turn), abs=1e-9)


def test_sliding_along_itself_melts_nothing() -> None:
    slid = rod(100.0, start=(7.0, 200.0), length=593.0, before=200.0)
    assert local_ways_mm([rod(100.0), slid], BLOCK)[0] == pytest.approx(np.zeros(STATIONS), abs=1e-9)
    # An arc turned about its centre slides along itself as well: but for the sagitta of a step, nothing is left.
    radius, step = 500.0, 0.01
    centre = np.array([300.0, 0.0])

    def on_circle(by):
        at = np.pi / 2 + 0.4 - by
        start = centre + radius * np.array([np.cos(at), np.sin(at)])
        return rod(100.0, start=start, angle=at - np.pi / 2, curvature=-1.0 / radius, length=400.0)

    ways = local_ways_mm([on_circle(0.0), on_circle(step)], BLOCK)[0]
    assert np.nanmax(ways) < radius * step**2
    assert radius * step == 5.0, "while its points go 5 mm"


def test_only_what_lies_in_the_block_counts() -> None:
    # Turned by 0.1 about x = −300: the middles of the ways lie in the block for 0 ≤ x ≤ 600.
    turn = 0.1
    long = [rod(100.0, start=(-300.0, 200.0), length=1200.0, angle=a) for a in (-0.5 * turn, 0.5 * turn)]
    ways = local_ways_mm(long, BLOCK)[0]
    chord = 2.0 * np.sin(0.5 * turn)
    assert ways[[0, -1]] == pytest.approx(
        [300.0 / np.cos(0.5 * turn) * chord, 900.0 / np.cos(0.5 * turn) * chord], rel=1e-6
    )
    assert np.isnan(local_ways_mm([rod(700.0), rod(720.0)], BLOCK)).all()
    # A move counts where its middle is in the block.
    assert np.isfinite(local_ways_mm([rod(-5.0), rod(10.0)], BLOCK)).all()


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("slow", [19.0, 15.0, 12.0])
def test_the_times_make_the_worst_difference_least(law, slow) -> None:
    ways = np.linspace(slow, 20.0, 33)
    seconds = float(seconds_for_kerf(ways, law, 1.0, 1.0, 100.0))

    def worst(time):
        widths = law.width_mm(ways / time)
        return float(np.abs(widths - 1.0).max()) if np.isfinite(widths).all() else 9.0

    assert law.width_mm(np.array([slow, 20.0]) / seconds).mean() == pytest.approx(1.0, abs=1e-6)
    found = minimize_scalar(worst, bounds=(0.55, 3.0), method="bounded", options={"xatol": 1e-9})
    assert worst(seconds) <= found.fun + 1e-6
    assert seconds == pytest.approx(found.x, rel=1e-4)


def test_the_formula_in_closed_form() -> None:
    # Mean of a + b T / w over slowest and fastest w: T = 2 (kerf − a) / (b (1/w₁ + 1/w₂)).
    ways = np.array([[20.0, 20.0, 20.0], [20.0, 14.0, 8.0], [np.nan, 5.0, 6.0], [0.3, 0.2, np.nan]])
    low, high = np.nanmin(ways, axis=1), np.nanmax(ways, axis=1)
    wanted = 2.0 * (1.1 - 0.4) / (12.0 * (1.0 / low + 1.0 / high))
    assert seconds_for_kerf(ways, LAWS["sum"], 1.1, 0.1, 200.0) == pytest.approx(wanted, rel=1e-8)


def test_speeds_keep_to_their_bounds() -> None:
    turn = np.linspace(0.0, 20.0, 33)  # about an end: one point stands still
    assert 20.0 / seconds_for_kerf(turn, LAWS["sum"], 1.0, 1.0, 50.0) == pytest.approx(50.0, rel=1e-8)
    assert 20.0 / seconds_for_kerf([20.0, 20.0], LAWS["sum"], 9.0, 4.0, 50.0) == pytest.approx(4.0, rel=1e-8)
    fast = seconds_for_kerf(turn, LAWS["table"], 1.0, 1.0, 500.0)
    assert 20.0 / fast == pytest.approx(40.0, rel=1e-8)
    assert 20.0 / fast <= 40.0, "never beyond the table, not by rounding either"
    with pytest.raises(InvalidInputError, match="must overlap"):
        seconds_for_kerf(turn, LAWS["table"], 1.0, 60.0, 100.0)


def test_moves_without_a_point_that_counts_are_left_open() -> None:
    ways = np.array([[np.nan, np.nan], [0.0, 0.0], [20.0, 20.0]])
    assert np.isnan(seconds_for_kerf(ways, LAWS["sum"], 1.0, 1.0, 100.0)).tolist() == [True, True, False]


def test_a_job_without_a_law_plans_no_times() -> None:
    rods = [rod(100.0), rod(120.0)]
    assert leaf_seconds(CutJob(SurfaceJob()), rods, BLOCK) is None
    job = CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=1.0), kerf=KerfJob(formula="a + b / v", a=0.4, b=12.0))
    assert leaf_seconds(job, rods, BLOCK) == pytest.approx([1.0], rel=1e-8)
    assert leaf_seconds(job, rods[:1], BLOCK).shape == (0,)
