"""The kerf by formula and table, and the blade's surface half of it beside the design."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from batten.errors import InvalidInputError
from batten.fabrication.cut import plan_cut
from batten.fabrication.job import (
    BladeJob,
    BlocksJob,
    CellJob,
    CutJob,
    GripperJob,
    KerfJob,
    LeavesJob,
    RodJob,
    SurfaceJob,
)
from batten.fabrication.kerf import KerfLaw, blade_offset_mm, blade_surface, fit_blade_to_law, kerf_law, kerf_width_mm

SPEEDS, WIDTHS = (5.0, 10.0, 20.0, 40.0), (2.8, 1.6, 1.0, 0.7)


def table():
    return KerfLaw(SPEEDS, WIDTHS)


# --- the law ---


def test_the_formulas() -> None:
    v = np.array([[0.5, 3.0], [20.0, 700.0]])
    assert KerfLaw(formula="a + b / v", a=0.4, b=12.0).width_mm(v) == pytest.approx(0.4 + 12.0 / v, rel=1e-15)
    assert KerfLaw(formula="a * v^-b", a=6.0, b=0.6).width_mm(v) == pytest.approx(6.0 / v**0.6, rel=1e-14)


@pytest.mark.parametrize(
    "law", [KerfLaw(formula="a + b / v", a=0.4, b=12.0), KerfLaw(formula="a * v^-b", a=6.0, b=0.6), table()]
)
def test_the_speed_for_a_width_is_the_inverse(law) -> None:
    for v in (5.0, 7.3, 10.0, 31.0, 40.0):
        found = law.speed_mm_s(float(law.width_mm(v)))
        assert found == pytest.approx(v, rel=1e-6 if v == 40.0 else 1e-10), "at its end the table is level"
        assert float(law.width_mm(found)) == pytest.approx(float(law.width_mm(v)), rel=1e-12)


def test_a_table_goes_through_its_values_and_falls_between_them() -> None:
    law = table()
    assert law.width_mm(SPEEDS) == pytest.approx(WIDTHS, abs=1e-15)
    fine = law.width_mm(np.linspace(5.0, 40.0, 2001))
    assert (np.diff(fine) < 0.0).all()
    # An ordinary cubic spline through a steep table swings up again; this one does not.
    steep = KerfLaw((1.0, 2.0, 3.0, 40.0), (9.0, 1.0, 0.9, 0.8))
    v = np.linspace(1.0, 40.0, 2001)
    assert (np.diff(steep.width_mm(v)) <= 0.0).all()
    assert (np.diff(CubicSpline((1.0, 2.0, 3.0, 40.0), (9.0, 1.0, 0.9, 0.8))(v)) > 0.0).any()


def test_one_cell_of_a_table_against_the_formulas_of_fritsch_and_carlson() -> None:
    # Slopes by weighted harmonic means of the secants, the weights of which are 2h₁ + h₀ and h₁ + 2h₀.
    h, secants = np.diff(SPEEDS), np.diff(WIDTHS) / np.diff(SPEEDS)
    slopes = [
        (3.0 * (h[k] + h[k + 1])) / ((2.0 * h[k + 1] + h[k]) / secants[k] + (h[k + 1] + 2.0 * h[k]) / secants[k + 1])
        for k in (0, 1)
    ]
    t = (13.0 - 10.0) / 10.0
    basis = [(1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2, t**2 * (3 - 2 * t), t**2 * (t - 1)]
    wanted = basis[0] * 1.6 + basis[1] * 10.0 * slopes[0] + basis[2] * 1.0 + basis[3] * 10.0 * slopes[1]
    assert float(table().width_mm(13.0)) == pytest.approx(wanted, rel=1e-12)


def test_outside_a_table_nothing_is_known() -> None:
    assert np.isnan(table().width_mm([4.999, 40.001, np.nan])).all()
    assert np.isnan(table().speed_mm_s(3.0))
    assert np.isnan(table().speed_mm_s(0.6))


def test_a_formula_at_rest_melts_without_end_and_below_its_least_kerf_has_no_speed() -> None:
    law = KerfLaw(formula="a + b / v", a=0.4, b=12.0)
    assert law.width_mm(0.0) == np.inf
    assert np.isnan(law.width_mm(-1.0))
    assert np.isnan(law.speed_mm_s(0.4))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, "got none of them"),
        ({"speeds_mm_s": SPEEDS}, "got speeds_mm_s;"),
        ({"formula": "a + b / v", "a": 0.4}, "got formula and a;"),
        ({"speeds_mm_s": SPEEDS, "widths_mm": WIDTHS, "a": 1.0}, "needs speeds_mm_s and widths_mm, or formula"),
        ({"speeds_mm_s": SPEEDS, "widths_mm": WIDTHS[:3]}, "with 3 widths"),
        ({"speeds_mm_s": SPEEDS[::-1], "widths_mm": WIDTHS}, "ascending"),
        ({"speeds_mm_s": SPEEDS, "widths_mm": WIDTHS[::-1]}, "must become less"),
        ({"speeds_mm_s": (5.0,), "widths_mm": (1.0,)}, "two or more"),
        ({"formula": "a / v", "a": 1.0, "b": 1.0}, "allowed are"),
        ({"formula": "a * v^-b", "a": 0.0, "b": 1.0}, "a > 0"),
        ({"formula": "a + b / v", "a": 0.4, "b": 0.0}, "b > 0"),
    ],
)
def test_a_law_that_is_none(values, says) -> None:
    with pytest.raises(InvalidInputError, match=says):
        KerfLaw(**values)


# --- in a job ---


def test_without_a_law_the_kerf_is_one_number() -> None:
    job = CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=1.3))
    assert kerf_law(job.kerf) is None
    assert fit_blade_to_law(job.kerf, job.blade) is None
    assert kerf_width_mm(job, [[1.0, 0.0], [1e6, 20.0]]).tolist() == [[1.3, 1.3], [1.3, 1.3]]


def test_with_a_law_the_kerf_follows_from_speed() -> None:
    job = CutJob(SurfaceJob(), kerf=KerfJob(formula="a + b / v", a=0.4, b=12.0))
    assert kerf_width_mm(job, [10.0, 20.0]) == pytest.approx([1.6, 1.0])


def test_a_kerf_that_the_law_does_not_give() -> None:
    kerf = KerfJob(speeds_mm_s=SPEEDS, widths_mm=WIDTHS, tolerance_mm=0.3)
    assert fit_blade_to_law(kerf, BladeJob(kerf_mm=1.25, speed_mm_s=20.0)) is not None
    with pytest.raises(
        InvalidInputError, match=r"kerf_mm = 1\.6, but .* gives 1 mm .*try kerf_mm = 1, or speed_mm_s = 10$"
    ):
        fit_blade_to_law(kerf, BladeJob(kerf_mm=1.6, speed_mm_s=20.0))
    with pytest.raises(InvalidInputError, match=r"try kerf_mm = 1$"):
        fit_blade_to_law(kerf, BladeJob(kerf_mm=4.0, speed_mm_s=20.0))
    with pytest.raises(InvalidInputError, match=r"outside the 5 … 40 mm/s"):
        fit_blade_to_law(kerf, BladeJob(kerf_mm=1.0, speed_mm_s=50.0))
    with pytest.raises(InvalidInputError, match="must be below"):
        kerf_law(KerfJob(min_speed_mm_s=30.0, max_speed_mm_s=20.0))


@pytest.mark.parametrize(
    ("side", "offset", "wanted"), [("lower", True, 0.6), ("upper", True, -0.6), ("lower", False, 0.0)]
)
def test_the_blade_runs_on_the_side_that_is_thrown_away(side, offset, wanted) -> None:
    job = CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=1.2), kerf=KerfJob(side=side, offset=offset))
    assert blade_offset_mm(job) == wanted


@pytest.mark.parametrize("turned_over", [False, True], ids=["normal up", "normal down"])
@pytest.mark.parametrize(("side", "radius"), [("lower", 400.7), ("upper", 399.3)])
def test_the_blades_surface_of_a_cylinder(made_surfaces, side, radius, turned_over) -> None:
    surface = made_surfaces.cylinder(400.0, 600.0)
    if turned_over:
        surface = replace(
            surface, control_points=surface.control_points[:, ::-1], weights=np.asarray(surface.weights)[:, ::-1]
        )
    job = CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=1.4), kerf=KerfJob(side=side))
    swept, extend = blade_surface(job, surface)
    points = swept.point(np.linspace(0.0, 1.0, 21)[:, None], np.linspace(0.0, 1.0, 5))
    assert np.hypot(points[..., 0], points[..., 2]) == pytest.approx(np.full((21, 5), radius), abs=0.005)
    assert extend == 0.0


# --- a whole cut ---


def height(x, y):
    """An arch along x whose height changes along y, on a slope: nothing about it is symmetric."""
    return 90.0 * np.sin((x + 40.0) * np.pi / 700.0) * (1.0 + 0.15 * np.cos(y / 140.0)) + 0.12 * x + 0.25 * y


def distance_below(point, side):
    """Distance of a point from the graph of `height`, by minimisation from its foot; negative on the wrong side."""

    def square(q):
        return (q[0] - point[0]) ** 2 + (q[1] - point[1]) ** 2 + (height(*q) - point[2]) ** 2

    found = minimize(square, point[:2], method="BFGS", options={"gtol": 1e-9})
    return side * np.sign(point[2] - height(*point[:2])) * np.sqrt(found.fun)


@pytest.mark.parametrize(("side", "sign"), [("lower", 1.0), ("upper", -1.0)])
def test_the_face_that_is_left_is_the_design(made_surfaces, side, sign) -> None:
    surface = made_surfaces.graph(height, (0.0, 600.0), (0.0, 240.0), (24, 14))
    kerf, tolerance = 3.0, 0.25
    job = CutJob(
        SurfaceJob(),
        blocks=BlocksJob(size_mm=(600.0, 240.0), direction="u"),
        leaves=LeavesJob(spacing_mm=40.0, tolerance_mm=tolerance, max_turn_between_deg=90.0),
        rod=RodJob(length_mm=1000.0),
        blade=BladeJob(kerf_mm=kerf, max_speed_ratio=100.0),
        kerf=KerfJob(side=side),
        gripper=GripperJob(radius_mm=20.0, clearance_mm=5.0),
        cell=CellJob(min_joint_margin_deg=2.0),
    )
    plan = plan_cut(job, surface)
    deviation = next(c for c in plan.checks if c.name == "deviation")
    assert len(plan.rods) == 7
    assert deviation.passed.all()
    assert deviation.values.max() > 0.02, "not so easy that nothing is tested"
    for rod, value in zip(plan.rods, deviation.values):
        blade = rod.plane.to_world(rod.piece.point_at(np.linspace(0.02, 0.98, 25) * rod.piece.length))
        off = np.array([distance_below(p, sign) for p in blade]) - 0.5 * kerf
        assert np.abs(off).max() <= tolerance
        assert np.abs(off).max() <= value * 1.01 + 1e-4
    # Without the offset the blade itself is the design, and the face is off by half the kerf.
    plain = plan_cut(replace(job, kerf=KerfJob(offset=False)), surface)
    middle = plain.rods[3].plane.to_world(plain.rods[3].piece.point_at(0.5 * plain.rods[3].piece.length))
    assert abs(distance_below(middle, sign)) <= tolerance


def test_a_surface_too_strongly_curved_for_half_the_kerf(made_surfaces) -> None:
    ridged = made_surfaces.graph(lambda x, y: 30.0 * np.cos(x / 8.0), (0.0, 300.0), (0.0, 200.0), (120, 6))
    with pytest.raises(InvalidInputError, match=r"a radius of 2\.1.* the parallel surface folds"):
        blade_surface(CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=6.0)), ridged)
