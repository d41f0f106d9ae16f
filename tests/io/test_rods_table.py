"""rods.csv: a line for every rod that is cut, and enough digits to rebuild the rod from its line."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import least_squares

from batten.curves.elastica import Elastica
from batten.errors import FormatError
from batten.io.rods_table import COLUMNS, read_rods_csv, write_rods_csv


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_the_rods_that_are_cut_and_no_others(tmp_path, make_plan, blade_axis):
    plan, _ = make_plan(rows=2, columns=2, leaves=3, refused=(2,), blade_axis=blade_axis)
    write_rods_csv(tmp_path / "rods.csv", plan)
    rows = read_rods_csv(tmp_path / "rods.csv")
    cut = [r for r in plan.rods if r.status == "ok"]
    assert len(cut) == len(plan.rods) - 2
    assert [(r.block, r.leaf) for r in rows] == [(r.block, r.leaf) for r in cut]
    for row, rod in zip(rows, cut):
        left, right = rod.grippers()
        np.testing.assert_allclose(row.start_mm, left.position_mm, rtol=0, atol=5.1e-7)
        np.testing.assert_allclose(row.end_mm, right.position_mm, rtol=0, atol=5.1e-7)
        np.testing.assert_allclose(row.start_tangent, left.tangent, rtol=0, atol=5.1e-10)
        np.testing.assert_allclose(row.end_tangent, right.tangent, rtol=0, atol=5.1e-10)
        np.testing.assert_allclose(row.plane_normal, left.normal, rtol=0, atol=5.1e-10)
        assert row.length_mm == pytest.approx(rod.rod.length, abs=5.1e-7)
        assert abs(row.start_tangent @ row.plane_normal) < 1e-8
        assert abs((row.end_mm - row.start_mm) @ row.plane_normal) < 1e-5


def test_each_rod_has_the_time_of_the_move_to_it(tmp_path, make_plan):
    plan, _ = make_plan(rows=1, columns=2, leaves=3)
    left = dataclasses.replace(plan.motions[0], planned_s=np.array([1.25, np.nan]))
    plan = dataclasses.replace(plan, motions=(left,))
    write_rods_csv(tmp_path / "rods.csv", plan)
    rows = {(r.block, r.leaf): r.move_s for r in read_rods_csv(tmp_path / "rods.csv")}
    ends = np.array([[g.position_mm for g in plan.rods[i].grippers()] for i in left.rods])
    way = np.linalg.norm(ends[2] - ends[1], axis=-1).max()
    assert rows[1, 2] == 1.25
    assert rows[1, 3] == pytest.approx(way / left.speed_mm_s, abs=5.1e-5)
    # The made-up approach pose is the work frame's origin.
    assert rows[1, 1] == pytest.approx(
        max(np.linalg.norm(arm.poses[0, :3, 3]) for arm in (left.left, left.right)) / left.speed_mm_s, abs=5.1e-5
    )
    assert np.isnan(rows[2, 3]), "it is in no motion"


def rebuilt(row, guess):
    """The elastica in the plane (start, start tangent) that has the row's length, end and end tangent."""
    y_axis = np.cross(row.plane_normal, row.start_tangent)
    chord = row.end_mm - row.start_mm
    end = np.array([chord @ row.start_tangent, chord @ y_axis])
    tangent = np.array([row.end_tangent @ row.start_tangent, row.end_tangent @ y_axis])

    def miss(x):
        rod = Elastica((0.0, 0.0), 0.0, x[0] * 1e-3, x[1:] * 1e-6, row.length_mm)
        angle = rod.angle_at(row.length_mm)
        turn = np.cos(angle) * tangent[1] - np.sin(angle) * tangent[0]
        return np.append(rod.point_at(row.length_mm) - end, 1e3 * turn)

    found = least_squares(miss, guess, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    rod = Elastica((0.0, 0.0), 0.0, found.x[0] * 1e-3, found.x[1:] * 1e-6, row.length_mm)
    points = rod.point_at(np.linspace(0.0, row.length_mm, 41))
    return row.start_mm + points[:, :1] * row.start_tangent + points[:, 1:] * y_axis


def test_a_rod_is_rebuilt_from_its_line_within_a_tenth_of_a_micrometre(tmp_path, make_plan):
    plan, _ = make_plan(rows=1, columns=2, leaves=2)
    straightest = dataclasses.replace(  # a bow of 1 mm over 1 m: κ = 8 h / L²
        plan.rods[0], rod=Elastica((0.0, 0.0), 0.1, 8e-6, (0.0, 2e-9), 1000.0)
    )
    plan = dataclasses.replace(plan, rods=(*plan.rods, straightest))
    write_rods_csv(tmp_path / "rods.csv", plan)
    for row, rod in zip(read_rods_csv(tmp_path / "rods.csv"), plan.rods):
        turn = rod.rod.start_angle
        back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        force = back @ rod.rod.force
        mirror = np.sign(row.plane_normal @ rod.plane.normal)  # the table's normal is the way of the sweep
        guess = np.array([mirror * rod.rod.start_curvature * 1e3, force[0] * 1e6, mirror * force[1] * 1e6]) * 1.05
        wanted = rod.plane.to_world(rod.rod.point_at(np.linspace(0.0, rod.rod.length, 41)))
        assert np.abs(rebuilt(row, guess) - wanted).max() < 1e-4


def test_a_table_that_is_none_is_named(tmp_path):
    path = tmp_path / "rods.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(FormatError, match=r"rods\.csv:1: must be the columns block,leaf,start_x_mm"):
        read_rods_csv(path)
    path.write_text(",".join(COLUMNS) + "\n1,2,3\n")
    with pytest.raises(FormatError, match=r"rods\.csv:2: must be 19 numbers"):
        read_rods_csv(path)
