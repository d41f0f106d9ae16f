"""The swept face against designs that are known: a cylinder swept by arcs, an elastica's own cylinder, shifts, the kerf."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.plan import Block
from batten.fabrication.simulation import BlockPath
from batten.fabrication.swept_surface import Distances, distance_to_sweep, simulate_cut

RADIUS, ANGLE, LENGTH, DEEP = 600.0, 0.8, 960.0, 100.0  # the rod is an arc of ±0.8 rad
BLOCK = Block(1, 0, 0, np.array([-250.0, 0.0, 400.0]), np.array([500.0, DEEP, 250.0]))


def tools(curve, side):
    """The tool at an end of a rod in the plane y = 0 of the work frame."""
    x, z = curve.point_at(0.0 if side == "left" else curve.length)
    angle = float(curve.angle_at(0.0 if side == "left" else curve.length))
    out = (np.array([np.cos(angle), 0.0, np.sin(angle)])) * (1.0 if side == "left" else -1.0)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([[0.0, 1.0, 0.0], np.cross(out, [0.0, 1.0, 0.0]), out], axis=1)
    pose[:3, 3] = x, 0.0, z
    return pose


def sweeps_of(curve, places, block=BLOCK, seconds=None, shift=None):
    """Parallel identical rods at work y = places, as a path; the first and the last are no leaves."""
    n = len(places)
    frame = np.linalg.inv(block.work_frame("x"))
    arms = []
    for side in ("left", "right"):
        arm = np.repeat((frame @ tools(curve, side))[None], n, axis=0)
        arm[:, 1, 3] = places
        arms.append(arm)
    if shift is not None:
        arms[0][shift[0], :3, 3] += shift[1]
    labels = ("in", *(f"leaf {i}" for i in range(1, n - 1)), "out")
    leaf = np.array([x.startswith("leaf") for x in labels])
    return BlockPath(block.number, *arms, labels, leaf, np.full(n - 1, 1.0) if seconds is None else seconds)


ARC = Elastica((-RADIUS * np.sin(ANGLE), RADIUS * np.cos(ANGLE)), ANGLE, -1.0 / RADIUS, (0.0, 0.0), LENGTH)
PLACES = [-150.0, -60.0, -30.0, 0.0, 20.0, 60.0, 150.0]


@pytest.fixture(scope="module")
def cylinder(made_surfaces):
    return made_surfaces.cylinder(RADIUS, DEEP)


def test_arcs_sweep_the_cylinder(cylinder):
    done = simulate_cut([sweeps_of(ARC, PLACES)], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=0.0, allowance_mm=1e-6)
    assert done.is_good
    assert done.face.max < 1e-6
    (swept,) = done.blocks
    assert swept.face.points > 1000
    assert done.design.max < 1e-6
    assert swept.design.points > 400
    assert np.abs(swept.points[:, 0]).max() == pytest.approx(250.0, abs=5e-3)  # the border itself is measured


def test_elastica_sweep_their_own_cylinder(made_surfaces):
    """A bent rod with a force in it, against a surface through the same elastica by integration of its equation."""
    curve = Elastica((-400.0, 300.0), 0.35, -0.0012, (1.2e-6, 4.0e-7), LENGTH)
    x = np.linspace(-400.0, 300.0, 1401)
    z = made_surfaces.elastica_heights(x, 300.0, 0.35, -0.0012, (1.2e-6, 4.0e-7))
    surface = made_surfaces.graph(lambda u, v: np.interp(u, x, z) + 0.0 * v, (-300.0, 300.0), (0.0, DEEP), (601, 7), 5)
    done = simulate_cut([sweeps_of(curve, PLACES)], [BLOCK], "x", surface, LENGTH, tolerance_mm=0.01)
    assert done.is_good
    assert done.face.max < 1e-3  # the table of heights is read linearly, 0.5 mm apart
    assert np.percentile(np.abs(done.blocks[0].signed), 50) < 1e-4


def test_a_shifted_design_is_seen_from_both_sides(cylinder):
    shift = np.eye(4)
    shift[2, 3] = -1.5
    done = simulate_cut([sweeps_of(ARC, PLACES)], [BLOCK], "x", cylinder.transformed(shift), LENGTH, tolerance_mm=1.0)
    assert done.failing == (1,)
    signed = done.blocks[0].signed
    slope = np.arcsin(done.blocks[0].points[:, 0] / RADIUS)
    assert np.abs(signed - 1.5 * np.cos(slope)).max() < 2e-3  # above the design; second order in 1.5/600
    assert done.design.max == pytest.approx(1.5, abs=5e-3)


def test_a_target_that_is_off_shows_between_its_neighbours(cylinder):
    """One gripper 3 mm too high at the third leaf: the face there is off, and as it was two leaves away."""
    path = sweeps_of(ARC, PLACES, shift=(3, (0.0, 0.0, 3.0)))
    done = simulate_cut([path], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=0.5)
    worst, place, where = done.blocks[0].worst
    assert not done.is_good
    assert where in ("at leaf 3", "between leaf 2 and leaf 3", "between leaf 3 and leaf 4")
    assert 0.5 < worst < 3.0
    assert abs(place[1] - 50.0) < 20.0
    far = done.blocks[0].points[:, 1] < 50.0 - 31.0
    assert np.abs(done.blocks[0].signed[far]).max() < 1e-6


@pytest.mark.parametrize(("kept", "sign"), [("lower", -1.0), ("upper", 1.0)])
def test_the_face_lies_half_the_kerf_away(cylinder, kept, sign):
    """The kerf by the local speed: 30 mm in 1 s, then 40 mm in 4 s; a parallel sweep has one speed along the rod."""
    path = sweeps_of(ARC, [-150.0, -30.0, 0.0, 40.0, 150.0], seconds=np.array([4.0, 1.0, 4.0, 1.0]))
    seen = []

    def half_kerf(speed):
        seen.append(speed)
        return 10.0 / speed

    done = simulate_cut([path], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=0.1, half_kerf_mm=half_kerf, kept=kept)
    swept = done.blocks[0]
    inner = (swept.areas > 0.0) & (np.abs(swept.points[:, 1] - 35.0) < 14.0)  # within the move of 30 mm/s
    slow = (swept.areas > 0.0) & (np.abs(swept.points[:, 1] - 70.0) < 14.0)
    assert done.half_kerf
    assert np.abs(swept.signed[inner] - sign / 3.0).max() < 2e-4
    assert np.abs(swept.signed[slow] - sign).max() < 2e-4
    assert np.concatenate([s.ravel() for s in seen]).min() == pytest.approx(10.0, rel=1e-3)


def test_a_speed_without_kerf_is_told(cylinder):
    done = simulate_cut(
        [sweeps_of(ARC, PLACES)], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=9.0,
        half_kerf_mm=lambda speed: np.where(speed > 35.0, np.nan, 0.5),
    )  # fmt: skip
    assert done.blocks[0].unknown > 0
    assert done.failing == (1,)
    assert done.face.max == pytest.approx(0.5, abs=1e-3)


def test_blocks_without_a_program_fail(cylinder):
    other = Block(2, 0, 1, np.array([250.0, 0.0, 400.0]), np.array([100.0, DEEP, 250.0]))
    done = simulate_cut([sweeps_of(ARC, PLACES)], [BLOCK, other], "x", cylinder, LENGTH, tolerance_mm=1.0)
    assert (done.without_program, done.failing, done.is_good) == ((2,), (2,), False)
    assert not simulate_cut([], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=1.0).is_good


def test_the_mesh_shows_the_face(cylinder):
    done = simulate_cut([sweeps_of(ARC, PLACES)], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=1.0)
    mesh = done.blocks[0].mesh
    corners = mesh.points[mesh.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(DEEP * 2.0 * RADIUS * np.arcsin(250.0 / RADIUS), rel=1e-4)
    assert np.abs(mesh.signed).max() < 1e-6
    near, _ = cKDTree(mesh.points).query(done.blocks[0].points)
    assert near.max() < 15.0


def test_distances_from_a_sweep_are_those_from_the_surface():
    """A grid on a cone, whose distances are known; points beside its ends are measured from the ends."""
    s, t = np.meshgrid(np.linspace(0.0, 200.0, 41), np.linspace(-0.5, 0.5, 121), indexing="ij")
    radius = 300.0 + 0.5 * s
    grid = np.stack([radius * np.sin(t), s, radius * np.cos(t)], axis=-1)
    rng = np.random.default_rng(8)
    at, angle, off = rng.uniform(20.0, 180.0, 300), rng.uniform(-0.4, 0.4, 300), rng.uniform(-6.0, 6.0, 300)
    slant = np.hypot(1.0, 0.5)
    reach = 300.0 + 0.5 * at + off / slant
    points = np.stack([reach * np.sin(angle), at - 0.5 * off / slant, reach * np.cos(angle)], axis=1)
    assert np.abs(distance_to_sweep(points, grid) - np.abs(off)).max() < 1e-6
    beside = np.array([[0.0, -3.0, 300.0], [0.0, 100.0, 350.0]])
    assert distance_to_sweep(beside, grid) == pytest.approx([3.0, 0.0], abs=1e-6)
    assert np.isinf(distance_to_sweep(points, grid[:1])).all()


def test_distances_count_by_area():
    values, areas = np.array([-3.0, 1.0, 2.0, np.nan]), np.array([1.0, 98.0, 1.0, 50.0])
    d = Distances.of(values, areas)
    assert (d.points, d.max, d.mean, d.percentiles) == (3, 3.0, pytest.approx(1.03), (1.0, 1.0, 2.0))
    assert Distances.of(np.full(2, np.nan), np.ones(2)).points == 0


def test_bad_input_is_named(cylinder):
    path = sweeps_of(ARC, PLACES)
    with pytest.raises(InvalidInputError, match="tolerance_mm = -1"):
        simulate_cut([path], [BLOCK], "x", cylinder, LENGTH, tolerance_mm=-1.0)
    other = Block(3, 0, 0, BLOCK.corner_mm, BLOCK.size_mm)
    with pytest.raises(InvalidInputError, match="cuts block 1; the plan has blocks 3 to 3"):
        simulate_cut([path], [other], "x", cylinder, LENGTH, tolerance_mm=1.0)
