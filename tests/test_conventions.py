"""docs/conventions.md, held by computation."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipj

import batten
from batten import CubicBezier, Elastica, Polyline, Similarity
from batten.fabrication.block_motions import move_blocks
from batten.fabrication.job import BlocksJob, CutJob, KerfJob, SurfaceJob
from batten.fabrication.plan import Block, CheckResult, RodPlacement
from batten.fabrication.robot.cell import cell_preset, pose_from_xyz
from batten.fabrication.robot.motion import grip_poses
from batten.fabrication.robot.spin_choice import spun
from batten.fabrication.wall import Wall
from batten.solvers.bezier_projection import STATUS as BEZIER_STATUS
from batten.solvers.boundary_value import STATUS as BOUNDARY_STATUS
from batten.solvers.elastica_fit import STATUS
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.foliation import parallel_planes
from batten.surfaces.plane import Plane

ROOT = Path(__file__).parents[1]
HALF_TURN_LEFT = Elastica((0, 0), 0.0, 1.0, (0, 0), math.pi)  # unit circle about (0, 1)
WAVE = Elastica((0.3, -0.2), 0.7, -1.1, (2.0, 1.5), 2.3)
CUBIC = np.array([(0.0, 0.0), (0.2, 0.9), (0.8, 0.5), (1.0, 0.1)])
OTHER = np.array([(0.0, 0.1), (0.3, 0.8), (0.7, 0.6), (1.1, 0.0)])


def flat_wall(blade_axis):
    """2 × 1.2 m of plane wall in blocks of at most 600 mm."""
    corners = [[(0.0, 0.0, 5.0), (0.0, 1200.0, 5.0)], [(2000.0, 0.0, 5.0), (2000.0, 1200.0, 5.0)]]
    surface = BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, corners)
    return Wall.of(surface, (600.0, 600.0), blade_axis)


def placement(blade_axis):
    """A rod over a plane of a leaf, bent a little."""
    plane = parallel_planes(blade_axis, [100.0])[0]
    piece = Elastica((0.0, 0.0), 0.2, -0.001, (0, 0), 500.0)
    return RodPlacement(1, 1, plane, piece.point_at([0.0, 250.0, 500.0]), piece, piece.extended(100, 100), 100.0)


# The plane


def test_angles_are_radians_counter_clockwise():
    assert Elastica((0, 0), math.pi / 2, 0, (0, 0), 1.0).point_at(1.0) == pytest.approx([0.0, 1.0], abs=1e-15)
    assert Similarity(rotation=math.pi / 2).apply([1.0, 0.0]) == pytest.approx([0.0, 1.0], abs=1e-15)


def test_tangent_angles_count_turns():
    three_turns = Elastica((0, 0), 4 * math.pi, 1.0, (0, 0), 6 * math.pi)
    assert three_turns.angle_at([0.0, 3 * math.pi, 6 * math.pi]) == pytest.approx(np.pi * np.array([4, 7, 10]))
    loops = Elastica((0, 0), 0.0, 3.0, (1.0, 0.0), 20.0)  # q² > λ: it never turns back
    angle = loops.angle_at(np.linspace(0, 20, 2001))
    assert (np.diff(angle) > 0).all()
    assert angle[-1] > 12 * math.pi


def test_a_left_turn_has_positive_curvature():
    assert HALF_TURN_LEFT.point_at(math.pi / 2) == pytest.approx([1.0, 1.0])  # to the left of its first tangent
    assert (HALF_TURN_LEFT.curvature_at([0.0, 1.0]) == 1.0).all()
    left = CubicBezier([(0, 0), (1, 0), (2, 1), (2, 2)])
    assert left.curvature(0.5) > 0 > left.reversed().curvature(0.5)
    assert batten.multipliers(left).alpha > 0


def test_s_is_arc_length_and_t_a_fraction():
    s = np.linspace(0.0, WAVE.length, 20001)
    assert np.hypot(*np.diff(WAVE.point_at(s), axis=0).T).sum() == pytest.approx(WAVE.length, rel=1e-8)
    assert WAVE.point(0.25) == pytest.approx(WAVE.point_at(0.25 * WAVE.length))
    assert Polyline([(0, 0), (1, 0), (1, 3)]).point(0.5) == pytest.approx([1.0, 1.0])
    uneven = CubicBezier([(0, 0), (0, 0.1), (0, 0.2), (0, 3)])
    assert uneven.point(0.5)[1] < 0.25 * uneven.length


# The elastica


def test_the_equation_of_the_elastica():
    h, s = 1e-4, np.linspace(0.1, 2.2, 7)
    second = (WAVE.angle_at(s + h) - 2 * WAVE.angle_at(s) + WAVE.angle_at(s - h)) / h**2
    theta, (l1, l2) = WAVE.angle_at(s), WAVE.force
    assert second + l1 * np.sin(theta) - l2 * np.cos(theta) == pytest.approx(0.0, abs=1e-6)


def test_the_seven_numbers_in_order():
    assert WAVE.parameters.tolist() == [0.3, -0.2, 0.7, -1.1, 2.0, 1.5, 2.3]
    assert Elastica.from_parameters(WAVE.parameters) == WAVE


def test_curvature_is_affine_in_position():
    s = np.linspace(0.0, 2.3, 24)
    run = WAVE.point_at(s) - WAVE.start
    cross = run[:, 0] * WAVE.force[1] - run[:, 1] * WAVE.force[0]
    angle = np.unwrap(np.arctan2(*WAVE.derivative(np.linspace(0, 1, 2301)).T[::-1]))
    measured = np.gradient(angle, 0.001)[100:-100:100]
    assert WAVE.start_curvature + cross == pytest.approx(WAVE.curvature_at(s), abs=1e-13)
    assert measured == pytest.approx((WAVE.start_curvature + cross)[1:-1], abs=1e-5)


def test_a_compressed_rod_is_pushed_from_its_start_to_its_end():
    # Euler's strut between hinges, bent a little: P = EI (π/L)², from either support towards the other.
    strut = Elastica((0, 0), 1e-3, 0.0, (math.pi**2, 0.0), 1.0)
    assert strut.point_at(1.0) == pytest.approx([1.0, 0.0], abs=1e-6)
    assert strut.force @ (strut.point_at(1.0) - strut.start) > 0


@pytest.mark.parametrize("k", [0.3, 0.8])
def test_the_modulus_is_k_and_not_m(k):
    s0, scale = 0.4, 2.5
    e = Elastica.from_modulus(k, s0, 1.3, scale=scale, rotation=0.6, origin=(1.0, 2.0))
    cn = ellipj(s0 + np.array([0.0, 1.3]), k * k)[1]  # scipy takes m = k²
    assert e.curvature_at([0.0, e.length]) == pytest.approx(2 * k * cn / scale)
    assert e.force == pytest.approx(np.array([math.cos(0.6), math.sin(0.6)]) / scale**2)
    assert e.length == pytest.approx(1.3 * scale)
    assert e.to_modulus().k == pytest.approx(k)


def test_lines_and_circles_have_no_force():
    assert (batten.initial_elastica(CubicBezier([(0, 0), (1, 1), (2, 2), (3, 3)])).elastica.force == 0).all()
    assert (batten.initial_elastica(HALF_TURN_LEFT).elastica.force == 0).all()
    line = Elastica((0, 0), 0.0, 0.0, (3.0, 0.0), 1.0)  # a straight rod under an axial load
    assert line.point_at(1.0) == pytest.approx([1.0, 0.0], abs=1e-15)
    assert math.isinf(HALF_TURN_LEFT.to_modulus().k)


def test_reversal_changes_the_signs():
    back = WAVE.reversed()
    assert back.force == pytest.approx(-WAVE.force)
    assert back.curvature_at(0.3) == pytest.approx(-WAVE.curvature_at(WAVE.length - 0.3))
    assert math.cos(back.start_angle - WAVE.angle_at(WAVE.length)) == pytest.approx(-1.0)


# Measures


def test_bending_energy_has_no_factor_one_half():
    circle = Elastica((0, 0), 0.0, 2.0, (0, 0), math.pi)  # radius ½: ∫κ² = 4 · π
    assert batten.bending_energy(circle) == pytest.approx(4 * math.pi)
    assert circle.bending_energy() * circle.length == pytest.approx(4 * math.pi**2)


def test_measures_are_scale_free():
    moved = Similarity(scale=170.0, rotation=2.0, translation=(-40.0, 900.0))
    for measure in (batten.lambda_residual, batten.curvature_residual, batten.basic_length):
        assert measure(moved.apply(CUBIC)) == pytest.approx(measure(CUBIC), rel=1e-5)
    for distance in (batten.l2_distance, batten.h1_distance):
        assert distance(moved.apply(CUBIC), moved.apply(OTHER)) == pytest.approx(distance(CUBIC, OTHER), rel=1e-9)
    fit, same = (batten.fit_elastica(c, metric="H1") for c in (CUBIC, moved.apply(CUBIC)))
    assert same.distance == pytest.approx(fit.distance, rel=1e-8)
    assert batten.lambda_residual([(0, 0), (1, 2), (2, 4), (3, 6)]) == 0.0


def test_basic_length_is_the_square_of_ell():
    e = Elastica.from_modulus(0.7, 0.2, 1.9, scale=3.0)
    assert math.sqrt(batten.basic_length(e)) == pytest.approx(1.9, rel=1e-6)


def test_multipliers_of_an_elastica_are_its_force():
    found = batten.multipliers(WAVE)
    assert [found.lambda_1, found.lambda_2] == pytest.approx(WAVE.force.tolist(), rel=1e-9)
    x, y = WAVE.start
    assert found.alpha == pytest.approx(WAVE.start_curvature + found.lambda_1 * y - found.lambda_2 * x)


def test_distances_have_the_papers_units():
    line, above = (np.stack([[0.0, 4 / 3, 8 / 3, 4.0], [h] * 4], axis=1) for h in (0.0, 2.0))
    assert batten.l2_distance(line, above) == pytest.approx(math.sqrt(2.0**2 * 4 / 4**3))
    turned = Similarity(rotation=0.3).apply(line)
    square = batten.l2_distance(line, turned) ** 2 + 0.3**2
    assert batten.h1_distance(line, turned) == pytest.approx(math.sqrt(square))
    for distance in (batten.l2_distance, batten.h1_distance):
        assert distance(line, turned, normalised=False) == pytest.approx(4**1.5 * distance(line, turned))
    assert batten.hausdorff_distance(line, above) == pytest.approx(2.0, rel=1e-5)
    assert batten.hausdorff_distance(line, above, normalised=True) == pytest.approx(0.5, rel=1e-5)


def test_residuals_of_the_first_guess():
    curve = CubicBezier(CUBIC)
    guess = batten.initial_elastica(curve)
    assert guess.r1 == pytest.approx(batten.lambda_residual(CUBIC), rel=1e-5)
    assert guess.r4 == pytest.approx(batten.l2_distance(curve, guess.elastica), rel=1e-6)
    # R₂ and R₃ as Brander2016 §3–4 writes them, by the midpoint rule.
    t = (np.arange(20000) + 0.5) / 20000
    (x, y), velocity = curve.point(t).T, curve.derivative(t)
    speed = np.hypot(*velocity.T)
    weight = speed / speed.sum()
    l1, l2, alpha = batten.multipliers(CUBIC)
    lam = math.hypot(l1, l2)
    u = (l2 * x - l1 * y) / lam
    sine = velocity @ [l1, l2] / (lam * speed)
    beta = weight @ (sine - 0.5 * lam * u**2 - alpha * u)
    assert guess.r2 == pytest.approx(math.sqrt(weight @ (sine - 0.5 * lam * u**2 - alpha * u - beta) ** 2), rel=1e-4)
    half_width = math.sqrt(alpha**2 - 2 * lam * (beta - 1)) / lam
    assert alpha**2 - 2 * lam * (beta + 1) < 0  # inflections: from −α/λ − δ₋/λ to −α/λ + δ₋/λ
    outside = weight[np.abs(u + alpha / lam) > half_width].sum()
    assert guess.r3 == pytest.approx(outside, abs=0.03)  # it counts whole nodes of the quadrature


# Batches and status


def test_status_codes():
    assert [text.split()[0] for text in STATUS] == ["converged", "iteration", "end", "bad"]
    bad = CUBIC.copy()
    bad[2, 1] = np.nan
    fits = batten.fit_elastica_batch([CUBIC, bad, OTHER])
    assert fits.status.tolist() == [0, 3, 0]
    assert np.isfinite(fits.parameters).all(axis=1).tolist() == [True, False, True]
    assert fits.distance[0] == pytest.approx(batten.fit_elastica(CUBIC).distance)
    line = batten.initial_elastica(CubicBezier([(0, 0), (1, 0), (2, 0), (3, 0)]))
    words = (line.status, batten.initial_elastica(HALF_TURN_LEFT).status, batten.initial_elastica(WAVE).status)
    assert words == ("line", "circle", "elastica")
    solved = batten.solve_boundary_batch((0, 0), 0.0, [(0.8, 0), (0.8, 0), (1.2, 0)], [0.0, np.nan, 0.0], 1.0)
    assert [BOUNDARY_STATUS[i] for i in solved.status] == ["found", "bad input", "length below the chord"]
    assert solved.count.tolist() == [2, 0, 0]
    assert np.isnan(solved.parameters[1]).all()
    assert (solved.inflections[1] == -1).all()
    moved = batten.project_bezier([CUBIC, bad, np.zeros((4, 2))])
    assert [BEZIER_STATUS[i] for i in moved.status][1:] == ["not finite", "degenerate"]
    assert np.isnan(moved.control_points).all(axis=(1, 2)).tolist() == [False, True, True]


# Rods between two ends


def test_end_angles_are_real_numbers():
    for turns in (0, 1, -1):
        for shape in batten.solve_boundary((0, 0), 0.3, (0.4, 0.1), 0.5 + 2 * np.pi * turns, 1.0):
            assert shape.rotation_number == pytest.approx(turns + 0.2 / (2 * np.pi), abs=1e-9)
    pinned = batten.solve_boundary((0, 0), None, (0.8, 0), None, 1.0, max_inflections=0)
    assert all(np.abs(s.elastica.curvature_at([0.0, 1.0])).max() < 1e-9 for s in pinned)
    bent = batten.solve_boundary((0, 0), 0.3, (0.8, 0), None, 1.0, end_curvature=1.5)
    assert all(s.elastica.curvature_at(1.0) == pytest.approx(1.5, abs=1e-9) for s in bent)


def test_a_pose_in_six_numbers():
    pose = [1.0, 2.0, 0.3, 1.7, 2.1, -0.2]
    (state,) = batten.track_boundary([pose], 1.0)
    ends, angles = state.elastica.point_at([0.0, 1.0]), state.elastica.angle_at([0.0, 1.0])
    assert [*ends[0], angles[0], *ends[1], angles[1]] == pytest.approx(pose, abs=1e-10)


def test_margins_above_one_hold():
    column = batten.Elastica((0, 0), 0.0, 0.0, (np.pi**2, 0), 0.9)
    assert batten.stability(column, "pinned").margin == pytest.approx(1 / 0.9)
    assert batten.stability(column, "clamped").margin == pytest.approx(2 / 0.9)
    assert batten.stability(column, "clamped-pinned").margin == batten.stability(column, "pinned-clamped").margin
    assert batten.stability(HALF_TURN_LEFT).margin == np.inf
    for margin, stable in ((1.1, True), (0.9, False)):
        rod = batten.Elastica((0, 0), 0.0, 0.0, ((2 * np.pi / margin) ** 2, 0), 1.0)
        assert (batten.stability(rod).margin, batten.stability(rod).stable) == (pytest.approx(margin), stable)


# Frames


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_the_plane_of_a_leaf(blade_axis):
    plane = parallel_planes(blade_axis, [100.0])[0]
    assert plane.x_axis.tolist() == ([1, 0, 0] if blade_axis == "x" else [0, 1, 0])
    assert plane.y_axis.tolist() == [0, 0, 1]
    assert plane.normal == pytest.approx(np.cross(plane.x_axis, plane.y_axis))
    assert plane.to_world([7.0, 3.0]).tolist() == ([7, 100, 3] if blade_axis == "x" else [100, 7, 3])


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_the_work_frame(blade_axis):
    block = Block(1, 0, 0, np.array([100.0, 200.0, 300.0]), np.array([600.0, 500.0, 400.0]))
    frame = block.work_frame(blade_axis)
    wall = flat_wall(blade_axis)
    first, second = wall.planes(100.0, 0.0)[:2]
    assert frame[:3, 3].tolist() == [400.0, 450.0, 300.0]
    assert frame[:3, 0] == pytest.approx(first.x_axis)  # along the blade
    sweep = second.origin - first.origin
    assert frame[:3, 1] == pytest.approx(sweep / np.linalg.norm(sweep))
    assert np.cross(frame[:3, 0], frame[:3, 1]) == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_gripper_frames(blade_axis):
    rod = placement(blade_axis)
    left, right = rod.grippers()
    along = rod.plane.x_axis
    assert left.position_mm @ along < right.position_mm @ along  # the left arm holds the start
    for gripper in (left, right):
        assert gripper.tangent @ along > 0  # from left to right for both
        assert gripper.normal == pytest.approx(-rod.plane.normal)
        assert gripper.normal == pytest.approx(Block(1, 0, 0, np.zeros(3), np.ones(3)).work_frame(blade_axis)[:3, 1])
    turned = right.tangent @ np.array([0, 0, 1]) - left.tangent @ np.array([0, 0, 1])
    assert turned < 0  # it bends to the right, downwards


def test_the_tool_points_into_the_rod():
    rod = placement("x")
    middle = rod.plane.to_world(rod.rod.point(0.5))
    for gripper, side in zip(rod.grippers(), ("left", "right")):
        pose = grip_poses(gripper.position_mm, gripper.tangent, gripper.normal, side)
        assert pose[:3, 3] == pytest.approx(gripper.position_mm)
        assert pose[:3, 2] == pytest.approx(gripper.tangent if side == "left" else -gripper.tangent)
        assert pose[:3, 2] @ (middle - pose[:3, 3]) > 0  # out of the gripper, into the rod
        assert pose[:3, 0] == pytest.approx(gripper.normal)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
        quarter = spun(pose, np.array(math.pi / 2))
        assert quarter[:3, 0] == pytest.approx(pose[:3, 1])  # counter-clockwise about z
        assert quarter[:3, 2:] == pytest.approx(pose[:3, 2:])


def test_turns_are_about_fixed_axes():
    pose = pose_from_xyz((1, 2, 3), (90, 0, 90))
    assert pose[:3, :3] @ [0, 1, 0] == pytest.approx([0, 0, 1])  # y → z by the first turn, z stays in the second
    assert pose[:3, :3] @ [1, 0, 0] == pytest.approx([0, 1, 0])
    assert (pose @ [0, 0, 0, 1])[:3].tolist() == [1, 2, 3]


# Numbers of things


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_blocks_are_numbered_along_the_blade(blade_axis):
    blocks = flat_wall(blade_axis).blocks(BlocksJob(clearance_mm=50.0))
    columns = 4 if blade_axis == "x" else 2
    assert [b.number for b in blocks] == list(range(1, len(blocks) + 1))
    assert [(b.row, b.column) for b in blocks] == [divmod(i, columns) for i in range(len(blocks))]
    along = 0 if blade_axis == "x" else 1
    assert [b.corner_mm[along] for b in blocks[:columns]] == [600.0 * i for i in range(columns)]
    assert {b.size_mm[2] for b in blocks} == {100.0}


def test_motions_stand_in_the_order_of_cutting():
    blocks = flat_wall("x").blocks(BlocksJob(clearance_mm=150.0))
    rods = []
    for leaf, block in enumerate(blocks, start=1):
        middle = block.corner_mm + 0.5 * block.size_mm
        plane = Plane(middle, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        half = 0.5 * block.size_mm[0]
        piece = Elastica((-half, 0.0), 0.0, 0.0, (0.0, 0.0), 2.0 * half)
        points = piece.point_at(np.linspace(0.0, piece.length, 5))
        rods.append(RodPlacement(block.number, leaf, plane, points, piece, piece.extended(150.0, 150.0), 150.0))
    job = CutJob(SurfaceJob(), blocks=BlocksJob(order="serpentine"), kerf=KerfJob(offset=False))
    motions = move_blocks(job, cell_preset("two-irb6620"), blocks, rods, "x", lambda stage, done, of: None)
    assert [m.block for m in motions] == [1, 2, 3, 4, 8, 7, 6, 5]
    assert all(rods[i].block == m.block for m in motions for i in m.rods)


@pytest.mark.parametrize("blade_axis", ["x", "y"])
def test_leaves_are_numbered_the_way_of_the_sweep(blade_axis):
    wall = flat_wall(blade_axis)
    planes = wall.planes(100.0, 0.0)
    place = [p.origin[1] if blade_axis == "x" else -p.origin[0] for p in planes]
    assert (np.diff(place) > 0).all()
    leaf, block = wall.crossings(planes, wall.blocks(BlocksJob()))
    rows = np.array([b.row for b in wall.blocks(BlocksJob())])[block]
    on_border = [i for i in np.unique(leaf) if len(set(rows[leaf == i])) == 2]
    assert len(on_border) == len(wall.rows) - 2  # each border between two rows is cut in both


def test_planes_turn_counter_clockwise():
    for blade_axis in ("x", "y"):
        straight, turned = (flat_wall(blade_axis).planes(100.0, turn)[0] for turn in (0.0, 0.1))
        x0, y0, x1, y1 = *straight.x_axis[:2], *turned.x_axis[:2]
        assert math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1) == pytest.approx(0.1)
        middle = np.mean([p.origin for p in flat_wall(blade_axis).planes(100.0, 0.1)], axis=0)
        assert middle[:2] == pytest.approx([1000.0, 600.0])


def test_a_fan_turns_most_in_the_middle():
    for blade_axis in ("x", "y"):
        wall = flat_wall(blade_axis)
        straight = wall.planes(100.0, 0.0)[0].x_axis[:2]
        for turn in (0.2, -0.2):
            planes = wall.planes(100.0, turn, 0.05)
            turns = [math.asin(straight[0] * p.x_axis[1] - straight[1] * p.x_axis[0]) for p in planes]
            middle = max(range(len(planes)), key=lambda i: abs(turns[i]))
            assert [turns[0], turns[middle], turns[-1]] == pytest.approx([turn / 4, turn, turn / 4])
            assert planes[middle].signed_distance([1000.0, 600.0, 0.0]) == pytest.approx(0.0, abs=1e-9)


def test_signed_distance_is_positive_on_the_side_of_the_normal():
    flat = BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, [[(0, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0)]])
    assert surface_deviation(flat, [0.5, 0.5, 0.2]).signed == pytest.approx(0.2)  # x × y = z
    assert Plane((0, 0, 0), (1, 0, 0), (0, 1, 0)).signed_distance([5.0, 5.0, 0.2]) == pytest.approx(0.2)


def test_margins_are_positive_on_the_good_side():
    most = CheckResult("a", "A", "mm", 2.0, "max", np.array([1.5, 2.5, np.nan]))
    least = CheckResult("b", "B", "mm", 2.0, "min", np.array([1.5, 2.5, np.nan]))
    assert most.margins[:2].tolist() == [0.5, -0.5]
    assert least.margins[:2].tolist() == [-0.5, 0.5]
    assert most.passed.tolist() == [True, False, True]
    assert (most.worst, least.worst) == (1, 0)


def test_the_page_names_tests_that_exist():
    named = re.findall(r"`(test_\w+)`", (ROOT / "docs/conventions.md").read_text("utf-8"))
    here = {name for name in globals() if name.startswith("test_")} - {"test_the_page_names_tests_that_exist"}
    assert set(named) == here
