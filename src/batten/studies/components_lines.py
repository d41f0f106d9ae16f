"""The study of connected components in words: the answer first, then what it rests on."""

from __future__ import annotations

import numpy as np

from batten.studies.component_paths import residual
from batten.studies.components import LEVEL, LEVELS, SAMPLE_LEVEL, ComponentStudy, GridPart
from batten.typing import FloatArray


def lines(study: ComponentStudy) -> list[str]:
    """What the study prints.

    Parameters:
        study: from `components.run`.

    Returns:
        Lines without line ends, at most 120 characters each.

    Example:
        >>> from batten.studies.components import run
        >>> lines(run(24))[0]
        'Cubics with λ-residual < 0.2 and outer edges < 2: 1 connected component'
    """
    return [*_answer(study), "", *_grids(study), "", *_levels(study), "", *_sample(study), "", *_bodies(study)]


def _answer(study: ComponentStudy) -> list[str]:
    everything, by_mirror, by_both = study.grids[-1].components(LEVEL)
    sample = study.sample
    alone = int(((sample.values < LEVEL) & (sample.joined >= LEVEL)).sum())
    text = [
        f"Cubics with λ-residual < {LEVEL} and outer edges < 2: {everything} connected "
        f"component{'s' if everything > 1 else ''}",
        f"({by_mirror} up to reflection in the x axis, {by_both} up to that and reversal; left open in Fisker2018 3.4, 6.2)",
    ]
    alone += int(sample.each[0] - sample.each[1])
    if alone:
        text.append(f"but {alone} random curves and single cells of the set were not joined to it: there may be more")
    stable = {grid.components(LEVEL) for grid in study.grids}
    text.append(
        "the same on all three grids"
        if len(stable) == 1
        else "NOT the same on all three grids: take a finer one (--size)"
    )
    if study.safe[-1]:
        text.append(
            "It is its own mirror image: an arch is joined to the reflected arch through flat S-shapes, "
            f"e_λ < {LEVEL} all the way"
        )
    return text


def _grids(study: ComponentStudy) -> list[str]:
    text = [
        f"Flood fill; then a falling path from the least cell of every component of every level to the trunk "
        f"(e_λ ≤ {study.trunk:.3f} there)",
        f"{'cells an axis':<15}{'cells < 0.2':>13}{'volume':>9}{'on the grid':>13}{'least cells':>13}{'joined':>9}"
        f"{'safely':>9}{'components':>12}",
    ]
    for grid in study.grids:
        low = grid.begin < LEVEL
        text.append(
            f"{grid.size[0]:<15}{grid.below[LEVELS.index(LEVEL)]:>13,}{grid.volume(LEVEL):>9.3f}{grid.on_grid(LEVEL):>13}"
            f"{low.sum():>13,}{(low & (grid.joined < LEVEL)).sum():>9,}{(low & grid.safe).sum():>9,}"
            f"{grid.components(LEVEL)[0]:>12}"
        )
    each = study.sample.each
    text.append(
        f"Every cell of the first grid by itself, up to images: {each[0]:,}, joined {each[1]:,}, safely {each[2]:,}"
    )
    text.append("(safely: what the slope of e_λ along the path allows, doubled, keeps it below 0.2 everywhere on it)")
    return text


def _levels(study: ComponentStudy) -> list[str]:
    """Components for each level; nothing merges if the last row of each grid is 1 throughout."""
    text = ["level          " + "".join(f"{level:>9}" for level in LEVELS)]
    for grid in study.grids:
        text.append(f"{grid.size[0]:>5} on grid  " + "".join(f"{grid.on_grid(level):>9}" for level in LEVELS))
        text.append("      joined   " + "".join(f"{grid.components(level)[0]:>9}" for level in LEVELS))
    return text


def _sample(study: ComponentStudy) -> list[str]:
    sample = study.sample
    counts = []
    for level in (LEVEL, LEVELS[-1], SAMPLE_LEVEL):
        below = sample.values < level
        counts.append(f"{below.sum():,} below {level} ({(below & (sample.joined >= level)).sum()} not joined)")
    text = [
        f"Random curves, {sample.draws[0]:,} drawn, of those below {LEVEL} {int(sample.safe.sum()):,} joined safely:",
        "  " + ", ".join(counts),
    ]
    if len(sample.others):
        other = sample.others[0]
        text.append(
            f"The next component begins at e_λ = {residual(other):.4f}, a loop with p1 = {_pair(other[:2])}, "
            f"p2 = {_pair(other[2:])}"
        )
    text.append("Least e_λ for an outer edge of length")
    some = slice(0, None, 2)
    text.append("  " + "".join(f"{edge:>10.0e}" for edge in sample.edges[some]))
    text.append("  " + "".join(f"{value:>10.4f}" for value in sample.least[some]))
    text.append("so the set has whiskers thinner than any grid, along which the edge points at the far control point")
    return text


def _bodies(study: ComponentStudy) -> list[str]:
    text = [
        "Bottlenecks: bodies of the set by their distance to its outside (of the four numbers p1, p2), and the necks that",
        "join each to a thicker one; right to half a cell or so, the grids from coarse to fine",
    ]
    for grid in study.grids:
        text.append(f"  {grid.size[0]} cells an axis, half a cell {0.5 * grid.step[0]:.3f}")
        text += [_body(grid, k) for k in range(len(grid.peaks))]
    return text


def _body(grid: GridPart, k: int) -> str:
    peak = grid.peaks[k]
    text = f"    body {grid.peak_clearances[k]:.3f} at p1 = {_pair(peak[:2])}, p2 = {_pair(peak[2:])}"
    if k == 0:
        return text
    neck = grid.necks[k]
    return f"{text}; neck {grid.neck_clearances[k]:.3f} at {_pair(neck[:2])}, {_pair(neck[2:])}"


def _pair(values: FloatArray) -> str:
    return f"({np.round(values[0], 2) + 0.0:.2f}, {np.round(values[1], 2) + 0.0:.2f})"
