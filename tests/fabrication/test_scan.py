"""Scans whose pose is known are put back where they came from."""

import numpy as np
import pytest

from batten.errors import InvalidInputError, NoSolutionError
from batten.fabrication.scan import ScanDesign, placed, register_scan


@pytest.fixture(scope="module")
def lopsided(made_surfaces):
    """A surface without symmetry, 1200 × 900 mm."""
    return made_surfaces.graph(
        lambda x, y: (
            120.0 * np.sin(x / 260.0) * np.cos(y / 310.0) + 2e-4 * x * y + 60.0 * np.cos(x / 170.0 - y / 230.0)
        ),
        (0.0, 1200.0),
        (0.0, 900.0),
    )


ALL = ((0.0, 0.0), (1200.0, 900.0))


def _miss(found, scan, points):
    return np.linalg.norm(placed(found.pose, scan) - points, axis=1).max()


def test_an_exact_scan_is_put_back_exactly(made_scan, lopsided):
    scan, points, turn, shift = made_scan(lopsided, 5000, ALL, 0.0, stray=0.0)
    found = register_scan(ScanDesign(lopsided), scan)
    assert _miss(found, scan, points) < 1e-5
    assert np.abs(found.pose[:3, :3] - turn).max() < 1e-8
    assert np.abs(found.pose[:3, 3] - shift).max() < 1e-4
    assert found.pose[3].tolist() == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("stray", [0.0, 0.1, 0.3])
def test_noise_holes_and_stray_points_do_not_move_it(made_scan, lopsided, stray):
    scan, points, _, _ = made_scan(lopsided, 30_000, ALL, 0.5, stray=stray)
    found = register_scan(ScanDesign(lopsided), scan)
    assert _miss(found, scan, points) < 5.0 * found.pose_error_mm < 0.5
    assert found.noise_mm == pytest.approx(0.5, rel=0.06)  # a few stray points lie near the surface
    assert found.rival > 1.25  # what is told as ambiguous is below


def test_the_standard_error_is_that_of_many_scans(made_scan, lopsided):
    design = ScanDesign(lopsided)
    turns, errors = [], []
    for seed in range(12):
        scan, points, turn, shift = made_scan(lopsided, 3000, ALL, 0.5, stray=0.0, seed=seed)
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = turn, shift + np.array([3.0, -2.0, 1.0])
        found = register_scan(design, scan, start=start)
        turns.append(np.sqrt(((placed(found.pose, scan) - points) ** 2).sum(axis=1).mean()))
        errors.append(found.pose_error_mm)
    # The worst of six directions against the root mean square of all: of one size, not of another order.
    assert 0.5 * np.mean(errors) < np.sqrt(np.mean(np.square(turns))) < 2.0 * np.mean(errors)


def test_a_part_of_the_design_is_found(made_scan, lopsided):
    window = ((500.0, 150.0), (1050.0, 700.0))
    scan, points, _, _ = made_scan(lopsided, 20_000, window, 0.2)
    found = register_scan(ScanDesign(lopsided), scan)
    assert _miss(found, scan, points) < 0.5
    of_window = register_scan(ScanDesign(lopsided, window), scan)
    assert _miss(of_window, scan, points) < 0.5


def test_points_beyond_the_border_do_not_pull(made_scan, lopsided):
    """The sides of the block are in the scan too."""
    scan, points, turn, shift = made_scan(lopsided, 20_000, ALL, 0.2, stray=0.0, holes=())
    rng = np.random.default_rng(1)
    side = np.stack([np.full(4000, 1200.0), rng.uniform(0.0, 900.0, 4000), rng.uniform(-400.0, -150.0, 4000)], axis=1)
    found = register_scan(ScanDesign(lopsided), np.concatenate([scan, (side - shift) @ turn]))
    assert _miss(found, scan, points) < 0.1


def test_the_example_wall_fits_in_two_ways_and_takes_the_lesser_turn(made_scan, made_surfaces):
    wall = made_surfaces.example_wall()[0]
    _, points, _, _ = made_scan(wall, 20_000, ((0.0, 0.0), (3000.0, 3000.0)), 0.3)
    moved = points + np.array([40.0, -25.0, 12.0])
    found = register_scan(ScanDesign(wall), moved)
    assert found.rival < 1.1
    assert np.linalg.norm(placed(found.pose, moved) - points, axis=1).max() < 0.2


def test_a_plane_leaves_directions_free(made_surfaces):
    flat = made_surfaces.graph(lambda x, y: 0.1 * x, (0.0, 400.0), (0.0, 300.0), degree=1)
    scan = flat.point(*np.meshgrid(np.linspace(40.0, 360.0, 40), np.linspace(40.0, 260.0, 40))).reshape(-1, 3)
    up = np.array([0.0, 0.0, 2.0])
    found = register_scan(ScanDesign(flat), scan + up, start=np.eye(4))
    assert found.pose_error_mm == np.inf
    moved = placed(found.pose, scan + up)
    assert np.abs(moved[:, 2] - 0.1 * moved[:, 0]).max() < 1e-6
    assert np.abs(moved - scan).max() < 2.0  # it did not slide away


def test_what_cannot_be_registered_is_refused(made_scan, lopsided):
    design = ScanDesign(lopsided)
    scan, _, _, _ = made_scan(lopsided, 2000, ALL, 0.0, stray=0.0)
    with pytest.raises(InvalidInputError, match="at least 200"):
        register_scan(design, scan[:100])
    with pytest.raises(InvalidInputError, match="unit"):
        register_scan(design, scan / 1000.0)
    with pytest.raises(InvalidInputError, match=r"\(n, 3\)"):
        register_scan(design, scan[:, :2])
    with pytest.raises(InvalidInputError, match="start"):
        register_scan(design, scan, start=np.diag([1.0, 1.0, -1.0, 1.0]))
    with pytest.raises(InvalidInputError, match="window"):
        _ = ScanDesign(lopsided, ((5000.0, 0.0), (6000.0, 100.0)))
    cloud = np.random.default_rng(0).uniform(-500.0, 500.0, (250, 3))
    with pytest.raises(NoSolutionError, match="fits nowhere"):
        register_scan(design, cloud)
