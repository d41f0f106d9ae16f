"""Faces in pieces of elastica: known numbers of blocks, distances measured another way, seams, straight rods, what fails."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from batten.curves.elastica import states_along
from batten.errors import InvalidInputError
from batten.fabrication.job import GripperJob, RodJob
from batten.fabrication.patch_pieces import piece_points
from batten.fabrication.patch_search import PatchDecision
from batten.fabrication.rationalisation import rationalise_faces
from batten.fabrication.rationalise_job import (
    FacesJob,
    GreatestBlocksJob,
    PatchesJob,
    PatchLeavesJob,
    RationaliseJob,
)
from batten.io.rhino import read_surface
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.face import Face

WALL = Path(__file__).parents[2] / "examples/freeform-wall/freeform-surface.3dm"


def job(greatest=(600.0, 400.0), rod=None, names=None, **leaves):
    return RationaliseJob(
        "a job",
        Path("job.toml"),
        FacesJob(Path("faces.3dm"), names=names),
        GreatestBlocksJob(greatest),
        PatchLeavesJob(**({"spacing_mm": 40.0, "tolerance_mm": 0.5} | leaves)),
        PatchesJob(),
        rod or RodJob(length_mm=900.0, diameter_mm=1.0, min_bow_mm=2.0),
        GripperJob(25.0, 10.0),
    )


def arch(made_surfaces):
    """A cylinder over an elastica, 500 × 300 mm, turned in space."""
    x = np.linspace(0.0, 500.0, 161)
    y = made_surfaces.elastica_heights(x, 0.0, 0.6, -3e-3, (1.2e-5, 4e-6))
    surface = made_surfaces.graph(lambda u, v: np.interp(u, x, y) + 0.0 * v, (0, 500), (0, 300), n=(161, 6))
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    pose[:3, 3] = 1e3, 2e3, -5e2
    return Face(surface.transformed(pose), name="arch")


@pytest.fixture(scope="module")
def arch_plan(made_surfaces):
    return rationalise_faces(job(direction_deg=0.0), [arch(made_surfaces)])


def test_a_cylinder_over_an_elastica_is_one_block_and_hardly_off(arch_plan):
    (plan,) = arch_plan.patches
    assert arch_plan.is_good
    assert len(plan.blocks) == 1
    assert plan.deviation.greatest_mm < 0.02  # the heights' own share of the tolerance is 0.01
    assert plan.patch.error <= 0.01
    assert plan.straight == 0
    assert arch_plan.seams == ()


def test_distances_are_those_to_dense_points_of_the_face(arch_plan, made_surfaces):
    """By a search tree over the face, on a plan whose pieces are shifted by 0.3 mm so that there is something to see."""
    (plan,) = arch_plan.patches
    face = arch(made_surfaces)
    u, v = np.meshgrid(np.linspace(0, 500, 2001), np.linspace(0, 300, 601), indexing="ij")
    tree = cKDTree(face.surface.point(u, v).reshape(-1, 3))
    inner = (np.abs(plan.deviation.points[:, :2]) < 0.45 * np.array([480.0, 300.0])).all(axis=1)
    points = plan.deviation.points[inner][::7]
    frame = plan.block_frame
    found = tree.query(points @ frame[:3, :3].T + frame[:3, 3])[0]
    spacing = 0.5 * np.hypot(0.25 / np.cos(0.7), 0.5)  # no slope of the arch is above 0.7 rad
    assert (found >= np.abs(plan.deviation.signed_mm[inner][::7]) - 1e-9).all()
    assert np.sqrt(np.maximum(found**2 - spacing**2, 0.0)).max() <= plan.deviation.greatest_mm + 1e-9


def test_the_planned_surface_goes_through_the_pieces(arch_plan):
    (plan,) = arch_plan.patches
    points = piece_points(plan.family, plan.columns.chains)[plan.used].reshape(-1, 3)
    low, high = (np.array(d)[:, k] for d, k in ((plan.planned.domain, 0), (plan.planned.domain, 1)))
    points = points[((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1)]
    miss = np.abs(plan.planned.point(points[:, 0], points[:, 1])[:, 2] - points[:, 2]).max()
    assert miss <= plan.planned_error_mm + 1e-9
    assert plan.planned_error_mm < 0.02


def test_strain_and_bow_are_those_of_the_rods(arch_plan):
    (plan,) = arch_plan.patches
    piece = plan.columns.chains.parameters[2, 0]
    s = np.linspace(-0.5 * (900.0 - piece[6]), 0.5 * (900.0 + piece[6]), 4001)
    x, y, _, curvature = states_along(piece[None], s[None])[0].T
    assert plan.strain == pytest.approx(0.5 * np.abs(curvature).max(), rel=0.02)  # Ø 1 mm
    chord = np.array([x[-1] - x[0], y[-1] - y[0]]) / np.hypot(x[-1] - x[0], y[-1] - y[0])
    assert plan.least_bow_mm == pytest.approx(np.abs((x - x[0]) * chord[1] - (y - y[0]) * chord[0]).max(), rel=0.02)


@pytest.mark.parametrize("direction", ["auto", 0.0])
def test_a_saddle_is_cut_off_its_rulings_and_a_wire_along_them(direction, made_surfaces):
    """z = x y / 900: straight along x and y, a parabola anywhere else."""
    face = Face(made_surfaces.graph(lambda x, y: x * y / 900.0, (-200, 200), (-200, 200), n=(8, 8)))
    found = rationalise_faces(job(direction_deg=direction, turn_deg=0.0), [face])
    (plan,) = found.patches
    assert plan.wires.blocks == 1
    if direction == "auto":
        assert found.is_good
        assert abs(np.sin(2.0 * plan.family.angle)) > 0.2
        assert plan.wires.same_blocks_mm > 10.0 * plan.deviation.greatest_mm
    else:
        assert plan.straight == plan.pieces
        assert any("snap" in text for text in plan.problems)


@pytest.mark.slow
def test_a_turn_clears_the_straight_borders_of_the_wall():
    """The example wall: straight along its borders, 25 blocks of 600 mm, and a wire needs four times as many."""
    face = Face(read_surface(WALL, 300.0))
    rod = RodJob(length_mm=1100.0, min_bow_mm=2.0)
    found = rationalise_faces(job((600.0, 600.0), rod, direction_deg=0.0, spacing_mm=25.0, tolerance_mm=2.5), [face])
    (plan,) = found.patches
    assert found.is_good
    assert len(plan.blocks) == 25
    assert 0.0 < abs(np.degrees(plan.family.turn)) < 10.0
    assert plan.least_bow_mm >= 2.0
    assert plan.deviation.greatest_mm <= 2.5
    assert plan.wires.blocks > 60
    assert plan.jump_mm < 1e-9
    assert plan.jump_rad < 1e-9


def test_two_patches_meet_at_a_seam_without_a_crease(made_surfaces):
    """Half a tube is divided along its top; the seam is as long as the tube, and both cuts end next to it."""
    w = np.sqrt(0.5)
    net = [[(x, y, z) for y in (0.0, 350.0)] for x, z in ((300, 0), (300, 300), (0, 300), (-300, 300), (-300, 0))]
    tube = BSplineSurface([0, 0, 0, 1, 1, 2, 2, 2], [0, 0, 1, 1], 2, 1, net, [[v, v] for v in (1.0, w, 1.0, w, 1.0)])
    found = rationalise_faces(job(direction_deg=0.0, turn_deg=0.0), [Face(tube)])
    assert [p.number for p in found.patches] == [1, 2]
    (seam,) = found.seams
    assert (seam.first, seam.second) == (1, 2)
    assert seam.length_mm == pytest.approx(350.0, rel=0.02)
    assert seam.crease_rad < 1e-6
    assert seam.gap_mm <= 2.0 * 0.5  # the tolerance on either side


def test_decisions_are_taken_over(made_surfaces, arch_plan):
    """A plan made from a kept decision is the same, and nothing is searched."""
    (plan,) = arch_plan.patches
    w = plan.wires
    numbers = [w.blocks, w.angle, w.same_count_mm, w.same_blocks_mm, w.step_mm, w.kink_rad]
    decision = PatchDecision(
        np.array(0.0), np.array(0.0), plan.columns.borders, np.array(1.0), np.zeros((0, 4)), np.array(numbers)
    )
    again = rationalise_faces(job(direction_deg=0.0), [arch(made_surfaces)], kept=lambda number, decide: decision)
    assert again.patches[0].deviation.greatest_mm == plan.deviation.greatest_mm
    assert again.patches[0].wires == plan.wires


def test_what_the_rod_cannot_do_is_said(made_surfaces):
    thick = RodJob(length_mm=900.0, diameter_mm=12.0, max_strain=0.002)
    found = rationalise_faces(job(rod=thick, direction_deg=0.0), [arch(made_surfaces)])
    assert not found.is_good
    assert any("thinner rod" in text for text in found.patches[0].problems)


@pytest.mark.parametrize(("faces", "names", "said"), [(False, None, "no faces"), (True, ("roof",), "'arch'")])
def test_faces_that_are_not_there(faces, names, said, made_surfaces):
    with pytest.raises(InvalidInputError, match=said):
        rationalise_faces(job(names=names), [arch(made_surfaces)] if faces else [])
