"""Faces made of elastica: patches, the plan of each, and how they meet (Brander2016 §5, Fig. 9)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.patch_plan import HEIGHTS_SHARE, PatchPlan, plan_patch
from batten.fabrication.patch_search import PatchDecision, Progress, decide_patch
from batten.fabrication.rationalise_job import RationaliseJob
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.face import Face
from batten.surfaces.patches import Patch, patches_of
from batten.typing import FloatArray

_ON_FACE = 1e-4  # of the faces' size: so close to another face a border counts as shared
_SIDE_POINTS = 200  # looked at along the outline of a patch, at least
_SHARED = 5  # of these points, so many at least make a seam


@dataclass(frozen=True)
class Seam:
    """Where two patches meet: how far apart the two cuts end, over the points of their common border.

    Attributes:
        first, second: numbers of the patches. length_mm: of the common border.
        gap_mm: greatest distance of the two cuts at a point of it, along the face's normal.
        turn_rad: greatest angle between the two cuts there, without that of the faces themselves.
        crease_rad: greatest angle of the faces themselves there.
    """

    first: int
    second: int
    length_mm: float
    gap_mm: float
    turn_rad: float
    crease_rad: float


@dataclass(frozen=True, eq=False)
class Rationalisation:
    """A whole job planned.

    Attributes:
        name: of the job. patches: one plan for each patch. seams: where they meet.
    """

    name: str
    patches: tuple[PatchPlan, ...]
    seams: tuple[Seam, ...]

    @property
    def is_good(self) -> bool:
        """Whether every patch can be made as the job asks."""
        return not any(p.problems for p in self.patches)

    @property
    def blocks(self) -> int:
        """How many blocks in all."""
        return sum(len(p.blocks) for p in self.patches)

    @property
    def wire_blocks(self) -> int:
        """How many a straight wire would need."""
        return sum(p.wires.blocks for p in self.patches)

    @property
    def greatest_mm(self) -> float:
        """The greatest distance of any cut from its face."""
        return max(p.deviation.greatest_mm for p in self.patches)


Kept = Callable[[int, Callable[[], PatchDecision]], PatchDecision]
"""Given a patch's number and a function that decides about it: that decision, or what was decided before."""


def rationalise_faces(
    job: RationaliseJob, faces: Sequence[Face], progress: Progress | None = None, *, kept: Kept | None = None
) -> Rationalisation:
    """Divide faces into patches, plan each, and measure how they meet.

    Parameters:
        job: validated values.
        faces: in the design's coordinates, mm.
        progress: called as progress(stage, done, of).
        kept: where decisions about patches come from and go to; None decides all anew.

    Returns:
        The plan of all patches, by faces and within a face in the order of its parameters.

    Raises:
        InvalidInputError: no faces, or one that no division makes a graph (see `patches_of`).
    """
    tell = progress or (lambda stage, done, of: None)
    decide = kept or (lambda number, decision: decision())
    patches = divided(job, faces)
    plans = []
    for number, patch in enumerate(patches, start=1):
        tell("plan the patches", number - 1, len(patches))

        def inner(what: str, done: int, of: int, number: int = number) -> None:
            tell(f"patch {number}: {what}", done, of)

        decision = decide(number, lambda patch=patch, inner=inner: decide_patch(job, patch, inner))  # type: ignore[misc]
        plans.append(plan_patch(job, patch, decision, number))
    tell("plan the patches", len(patches), len(patches))
    return Rationalisation(job.name, tuple(plans), seams_of(plans))


def divided(job: RationaliseJob, faces: Sequence[Face]) -> tuple[Patch, ...]:
    """The patches of all faces that the job asks for.

    Raises:
        InvalidInputError: as `rationalise_faces`; names that no face has.
    """
    chosen = [f for f in faces if job.faces.names is None or f.name in job.faces.names]
    if job.faces.names is not None:
        missing = [n for n in job.faces.names if n not in {f.name for f in faces}]
        if missing:
            raise InvalidInputError(
                f"faces.names: no face {missing[0]!r} in {job.faces.file.name}; it has "
                f"{', '.join(repr(f.name) for f in faces) or 'none'}"
            )
    if not chosen:
        raise InvalidInputError(f"{job.faces.file}: no faces to rationalise")
    spread = float(np.radians(job.patches.greatest_spread_deg))
    tolerance = HEIGHTS_SHARE * job.leaves.tolerance_mm
    return tuple(patch for face in chosen for patch in patches_of(face, tolerance, spread=spread))


