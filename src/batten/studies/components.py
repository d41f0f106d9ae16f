"""How many connected components has the set of cubics with small λ-residual? The open question of Fisker2018 §3.4, §6.2.

The set: cubics from (0, 0) to (1, 0) with outer edges L₁, L₂ < 2 and e_λ < 0.2, a part of R⁴. Cusps are a hypersurface with
e_λ = 1, and an outer edge of length zero has e_λ = 1 too; e_λ comes up to both continuously, by a logarithm of the distance.
Straight lines run through in one direction have e_λ = 0 and belong to the set by definition, though e_λ near a line depends
on the direction of the deviation and not on its size. They are a convex part of a plane (x(t) grows) that meets the trunk,
so they make no component and join none that the rest does not; the set without them is open, and it is what is computed.

What is done, on three grids:

- Flood fill: the inner control points run through a square grid of the disc, all pairs with e_λ < 0.3 are joined with
  their neighbours in order of e_λ. That gives every component of every level on the grid, with its least cell.
- Where the set is thin a grid of any size cuts it. So from the least cell of *every* component of every level a path is
  sought on which e_λ falls, into the trunk (`studies.component_paths`). A component whose least cell gets there without
  rising to its level is no component of its own.
- On the coarsest grid a path is sought from every single cell: a grid alone may join cells that a cusp parts.
- What is smaller than a cell is looked for at random, short outer edges and edges along each other preferred.
- How thick the set is: distances to its outside, and where the bodies of greatest thickness are joined: its bottlenecks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.kernels.components import merge_tree, steps_outside
from batten.measures.lambda_residual import lambda_residual
from batten.studies.component_paths import (
    LONGEST,
    control_points,
    descended,
    join,
    least_by_edge,
    mirrored,
    residual,
    reversed_ends,
    stays_below,
    to_mirror_image,
    trunk_level,
)
from batten.studies.study import Progress
from batten.typing import BoolArray, FloatArray, IntArray

DEFAULT_SIZE = 160
"""Cells on each of the four axes of the finest grid."""
LEAST_SIZE, MOST_SIZE = 16, 240

LEVEL = 0.2
"""The level asked about."""
LEVELS = (0.1, 0.125, 0.15, 0.175, 0.2, 0.225, 0.25, 0.275, 0.3)
"""Levels at which components are counted; cells up to the last are kept."""
SAMPLE_LEVEL = 0.5
"""Random points up to here are joined to the trunk."""

EDGES: FloatArray = np.logspace(-1.0, -12.0, 12)
"""Lengths of the outer edge for which the least e_λ is looked for."""

_TOLERANCE = 1e-3  # of e_λ on the grid
_ROUNDS = 30  # of spreading distances
_PIECES = 64  # of a step, where four are too few
_DRAWS = 25  # random points, times size²
_GALLERY = 8


class Lattice(NamedTuple):
    """Points (n, 2) of a square grid in the disc of radius 2, none on an axis; numbers of neighbours (n, 4), mirror images.

    A pair (i, j) stands for p₁ = point i and p₂ = (1 − x, y) of point j, so that reversal swaps i and j.
    """

    step: float
    points: FloatArray
    neighbours: IntArray
    mirror: IntArray

    def inner(self, rows: IntArray, columns: IntArray) -> FloatArray:
        """Points (k, 4) of pairs."""
        one, other = self.points[rows], self.points[columns]
        return np.column_stack([one, 1.0 - other[:, 0], other[:, 1]])

    def orbit(self, rows: IntArray, columns: IntArray) -> IntArray:
        """(k, 2): a number for each pair and its mirror image; and for these and what is reversed."""
        n = len(self.points)
        keys = [i.astype(np.int64) * n + j for i, j in _images(self, rows, columns)]
        return np.column_stack([np.minimum(keys[0], keys[2]), np.min(keys, axis=0)])


class Cells(NamedTuple):
    """Pairs below a level, in order of i and j: offsets of the rows (n + 1,), rows, columns, values (c,)."""

    offsets: IntArray
    rows: IntArray
    columns: IntArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class GridPart:
    """What one grid says; k components of all levels, m thick bodies.

    Attributes:
        size: cells on each axis, (1,). step: their width, (1,).
        below: cells below each of `LEVELS`, (9,).
        least: the least cell of each component, (k, 4). begin, end: its e_λ, and the level at which the component is joined
            to an older one on the grid, inf if it never is, (k,).
        orbits: numbers that mirror images share, and that reversed and mirrored ones share, (k, 2).
        joined: level of the path from the least cell to the trunk, (k,). safe: whether e_λ < 0.2 all along it by what its
            slope allows (`component_paths.stays_below`), (k,).
        peaks, peak_clearances: cells of greatest distance to the outside of the set e_λ < 0.2, (m, 4), (m,). The first is
            the thickest; the others are bodies that are at least 1/0.7 times as thick as the neck that joins them.
        necks, neck_clearances: the thinnest place on the thickest way to a thicker body, (m, 4), (m,); NaN for the first.
    """

    size: IntArray
    step: FloatArray
    below: IntArray
    least: FloatArray
    begin: FloatArray
    end: FloatArray
    orbits: IntArray
    joined: FloatArray
    safe: BoolArray
    peaks: FloatArray
    peak_clearances: FloatArray
    necks: FloatArray
    neck_clearances: FloatArray

    def alone(self, level: float) -> IntArray:
        """Numbers of the components at a level, on the grid, that no path joins to the trunk below it."""
        return np.flatnonzero((self.begin < level) & (self.end >= level) & (self.joined >= level))

    def on_grid(self, level: float) -> int:
        """Components on the grid at a level, before paths were sought."""
        return int(((self.begin < level) & (self.end >= level)).sum())

    def components(self, level: float) -> tuple[int, int, int]:
        """Components at a level: all, up to mirroring, up to mirroring and reversal. The trunk is one."""
        alone = self.orbits[self.alone(level)]
        return 1 + len(alone), 1 + len(np.unique(alone[:, 0])), 1 + len(np.unique(alone[:, 1]))

    def volume(self, level: float) -> float:
        """Of the set below one of `LEVELS`."""
        return float(self.below[LEVELS.index(level)] * self.step[0] ** 4)


@dataclass(frozen=True, eq=False)
class SamplePart:
    """Random points of the set, and curves of which no path leads to the trunk.

    Attributes:
        draws: (1,). inner: points with e_λ < `SAMPLE_LEVEL`, (n, 4). values, joined, safe: their e_λ, and of their paths
            the level and what `GridPart` says, (n,).
        each: cells of the coarsest grid below `LEVEL`, up to images; how many have a path of their own to the trunk below
            it; how many a safe one, (3,). A grid may join cells that a cusp between them parts; this does not.
        others: what the points that were not joined below `SAMPLE_LEVEL` come down to, (q, 4), the lowest first.
        edges, least: the least e_λ found for outer edges of these lengths, (12,).
    """

    draws: IntArray
    inner: FloatArray
    values: FloatArray
    joined: FloatArray
    safe: BoolArray
    each: IntArray
    others: FloatArray
    edges: FloatArray
    least: FloatArray


@dataclass(frozen=True, eq=False)
class ComponentStudy:
    """The whole study.

    Attributes:
        size, seed: as asked for. trunk: the greatest e_λ in the trunk. grids: from coarse to fine. sample: see there.
        gallery: members of the set far from each other, the thickest place first, (g, 4).
        paths: from each of them and then each body and neck of the finest grid to the trunk; the last is from the thickest
            place to its mirror image. safe: whether e_λ < 0.2 all along each of these, by what its slope allows.
    """

    size: int
    seed: int
    trunk: float
    grids: tuple[GridPart, ...]
    sample: SamplePart
    gallery: FloatArray
    paths: tuple[FloatArray, ...]
    safe: tuple[bool, ...]


def check(size: int, seed: int) -> None:
    """Refuse sizes and seeds out of range: `InvalidInputError`."""
    if not (isinstance(size, int | np.integer) and LEAST_SIZE <= size <= MOST_SIZE):
        raise InvalidInputError(f"the grid has {LEAST_SIZE} to {MOST_SIZE} cells on each axis; got {size!r}")
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise InvalidInputError(f"a seed is a whole number ≥ 0; got {seed!r}")


def sizes_of(size: int) -> tuple[int, int, int]:
    """Cells on each axis of the three grids: half, three quarters, all of it; even, so that mirror images are cells."""
    return 2 * (size // 4), 2 * round(3 * size / 8), 2 * (size // 2)


def plane_lattice(size: int) -> Lattice:
    """The grid of one control point."""
    step = 2.0 * LONGEST / size
    k = (np.arange(size) - 0.5 * (size - 1)) * step
    x, y = np.meshgrid(k, k)
    inside = x * x + y * y < LONGEST**2
    numbers = np.full((size + 2, size + 2), -1, np.int64)
    numbers[1:-1, 1:-1][inside] = np.arange(inside.sum())
    around = (numbers[1:-1, 2:], numbers[1:-1, :-2], numbers[2:, 1:-1], numbers[:-2, 1:-1])
    neighbours = np.stack([other[inside] for other in around], axis=-1)
    return Lattice(step, np.column_stack([x[inside], y[inside]]), neighbours, numbers[-2:0:-1, 1:-1][inside])


def _images(lattice: Lattice, rows: IntArray, columns: IntArray) -> list[tuple[IntArray, IntArray]]:
    """A pair, reversed, mirrored, both."""
    one, other = lattice.mirror[rows], lattice.mirror[columns]
    return [(rows, columns), (columns, rows), (one, other), (other, one)]


def cells_below(lattice: Lattice, level: float, progress: Progress | None = None) -> Cells:
    """All pairs with e_λ below a level. A quarter is computed, the rest are images of it."""
    n = len(lattice.points)
    name = f"grid of {round(2.0 * LONGEST / lattice.step)}"
    upper = np.flatnonzero(lattice.points[:, 1] > 0.0)
    control = control_points(lattice.inner(np.zeros(n, np.int64), np.arange(n)))
    found: list[tuple[IntArray, IntArray, FloatArray]] = []
    for k, i in enumerate(upper.tolist()):
        control[:, 1] = lattice.points[i]
        for columns in (upper[k:], lattice.mirror[upper[k:]]):
            values = np.asarray(lambda_residual(control[columns], tolerance=_TOLERANCE))
            low = np.flatnonzero(values < level)
            found.append((np.full(len(low), i), columns[low], values[low]))
        if progress is not None and (k % 64 == 63 or k == len(upper) - 1):
            progress(name, k + 1, len(upper))
    rows, columns, values = (np.concatenate(parts) for parts in zip(*found))
    keys, first = np.unique(np.concatenate([i * n + j for i, j in _images(lattice, rows, columns)]), return_index=True)
    rows, columns = keys // n, keys % n
    return Cells(np.searchsorted(rows, np.arange(n + 1)), rows, columns, np.tile(values, 4)[first])


def _merges(lattice: Lattice, cells: Cells, values: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Components of all levels: merges (k, 4) as in the kernel, and first cell and size of those that are left."""
    count = len(values)
    parent, births, sizes = (np.empty(count, np.int64) for _ in range(3))
    merges = np.empty((count // 2 + 1, 4), np.int64)
    order = np.argsort(values, kind="stable")
    found = merge_tree(
        cells.offsets, cells.rows, cells.columns, lattice.neighbours, values, order, parent, births, sizes, merges
    )
    left = np.unique(parent)
    return merges[:found], births[left], sizes[left]


def run_grid(size: int, progress: Progress | None = None) -> GridPart:
    """Flood fill, paths to the trunk, and thickness, on one grid of `size` (even) cells on each axis.

    Example:
        >>> part = run_grid(24)
        >>> part.on_grid(0.2) > 1, part.components(0.2)
        (True, (1, 1, 1))
    """
    lattice = plane_lattice(size)
    cells = cells_below(lattice, LEVELS[-1], progress)
    merges, births, _ = _merges(lattice, cells, cells.values)
    first = np.concatenate([births, merges[:, 0]])
    end = np.concatenate([np.full(len(births), np.inf), cells.values[merges[:, 2]]])
    orbits = lattice.orbit(cells.rows[first], cells.columns[first])
    _, some, which = np.unique(orbits[:, 1], return_index=True, return_inverse=True)
    least = lattice.inner(cells.rows[first], cells.columns[first])
    begin = cells.values[first]
    levels, safe = _joined(least[some], begin[some], f"paths from the grid of {size}", progress)
    below = np.array([(cells.values < level).sum() for level in LEVELS])
    return GridPart(
        np.array([size]), np.array([lattice.step]), below, least, begin, end, orbits, levels[which],
        safe[which], *_thickness(lattice, cells),
    )  # fmt: skip


def _joined(
    points: FloatArray, values: FloatArray, stage: str, progress: Progress | None, most_rounds: int = 100
) -> tuple[FloatArray, BoolArray]:
    """Levels of the paths to the trunk, and which of them are safe."""
    levels, safe = np.empty(len(points)), np.zeros(len(points), np.bool_)
    low = values < LEVEL
    done = 0
    for rows, keep_paths in ((np.flatnonzero(low), True), (np.flatnonzero(~low), False)):
        for start in range(0, len(rows), 2048):
            part = rows[start : start + 2048]
            joined = join(points[part], most_rounds=most_rounds, keep_paths=keep_paths)
            levels[part] = joined.levels
            if keep_paths:
                safe[part] = [stays_below(path, LEVEL) for path in joined.paths]
                again = part[~safe[part]]  # along edges of a thousandth a path needs many knots
                paths = join(points[again], most_rounds=most_rounds, keep_paths=True, pieces=_PIECES).paths
                safe[again] = [stays_below(path, LEVEL) for path in paths]
            done += len(part)
            if progress is not None:
                progress(stage, done, len(points))
    return levels, safe


def _thickness(lattice: Lattice, cells: Cells) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Peaks, their clearances, necks and theirs, of the set below `LEVEL`: as in `GridPart`."""
    low = cells.values < LEVEL
    rows, columns = cells.rows[low], cells.columns[low]
    offsets = np.searchsorted(rows, np.arange(len(lattice.points) + 1))
    inside = Cells(offsets, rows, columns, cells.values[low])
    steps = np.empty((len(rows), 4), np.int16)
    steps_outside(offsets, rows, columns, lattice.neighbours, _ROUNDS, steps)
    # The border lies half a step before the first cell outside.
    clearance = lattice.step * (np.sqrt((steps.astype(np.float64) ** 2).sum(axis=1)) - 0.5)
    merges, births, sizes = _merges(lattice, inside, -clearance)
    top, neck = clearance[merges[:, 0]], clearance[merges[:, 2]]
    bodies = np.flatnonzero((top >= 2.5 * lattice.step) & (neck <= 0.7 * top))
    bodies = bodies[np.argsort(-top[bodies], kind="stable")]
    thickest = births[np.argmax(sizes)]
    peaks = np.append(thickest, merges[bodies, 0])
    necks = lattice.inner(rows[merges[bodies, 2]], columns[merges[bodies, 2]])
    return (
        lattice.inner(rows[peaks], columns[peaks]),
        clearance[peaks],
        np.vstack([np.full(4, np.nan), necks]),
        np.append(np.nan, neck[bodies]),
    )


def random_inner(count: int, seed: int) -> FloatArray:
    """Random points (count, 4): half of the outer edges uniform in the disc, half with lengths from 0.001, log-uniform.

    Three fifths of the second edges point at the first control point, up to an angle of the order of their length.
    """
    rng = np.random.default_rng([seed, count])
    uniform = LONGEST * np.sqrt(rng.random((2, count)))
    short = np.exp(rng.uniform(np.log(1e-3), np.log(LONGEST), (2, count)))
    length = np.where(rng.random((2, count)) < 0.5, uniform, short)
    angle = rng.uniform(-np.pi, np.pi, (2, count))
    x, y = length[0] * np.cos(angle[0]), length[0] * np.sin(angle[0])
    aimed = np.arctan2(y, x - 1.0) + rng.normal(size=count) * length[1] * rng.choice([0.3, 1.0, 3.0], count)
    turn = np.where(rng.random(count) < 0.6, aimed, angle[1])
    return np.column_stack([x, y, 1.0 + length[1] * np.cos(turn), length[1] * np.sin(turn)])


def run_sample(size: int, seed: int, progress: Progress | None = None) -> SamplePart:
    """Random points joined to the trunk, what the others come down to, and how short an outer edge may be.

    Example:
        >>> part = run_sample(24, 0)
        >>> bool((part.joined[part.values < 0.3] < 0.3).all())
        True
    """
    draws = random_inner(_DRAWS * size**2, seed)
    values = residual(draws)
    draws, values = draws[values < SAMPLE_LEVEL], values[values < SAMPLE_LEVEL]
    levels, safe = _joined(draws, values, "paths from random curves", progress, 30)
    each = _each_cell(sizes_of(size)[0], progress)
    others = descended(draws[levels >= SAMPLE_LEVEL], 400)
    others = others[np.argsort(residual(others))] if len(others) else others
    return SamplePart(
        np.array([_DRAWS * size**2]), draws, values, levels, safe, each, others, EDGES, least_by_edge(EDGES)
    )


def _each_cell(size: int, progress: Progress | None) -> IntArray:
    """As `SamplePart.each`."""
    lattice = plane_lattice(size)
    cells = cells_below(lattice, LEVEL)
    _, some = np.unique(lattice.orbit(cells.rows, cells.columns)[:, 1], return_index=True)
    points = lattice.inner(cells.rows[some], cells.columns[some])
    levels, safe = _joined(points, cells.values[some], "paths from single cells", progress)
    return np.array([len(some), (levels < LEVEL).sum(), safe.sum()])


def run(size: int = DEFAULT_SIZE, seed: int = 0, progress: Progress | None = None) -> ComponentStudy:
    """Count the components of the set e_λ < 0.2 on three grids, join them by paths, measure bottlenecks.

    Parameters:
        size: cells on each of the four axes of the finest grid, 16 to 240; memory and time grow with its fourth power.
        seed: of the random curves, ≥ 0. progress: called as progress(stage, done, total).

    Returns:
        The study; `components_lines.lines` says it in words.

    Raises:
        InvalidInputError: a size or a seed out of range.

    Example:
        >>> study = run(24)
        >>> [grid.components(0.2) for grid in study.grids]
        [(1, 1, 1), (1, 1, 1), (1, 1, 1)]
    """
    check(size, seed)
    grids = tuple(run_grid(cells, progress) for cells in sizes_of(size))
    return finished(size, seed, grids, run_sample(size, seed, progress))


def finished(size: int, seed: int, grids: tuple[GridPart, ...], sample: SamplePart) -> ComponentStudy:
    """The study of finished parts: what remains takes a second."""
    finest = grids[-1]
    gallery = _far_apart(finest.peaks[0], sample.inner[sample.values < 0.75 * LEVEL])
    shown = np.vstack([gallery, finest.peaks, finest.necks[1:]])
    paths = join(shown, keep_paths=True).paths
    paths = (*paths, to_mirror_image(paths[0]))
    safe = tuple(stays_below(path, LEVEL) for path in paths)
    return ComponentStudy(size, seed, trunk_level(), grids, sample, gallery, paths, safe)


def _far_apart(first: FloatArray, points: FloatArray) -> FloatArray:
    """Some points, each as far as can be from those before it and from their images."""
    chosen = [first]
    distance = np.full(len(points), np.inf)
    while len(chosen) < min(_GALLERY, len(points)):
        for image in (chosen[-1], mirrored(chosen[-1]), reversed_ends(chosen[-1]), mirrored(reversed_ends(chosen[-1]))):
            distance = np.minimum(distance, np.linalg.norm(points - image, axis=1))
        chosen.append(points[np.argmax(distance)])
    return np.array(chosen)
