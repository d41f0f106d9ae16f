"""The study of connected components: floods against another flood, symmetry, volume, necks; and that it can say no."""

import dataclasses

import numpy as np
import pytest
from scipy import ndimage

from batten.errors import InvalidInputError
from batten.measures.lambda_residual import lambda_residual
from batten.studies import components
from batten.studies.component_paths import (
    LONGEST,
    control_points,
    edge_lengths,
    mirrored,
    residual,
    reversed_ends,
    stays_below,
)
from batten.studies.components import (
    LEVEL,
    LEVELS,
    SAMPLE_LEVEL,
    cells_below,
    plane_lattice,
    random_inner,
    run,
    run_grid,
    sizes_of,
)


@pytest.fixture(scope="module")
def study():
    return run(32, seed=3)


def in_full(size, level):
    """e_λ < level on the whole grid of the square, (size,) * 4 in the order y1, x1, y2', x2', without use of symmetry."""
    k = (np.arange(size) - 0.5 * (size - 1)) * 2.0 * LONGEST / size
    y, x, v, u = np.meshgrid(k, k, k, k, indexing="ij", sparse=True)
    inside = (x * x + y * y < LONGEST**2) & (u * u + v * v < LONGEST**2)
    shape = inside.shape
    inner = np.stack([np.broadcast_to(a, shape)[inside] for a in (x, y, 1.0 - u, v)], axis=-1)
    values = np.ones(shape)
    values[inside] = lambda_residual(control_points(inner), tolerance=1e-3)
    return values < level, values


def test_one_component_on_all_grids_at_all_levels(study):
    for grid in study.grids:
        assert grid.on_grid(LEVEL) > 5  # what a grid alone would say
        for level in LEVELS:
            assert grid.components(level) == (1, 1, 1)
        low = grid.begin < LEVEL
        assert grid.safe[low].all()
    assert [grid.size[0] for grid in study.grids] == [16, 24, 32]
    assert study.trunk < LEVELS[0]


def test_components_on_the_grid_are_those_of_another_flood():
    grid = run_grid(16)
    for level in (0.15, 0.2, 0.3):
        inside, _ = in_full(16, level)
        assert grid.on_grid(level) == ndimage.label(inside)[1]
        assert grid.volume(level) == pytest.approx(inside.sum() * 0.25**4)


def test_images_of_cells_are_cells_with_the_same_value():
    lattice = plane_lattice(20)
    cells = cells_below(lattice, 0.3)
    _, values = in_full(20, 0.3)
    assert len(cells.values) == (values < 0.3).sum()
    inner = lattice.inner(cells.rows, cells.columns)
    assert residual(inner) == pytest.approx(cells.values, abs=1e-3)
    known = {tuple(row): value for row, value in zip(inner.round(9).tolist(), cells.values)}
    for image in (mirrored, reversed_ends):
        for row, value in zip((image(inner).round(9) + 0.0).tolist(), cells.values):
            assert known[tuple(row)] == value
    orbits = lattice.orbit(cells.rows, cells.columns)
    counts = np.unique(orbits[:, 0], return_counts=True)[1]
    assert set(counts) == {2}  # no cell is its own mirror image
    assert set(np.unique(orbits[:, 1], return_counts=True)[1]) == {2, 4}


def test_neighbours_are_a_step_away():
    lattice = plane_lattice(18)
    moves = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)]) * lattice.step
    for move, others in zip(moves, lattice.neighbours.T):
        some = others >= 0
        assert lattice.points[others[some]] == pytest.approx(lattice.points[some] + move)
        assert (np.linalg.norm(lattice.points[~some] + move, axis=1) >= LONGEST).all()


def test_every_random_curve_and_every_cell_is_joined(study):
    sample = study.sample
    below = sample.values < LEVEL
    assert below.sum() > 200
    assert sample.safe[below].all()
    assert (sample.joined[sample.values < 0.3] < 0.3).all()
    assert sample.each[0] == sample.each[1] == sample.each[2] > 100
    assert edge_lengths(sample.inner[below]).min() < 0.02  # whiskers are among them


