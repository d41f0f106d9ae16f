"""A rod bent between two grippers: the problem as posed, its solutions in order, and the numbers told about each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.fabrication.rod import Rod, greatest_curvature
from batten.io.drawn_curve import DrawnCurve
from batten.solvers.snap_error import snap_error
from batten.solvers.stability import Ends


@dataclass(frozen=True)
class BendProblem:
    """Both ends with their tangents, and the length in between: what `solve_boundary` is asked.

    Parameters:
        start: (x, y), any unit of length; mm where a rod is given.
        start_angle: tangent angle there, radians; None for a pin, about which the rod turns freely.
        end: (x, y).
        end_angle: tangent angle there, radians, with its turns unless `end_angle_modulo`; or None.
        length: arc length, above 0.
        max_inflections: the most changes of curvature's sign that are searched for, 0 or more.
        max_turns: the most full turns that are searched for, 0 or more.
        end_angle_modulo: whether the end's tangent may have turned any number of times more.

    Raises:
        InvalidInputError: a number that is not finite, a length or a count outside these bounds.

    Example:
        >>> BendProblem((0.0, 0.0), 0.5, (3.0, 4.0), -0.5, 10.0).chord
        5.0
    """

    start: tuple[float, float]
    start_angle: float | None
    end: tuple[float, float]
    end_angle: float | None
    length: float
    max_inflections: int = 2
    max_turns: int = 1
    end_angle_modulo: bool = False

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            values = tuple(float(v) for v in getattr(self, name))
            if len(values) != 2 or not all(map(math.isfinite, values)):
                raise InvalidInputError(f"{name} = {getattr(self, name)!r}; allowed are two finite numbers, x and y")
            object.__setattr__(self, name, values)
        for name in ("start_angle", "end_angle", "length"):
            if getattr(self, name) is None and name != "length":
                continue
            object.__setattr__(self, name, float(getattr(self, name)))
            if not math.isfinite(getattr(self, name)):
                raise InvalidInputError(f"{name} = {getattr(self, name)!r}; allowed are finite numbers")
        if not self.length > 0.0:
            raise InvalidInputError(
                f"length = {self.length!r}; allowed are numbers above 0, in the unit of the positions"
            )
        for name in ("max_inflections", "max_turns"):
            if getattr(self, name) < 0:
                raise InvalidInputError(
                    f"{name} = {getattr(self, name)!r}; allowed are whole numbers, 0 or more; try 2"
                )

    @property
    def chord(self) -> float:
        """The straight distance from the start to the end."""
        return math.dist(self.start, self.end)


class BendSolution(Protocol):
    """What `batten.solvers.boundary_value.BoundarySolution` offers."""

    @property
    def elastica(self) -> Elastica:
        """The curve."""

    @property
    def energy(self) -> float:
        """∫κ² ds."""

    @property
    def inflections(self) -> int:
        """How often the curvature changes its sign."""

    @property
    def rotation_number(self) -> float:
        """(θ(L) − θ(0))/2π."""

    @property
    def stable(self) -> bool:
        """Whether the rod stays there by itself."""

    @property
    def margin(self) -> float:
        """The first conjugate length over the length: above 1 stable; infinite if there is none."""

    @property
    def residual(self) -> float:
        """How far the end conditions are missed, over the length."""

    @property
    def ends(self) -> Ends:
        """Which ends are clamped."""


@dataclass(frozen=True)
class BentRod:
    """What a rod (mm, N) in the shape of a solution feels; all signs as in docs/conventions.md.

    Attributes:
        force_n: (x, y), the force that the gripper at the start exerts on the rod; the one at the end exerts its opposite.
        force_size_n: its size, at either gripper.
        moment_start_nmm, moment_end_nmm: bending moments EI·κ at the ends.
        energy_j: elastic energy ½EI∫κ² ds.
        strain: greatest strain anywhere on the rod.
        max_strain: what the rod bears.
        least_radius_mm: least radius of curvature; infinite for a straight rod.
        snap_shift_mm, snap_turn_deg: the least error of a gripper's position, and of its angle, at which the rod snaps to
            another shape (`solvers.snap_error`); infinite if there is none, 0 for an unstable rod, NaN with a pinned end.
    """

    force_n: tuple[float, float]
    force_size_n: float
    moment_start_nmm: float
    moment_end_nmm: float
    energy_j: float
    strain: float
    max_strain: float
    least_radius_mm: float
    snap_shift_mm: float
    snap_turn_deg: float

    @property
    def too_strained(self) -> bool:
        """Whether the rod would stay bent: its strain is above `max_strain`."""
        return self.strain > self.max_strain


@dataclass(frozen=True)
class BendNumbers:
    """One solution's row in every table.

    Attributes:
        number: from 1, by energy.
        solution: the solution itself.
        scaled_energy: L∫κ² ds, free of scale; 4π² for a full circle.
        force: (λ₁, λ₂), 1/length².
        curvature_start, curvature_end: κ at the ends, 1/length; the moments for EI = 1.
        rod: the same in N and mm; None without a rod.
    """

    number: int
    solution: BendSolution
    scaled_energy: float
    force: tuple[float, float]
    curvature_start: float
    curvature_end: float
    rod: BentRod | None


def bend_numbers(solutions: Sequence[BendSolution], rod: Rod | None = None) -> list[BendNumbers]:
    """The solutions numbered from 1 by energy (those of one energy in the order given), with all that is told of them.

    Parameters:
        solutions: any number of them, none included.
        rod: the rod, for mm and N; None without one.

    Accuracy: as `Elastica` and `Rod`.
    """
    rows = []
    for number, solution in enumerate(sorted(solutions, key=lambda s: s.energy), start=1):
        curve = solution.elastica
        first, last = (float(k) for k in curve.curvature_at([0.0, curve.length]))
        force = (float(curve.force[0]), float(curve.force[1]))
        scaled = curve.length * float(solution.energy)
        rows.append(
            BendNumbers(
                number, solution, scaled, force, first, last, bent_rod(curve, rod, solution.ends) if rod else None
            )
        )
    return rows


def bent_rod(curve: Elastica, rod: Rod, ends: Ends = "clamped") -> BentRod:
    """What a rod feels in the shape of an elastica in mm.

    Degenerate: along a straight rod the force is not determined by the shape; the one stored in the elastica counts.

    Example:
        >>> from batten.fabrication.section import RoundSection
        >>> arc = Elastica((0, 0), 0.0, 1 / 400, (0, 0), 1000.0)
        >>> bent = bent_rod(arc, Rod(1000.0, RoundSection(3.0), 200000.0, 0.003))
        >>> bent.strain, bent.too_strained, bent.least_radius_mm
        (0.00375, True, 400.0)
    """
    stiffness, loads, most = rod.bending_stiffness_nmm2, rod.loads(curve), greatest_curvature(curve)
    error = snap_error(curve) if ends == "clamped" else None
    return BentRod(
        force_n=(stiffness * float(curve.force[0]), stiffness * float(curve.force[1])),
        force_size_n=loads.force_n,
        moment_start_nmm=loads.moment_start_nmm,
        moment_end_nmm=loads.moment_end_nmm,
        energy_j=rod.energy_j(curve),
        strain=float(rod.strain(most)),
        max_strain=rod.max_strain,
        least_radius_mm=1.0 / most if most > 0.0 else math.inf,
        snap_shift_mm=math.nan if error is None else error.shift,
        snap_turn_deg=math.nan if error is None else math.degrees(abs(error.turn)),
    )


def drawn_curves(rows: Sequence[BendNumbers]) -> list[DrawnCurve]:
    """The solutions as curves of a drawing, with their numbers as texts that every program can show."""
    return [DrawnCurve(row.number, row.solution.elastica, row.solution.stable, _texts(row)) for row in rows]


def _texts(row: BendNumbers) -> dict[str, str]:
    """Numbers as text with 9 digits; those of the rod have their unit in the name."""
    solution, bent = row.solution, row.rod
    texts: dict[str, float | str] = {
        "energy": float(solution.energy),
        "scaled_energy": row.scaled_energy,
        "stable": "yes" if solution.stable else "no",
        "margin": solution.margin,
        "inflections": solution.inflections,
        "rotation_number": solution.rotation_number,
        "force": f"{row.force[0]:.9g} {row.force[1]:.9g}",
        "curvature_start": row.curvature_start,
        "curvature_end": row.curvature_end,
    }
    if bent is not None:
        texts |= {
            "force_n": bent.force_size_n,
            "moment_start_nmm": bent.moment_start_nmm,
            "moment_end_nmm": bent.moment_end_nmm,
            "energy_j": bent.energy_j,
            "strain": bent.strain,
            "least_radius_mm": bent.least_radius_mm,
            "snap_shift_mm": bent.snap_shift_mm,
            "snap_turn_deg": bent.snap_turn_deg,
        }
    return {key: value if isinstance(value, str) else f"{value:.9g}" for key, value in texts.items()}
