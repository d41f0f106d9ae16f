"""In which order the blocks are cut, and how far the empty grippers travel between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from batten.fabrication.plan import Block, BlockMotion
from batten.typing import FloatArray

Order = Literal["numbered", "serpentine", "nearest", "shortest"]

_ROUNDS = 50  # of the search for a shorter way; it ends earlier where nothing is found


def travel_mm(motions: Sequence[BlockMotion]) -> FloatArray:
    """How far the grippers travel from the end of each block's cut to the start of each other's.

    Every block stands in the same place when it is cut, so it is measured by the straight way from one leave pose to
    another approach pose, of the arm that has further to go; the arms go round over postures pulled back
    (`batten.fabrication.robot.travel`), which adds about the same to all.

    Parameters:
        motions: m of them.

    Returns:
        Shape (m, m), from the row's block to the column's, mm.
    """
    ways = []
    for side in ("left", "right"):
        start, end = (
            np.array([getattr(getattr(m, side), name)[:3, 3] for m in motions]).reshape(-1, 3)
            for name in ("approach", "leave")
        )
        ways.append(np.linalg.norm(end[:, None] - start[None], axis=-1))
    return np.asarray(np.maximum(*ways))


def way_length_mm(order: Sequence[int], travel: FloatArray) -> float:
    """The length of the way through all blocks in this order; `travel` as `travel_mm` returns it."""
    way = np.asarray(order, dtype=np.int64)
    return float(travel[way[:-1], way[1:]].sum())


def block_order(order: Order, motions: Sequence[BlockMotion], blocks: Mapping[int, Block]) -> tuple[int, ...]:
    """In which order to cut the blocks.

    Parameters:
        order: "numbered"; "serpentine": row by row, every other row backwards; "nearest": from the first block on each time
            the one whose approach pose is nearest (of equals the first); "shortest": the best of these three, shortened by
            turning round and by moving parts of it until neither helps. Its first block is free.
        motions: m, one for each block that is cut.
        blocks: by their numbers.

    Returns:
        Indices into `motions`.

    Accuracy: "shortest" is no more than the others, and not proven to be the least.
    """
    m = len(motions)
    if m < 2 or order == "numbered":
        return tuple(sorted(range(m), key=lambda k: motions[k].block))
    numbered = block_order("numbered", motions, blocks)
    places = [(blocks[motions[k].block].row, blocks[motions[k].block].column) for k in range(m)]
    serpentine = tuple(sorted(range(m), key=lambda k: (places[k][0], places[k][1] * (-1) ** places[k][0])))
    if order == "serpentine":
        return serpentine
    travel = travel_mm(motions)
    nearest = _nearest(numbered, travel)
    if order == "nearest":
        return nearest
    found = [_shortened(list(start), travel) for start in (numbered, serpentine, nearest)]
    return tuple(found[int(np.argmin([way_length_mm(way, travel) for way in found]))])


def _nearest(numbered: Sequence[int], travel: FloatArray) -> tuple[int, ...]:
    way, left = [numbered[0]], list(numbered[1:])
    while left:
        way.append(min(left, key=lambda k: float(travel[way[-1], k])))
        left.remove(way[-1])
    return tuple(way)


def _shortened(way: list[int], travel: FloatArray) -> list[int]:
    """Turn round parts of the way, and move parts of up to three blocks elsewhere, as long as either makes it shorter."""
    best = way_length_mm(way, travel)
    for _ in range(_ROUNDS):
        before = best
        for i in range(len(way)):
            for j in range(i + 1, len(way)):
                for other in (
                    way[:i] + way[i : j + 1][::-1] + way[j + 1 :],
                    *(way[:i] + way[i + k : j + 1] + way[i : i + k] + way[j + 1 :] for k in (1, 2, 3) if i + k <= j),
                    *(
                        way[:i] + way[j + 1 - k : j + 1] + way[i : j + 1 - k] + way[j + 1 :]
                        for k in (2, 3)
                        if i + k <= j
                    ),
                ):
                    length = way_length_mm(other, travel)
                    if length < best - 1e-9:
                        way, best = other, length
        if best >= before:
            break
    return way