def test_loops_are_the_next_component(study):
    """Found in the sample, the least of them has both edges of length 2 and is its own reversal."""
    other = study.sample.others[0]
    assert residual(other) == pytest.approx(0.35382, abs=2e-4)
    assert edge_lengths(other) == pytest.approx([2.0, 2.0], abs=1e-6)
    assert reversed_ends(other) == pytest.approx(other, abs=1e-3)
    assert study.sample.joined.max() > SAMPLE_LEVEL
    beside = other + np.random.default_rng(0).normal(scale=0.02, size=(500, 4))
    beside = beside[(edge_lengths(beside) <= LONGEST).all(axis=1)]
    assert len(beside) > 50
    assert residual(beside).min() > residual(other)


def test_a_component_without_a_path_is_counted(study):
    """The counts are not 1 by construction: with paths that rise, every component of the grid is one."""
    grid = study.grids[1]
    torn = dataclasses.replace(grid, joined=np.full_like(grid.joined, 1.0))
    everything, by_mirror, by_both = torn.components(LEVEL)
    assert everything == grid.on_grid(LEVEL) + 1
    assert by_both <= by_mirror < everything
    assert 2 * (by_mirror - 1) >= everything - 1


def test_volume_agrees_with_a_uniform_sample(study):
    rng = np.random.default_rng(6)
    radius, angle = LONGEST * np.sqrt(rng.random((2, 400_000))), rng.uniform(-np.pi, np.pi, (2, 400_000))
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    share = (residual(np.column_stack([x[0], y[0], 1.0 + x[1], y[1]])) < LEVEL).mean()
    volume = share * (np.pi * LONGEST**2) ** 2
    error = volume / np.sqrt(share * 400_000)
    assert study.grids[-1].volume(LEVEL) == pytest.approx(volume, abs=4 * error + 0.1)


def test_the_thickest_place_has_the_room_that_is_said():
    """Random moves of both inner points, by a little less than the clearance: none leaves the set; by more: some do."""
    grid = run_grid(48)
    rng = np.random.default_rng(4)
    assert len(grid.peaks) >= 2
    assert grid.peaks[1] == pytest.approx(mirrored(grid.peaks[0]), abs=0.5)
    for place, clearance in ((grid.peaks[0], grid.peak_clearances[0]), (grid.necks[1], grid.neck_clearances[1])):
        move = rng.normal(size=(20_000, 4))
        move /= np.linalg.norm(move, axis=1)[:, None]

        def outside(length, place=place, move=move):
            moved = place + length * move
            return (residual(moved) >= LEVEL) | (edge_lengths(moved) >= LONGEST).any(axis=1)

        assert not outside(clearance - 0.5 * grid.step[0]).any()
        assert outside(clearance + 1.5 * grid.step[0]).any()
    assert grid.neck_clearances[1] < 0.5 * grid.peak_clearances[1]


def test_the_ways_shown_are_safe(study):
    assert all(study.safe)
    way = study.paths[-1]
    assert way[-1] == pytest.approx(mirrored(way[0]))
    assert not stays_below(way, 0.8 * residual(way).max())
    assert len(study.gallery) == 8
    assert (residual(study.gallery) < LEVEL).all()


def test_the_same_seed_gives_the_same_curves():
    one, again, other = random_inner(100, 1), random_inner(100, 1), random_inner(100, 2)
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    assert (edge_lengths(one) <= LONGEST).all()


@pytest.mark.parametrize("size", [160, 100, 33, 18])
def test_sizes_are_even_and_grow(size):
    sizes = sizes_of(size)
    assert all(cells % 2 == 0 for cells in sizes)
    assert sizes[0] < sizes[1] < sizes[2] <= size


@pytest.mark.parametrize(("size", "seed"), [(15, 0), (241, 0), (32.0, 0), (32, -1)])
def test_sizes_and_seeds_out_of_range_are_refused(size, seed):
    with pytest.raises(InvalidInputError, match="got"):
        run(size, seed)


@pytest.mark.slow
def test_the_answer_at_full_size():
    study = run(components.DEFAULT_SIZE)
    assert [grid.components(LEVEL) for grid in study.grids] == [(1, 1, 1)] * 3
    assert study.grids[-1].volume(LEVEL) == pytest.approx(2.4705, abs=5e-4)
    assert len(study.grids[-1].peaks) == 4  # arches and S-shapes, and their mirror images
    assert study.grids[-1].neck_clearances[1:] == pytest.approx([0.07] * 3, abs=0.0125)
