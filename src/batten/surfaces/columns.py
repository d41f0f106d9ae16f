"""Columns of blocks along the blade: as few as keep every leaf within the tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.face import Face
from batten.surfaces.plane_family import PlaneFamily, fit_rows, fitted
from batten.surfaces.rationalise import Chains
from batten.typing import BoolArray, FloatArray, IntArray

_SECTIONS = 8  # candidates between which a border is sought at a time, twice
_LEAST = 1.0 / 64.0  # of the greatest width: narrower columns are not looked for
_BALANCE = 6
_GROWTH = 0.25
_SKIP = 1.0 / 6.0
_MORE = 3  # columns beyond those that held joints need, before it is given up


@dataclass(frozen=True, eq=False)
class Columns:
    """Borders of columns, and the leaves between them.

    Attributes:
        borders: (c + 1,), ascending, along the blade. chains: all leaves of the family, c pieces each.
        deviation: greatest distance of a piece from its leaf, over what counts.
        least: a column less than this many cannot do: so many it takes if no piece need join the next. It rests on a part
            of the leaves, and on wider columns being harder than narrower ones.
        kept: whether the deviation is within the tolerance and no piece is too long.
    """

    borders: FloatArray
    chains: Chains
    deviation: float
    least: int
    kept: bool


def fewest_columns(
    plan: Face,
    family: PlaneFamily,
    tolerance: float,
    *,
    greatest_width: float,
    greatest_length: float = np.inf,
    at_most: int = 10**6,
    progress: Callable[[int, int], None] | None = None,
) -> Columns:
    """The fewest columns of blocks in which chains of elastica keep the tolerance.

    Two greedy runs bound the count: pieces that need not join take the longest column that keeps the tolerance, again and
    again (fewest, as long as a part of a good column is good); pieces whose ends hold the surface's points and tangents
    join for free, and are enough. From the first count upward, columns of equal width are tried, then the borders of both
    runs spread over that count, all balanced: a column's width times (d/d̄)^−¼. A part of the leaves is used; where a
    leaf left out fails, it is put in and the borders are balanced again.

    Parameters:
        plan: heights over x and y (`Patch.plan`).
        family: its planes.
        tolerance: greatest distance from the leaf in its plane, above 0.
        greatest_width: of a column, above 0.
        greatest_length: of a piece.
        at_most: more columns than this are not looked for.
        progress: called with (counts tried, at most).

    Returns:
        `Columns`; if no count keeps the tolerance, the best that was found, `kept` False.

    Raises:
        InvalidInputError: a tolerance, width or length that is not above 0.
    """
    if not (tolerance > 0.0 and greatest_width > 0.0 and greatest_length > 0.0):
        raise InvalidInputError(
            f"tolerance = {tolerance}, greatest_width = {greatest_width}, greatest_length = {greatest_length}; allowed are "
            "numbers above 0"
        )
    search = _Search(plan, family, tolerance, greatest_width, greatest_length)
    free, held = search.greedy(3, at_most), search.greedy(0, at_most)
    least = max(len(free) - 1, search.count_by_width)
    most = max(search.count_by_width, min(max(len(held) - 1, least) + _MORE, at_most))
    best: Columns | None = None
    count = min(least, most)
    while count <= most:
        if progress is not None:
            progress(min(count, most), most)
        nearest: Columns | None = None
        for start in search.starts(count, held, free):
            other = search.settled(start, least)
            if nearest is None or other.kept or other.deviation < nearest.deviation:
                nearest = other
            if nearest.kept or count == 1:
                break
        assert nearest is not None
        if best is None or nearest.kept or nearest.deviation < best.deviation:
            best = nearest
        if best.kept:
            break
        # The deviation falls with no more than about the fourth power of the count.
        count = max(count + 1, int(count * min(nearest.deviation / tolerance, 1e3) ** _SKIP))
    assert best is not None
    if progress is not None:
        progress(most, most)
    return best


class _Search:
    """One search: the plan, the limits, and the leaves that are looked at."""

    def __init__(
        self, plan: Face, family: PlaneFamily, tolerance: float, greatest_width: float, greatest_length: float
    ) -> None:
        self.plan, self.family, self.tolerance = plan, family, tolerance
        self.greatest_width, self.greatest_length = greatest_width, greatest_length
        self.low, self.high = float(family.low[0]), float(family.high[0])
        self.few: IntArray = family.some()

    @property
    def count_by_width(self) -> int:
        """How many columns the greatest width alone asks for."""
        return max(1, int(np.ceil((self.high - self.low) / self.greatest_width - 1e-9)))

    def greedy(self, rounds: int, at_most: int) -> FloatArray:
        """Borders of columns, each as wide as its leaves allow, from left to right, every piece by itself.

        The last of more than `at_most` columns reaches to the end.
        """
        borders = [self.low]
        while borders[-1] < self.high - 1e-9 * (self.high - self.low):
            if len(borders) > at_most:
                return np.array([*borders, self.high])
            start = borders[-1]
            width = min(self.greatest_width, self.high - start)
            low, high = 0.0, width
            for _ in range(2):
                widths = low + (high - low) * np.arange(1, _SECTIONS + 1) / _SECTIONS
                good = np.flatnonzero(self._feasible(start, start + widths, rounds))
                low, high = (
                    (low, float(widths[0]))
                    if not good.size
                    else (float(widths[good[-1]]), float(widths[min(good[-1] + 1, _SECTIONS - 1)]))
                )
                if high <= low:
                    break
            borders.append(start + max(low, _LEAST * self.greatest_width))
            if self.high - borders[-1] < _LEAST * self.greatest_width:
                borders[-1] = self.high
        return np.array(borders)

    def _feasible(self, start: float, ends: FloatArray, rounds: int) -> BoolArray:
        """Whether columns from `start` to each of `ends` keep tolerance and length."""
        clipped = [self.family.clipped(np.array([start, end])) for end in ends]
        edges = np.concatenate([np.concatenate([a, b], axis=1)[self.few] for a, b, _ in clipped])
        column = np.repeat(np.arange(len(ends)), len(self.few))
        needed = np.concatenate([n[self.few, 0] for *_, n in clipped])
        rows = np.tile(self.few, len(ends))[needed]
        good = np.ones(len(ends), dtype=np.bool_)
        if len(rows):
            chains = fit_rows(self.plan, self.family, rows, edges[needed], self.tolerance, rounds=rounds)
            np.logical_and.at(good, column[needed], self._good(chains))
        return good

    def _good(self, chains: Chains) -> BoolArray:
        """Which chains, (m,), keep tolerance and length in all pieces that count."""
        counts = np.isfinite(chains.deviation)
        bad = counts & ((chains.deviation > self.tolerance) | (chains.parameters[..., 6] > self.greatest_length))
        return np.asarray(~(bad | (chains.status > 1)).any(axis=1))

    def starts(self, count: int, *greedy: FloatArray) -> list[FloatArray]:
        """Borders to start from: equal widths, and those of the greedy runs spread over `count` columns."""
        found = [np.linspace(self.low, self.high, count + 1)]
        for borders in greedy:
            spread = np.interp(np.linspace(0.0, len(borders) - 1.0, count + 1), np.arange(len(borders)), borders)
            spread[[0, -1]] = self.low, self.high
            found.append(_narrowed(spread, self.greatest_width))
        return found

    def settled(self, borders: FloatArray, least: int) -> Columns:
        """Columns balanced from `borders` over the leaves looked at, and tried on all."""
        found: Columns | None = None
        for _ in range(3):
            borders, kept = self._balanced(borders)
            found = self._whole(borders, least)
            if found.kept or not kept:
                break
            self._take_in(found.chains)
        assert found is not None
        return found

    def _balanced(self, borders: FloatArray) -> tuple[FloatArray, bool]:
        """The best borders of some steps that give width to columns of small deviation, and whether they are good."""
        best, least = borders, np.inf
        for _ in range(_BALANCE):
            chains = fitted(self.plan, self.family, borders, self.tolerance, rows=self.few)
            over = np.nan_to_num(chains.parameters[..., 6]) / self.greatest_length
            strain = np.maximum(np.nan_to_num(chains.deviation) / self.tolerance, np.where(over > 1.0, over**4, 0.0))
            strain = np.where((chains.status > 1), 1e3, strain).max(axis=0)
            worst = float(strain.max())
            if worst < least:
                best, least = borders, worst
            if worst <= 1.0 or len(borders) == 2:
                break
            width = np.diff(borders) * np.clip(strain / strain.mean(), 0.02, 50.0) ** -_GROWTH
            borders = np.concatenate([[0.0], np.cumsum(width)]) * (self.high - self.low) / width.sum() + self.low
            borders = _narrowed(borders, self.greatest_width)
        return best, least <= 1.0

    def _whole(self, borders: FloatArray, least: int) -> Columns:
        """All leaves between these borders."""
        chains = fitted(self.plan, self.family, borders, self.tolerance)
        deviation = float(np.nanmax(chains.deviation, initial=0.0))
        return Columns(borders, chains, deviation, least, bool(self._good(chains).all()))

    def _take_in(self, chains: Chains) -> None:
        """Leaves that failed join those that are looked at."""
        failed: IntArray = np.flatnonzero(~self._good(chains))
        worst = failed[np.argsort(-np.nan_to_num(chains.deviation[failed]).max(axis=1), kind="stable")[:4]]
        self.few = np.unique(np.append(self.few, worst))


def _narrowed(borders: FloatArray, greatest: float) -> FloatArray:
    """Borders with no column wider than `greatest`: what is too much goes to the others, in proportion."""
    width = np.diff(borders)
    total = float(width.sum())
    for _ in range(len(width)):
        over = width > greatest
        if not over.any() or over.all():
            break
        room = total - greatest * int(over.sum())
        width = np.where(over, greatest, width * room / width[~over].sum())
    ends = borders[0] + np.concatenate([[0.0], np.cumsum(width)])
    ends[-1] = borders[-1]
    return np.asarray(ends)