def seams_of(plans: Sequence[PatchPlan]) -> tuple[Seam, ...]:
    """Where patches meet, and how well their cuts do.

    Points along each patch's outline that lie on another's face are the common border. From each of them both planned
    surfaces are measured along the first face's normal.
    """
    found = []
    borders = [_border(plan.patch) for plan in plans]
    boxes = [(points.min(axis=0), points.max(axis=0)) for points, _ in borders]
    size = max((float((high - low).max()) for low, high in boxes), default=0.0)
    slack = _ON_FACE * size
    for i, j in combinations(range(len(plans)), 2):
        if (boxes[i][0] > boxes[j][1] + slack).any() or (boxes[j][0] > boxes[i][1] + slack).any():
            continue
        seam = _seam(plans[i], plans[j], *borders[i], slack)
        if seam is None:  # the second may have the shorter side
            seam = _seam(plans[j], plans[i], *borders[j], slack)
        if seam is not None:
            found.append(seam)
    return tuple(found)


def _border(patch: Patch) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) along the outline of a patch in the design, and what length (n,) each stands for."""
    points, lengths = [], []
    for polygon in patch.face.outline():
        side = np.roll(polygon, -1, axis=0) - polygon
        length = np.linalg.norm(side, axis=1)
        pieces = np.maximum(np.ceil(_SIDE_POINTS * length / max(float(length.sum()), 1e-300)), 1.0).astype(int)
        for start, along, whole, count in zip(polygon, side, length, pieces):
            shares = (np.arange(count) + 0.5) / count
            points.append(start + shares[:, None] * along)
            lengths.append(np.full(count, whole / count))
    return np.concatenate(points), np.concatenate(lengths)


def _seam(first: PatchPlan, second: PatchPlan, points: FloatArray, lengths: FloatArray, slack: float) -> Seam | None:
    """The seam along those of the first patch's border points that lie on the second's face."""
    face = second.patch.face
    on = surface_deviation(face.surface, points)
    near = (np.abs(on.signed) <= slack) & face.contains(on.u, on.v)
    if int(near.sum()) < _SHARED:
        return None
    points = points[near]
    u, v = first.patch.face.surface.closest_parameters(points)
    own, other = first.patch.face.surface.normal(u, v), face.surface.normal(on.u[near], on.v[near])
    cuts = [_planned_at(plan, points, own) for plan in (first, second)]
    gap = np.abs(cuts[0][0] - cuts[1][0])
    crease, turn = _angle(own, other), _angle(cuts[0][1], cuts[1][1])
    known = np.isfinite(gap) & np.isfinite(turn) & np.isfinite(crease)
    if int(known.sum()) < _SHARED:
        return None
    return Seam(
        first.number,
        second.number,
        float(lengths[near][known].sum()),
        float(gap[known].max()),
        float(np.maximum(turn - crease, 0.0)[known].max()),
        float(crease[known].max()),
    )


def _planned_at(plan: PatchPlan, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed distance (n,) along the normals from points to the planned surface, and its normals (n, 3), in the design."""
    frame = plan.block_frame
    foot = (points - frame[:3, 3]) @ frame[:3, :3]
    (x0, x1), (y0, y1) = plan.planned.domain
    on = surface_deviation(plan.planned, foot, extend=0.05)
    normal = plan.planned.normal(on.u, on.v, extend=0.06) @ frame[:3, :3].T
    normal = normal * np.where((normal * normals).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    away = plan.planned.point(on.u, on.v, extend=0.06) - foot
    distance = ((away @ frame[:3, :3].T) * normals).sum(axis=1)
    slack = 0.05 * np.array([x1 - x0, y1 - y0])
    inside = (foot[:, 0] >= x0 - slack[0]) & (foot[:, 0] <= x1 + slack[0])
    inside &= (foot[:, 1] >= y0 - slack[1]) & (foot[:, 1] <= y1 + slack[1])
    return np.where(inside, distance, np.nan), normal


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between lines along unit vectors (n, 3), in [0, π/2]."""
    cross = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(cross, np.abs((a * b).sum(axis=1))))
