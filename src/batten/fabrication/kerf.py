"""How wide the hot blade melts, at what speed, and where it must run so that the face that is left is the design.

The kerf is the width of foam that melts away; half of it lies on either side of the blade. Of the two parts of a block
one is kept. Its face lies half the kerf from the surface that the blade sweeps: below it, if the lower part is kept. So
with `kerf.offset` the blade follows the design's parallel surface at half the nominal kerf, above or below.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.job import BladeJob, CutJob, KerfJob
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.parallel import parallel_surface
from batten.typing import ArrayLike, FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

FORMULAS = ("a + b / v", "a * v^-b")
"""The kerf in mm from the constants a and b and the speed v in mm/s."""

CONTINUED = 0.25
"""How far the design is continued beyond its borders, as a share of its parameters' ranges: turned planes leave it."""
_SURFACE_SHARE, _SURFACE_MM = 0.01, 0.01
"""How far the blade's surface may lie from the true parallel one: this share of the tolerance, and at most this much."""
_HALVINGS = 60


@dataclass(frozen=True, eq=False)
class KerfLaw:
    """The kerf as a decreasing function of the blade's speed at right angles to itself.

    Either a table, interpolated by monotone cubics (PCHIP, Fritsch and Carlson 1980) and unknown outside its speeds, or
    one of `FORMULAS`, for all speeds: infinite where the blade stands still.

    Parameters:
        speeds_mm_s: two or more, ascending, above 0; None for a formula.
        widths_mm: as many, descending, 0 or more.
        formula: one of `FORMULAS`; None for a table.
        a: its first constant: mm, 0 or more ("a + b / v"); or the kerf at 1 mm/s, mm, above 0 ("a * v^-b").
        b: its second: mm²/s, above 0; or the exponent, above 0.

    Raises:
        InvalidInputError: a table and a formula, neither, or values outside these bounds.

    Example:
        >>> law = KerfLaw(formula="a + b / v", a=0.4, b=12.0)
        >>> law.width_mm([10.0, 20.0]).tolist(), law.speed_mm_s(1.0)
        ([1.6, 1.0], 20.0)
    """

    speeds_mm_s: tuple[float, ...] | None = None
    widths_mm: tuple[float, ...] | None = None
    formula: str | None = None
    a: float | None = None
    b: float | None = None

    def __post_init__(self) -> None:
        table, formula = (self.speeds_mm_s, self.widths_mm), (self.formula, self.a, self.b)
        if None not in table and formula == (None, None, None):
            _check_table(np.asarray(self.speeds_mm_s, dtype=np.float64), np.asarray(self.widths_mm, dtype=np.float64))
        elif None not in formula and table == (None, None):
            _check_formula(str(self.formula), float(self.a or 0.0), float(self.b or 0.0))
        else:
            given = [k for k in ("speeds_mm_s", "widths_mm", "formula", "a", "b") if getattr(self, k) is not None]
            raise InvalidInputError(
                "the kerf as a function of speed needs speeds_mm_s and widths_mm, or formula, a and b; got "
                f'{" and ".join(given) or "none of them"}; try formula = "a + b / v", a = 0.4, b = 12.0'
            )

    @property
    def range_mm_s(self) -> tuple[float, float]:
        """Least and greatest speed for which the kerf is known: 0 and ∞ for a formula."""
        return (0.0, np.inf) if self.speeds_mm_s is None else (self.speeds_mm_s[0], self.speeds_mm_s[-1])

    def width_mm(self, speed_mm_s: ArrayLike) -> FloatArray:
        """The kerf at speeds of any shape, mm; NaN outside `range_mm_s` and for NaN; ∞ at speed 0 of a formula.

        Accuracy: that of the formula, or of the table: at its speeds exact, and between them monotone.
        """
        speed = np.asarray(speed_mm_s, dtype=np.float64)
        known = (speed >= self.range_mm_s[0]) & (speed <= self.range_mm_s[1])
        width = np.full(speed.shape, np.nan)
        width[known] = self._width(speed[known])
        return width

    def speed_mm_s(self, width_mm: float) -> float:
        """The speed at which the kerf is `width_mm`; NaN if there is none in `range_mm_s`.

        Accuracy: the kerf there is `width_mm` to 1e-12 of itself.
        """
        a, b = self.a or 0.0, self.b or 0.0
        if self.formula == FORMULAS[0]:
            return b / (width_mm - a) if width_mm > a else np.nan
        if self.formula == FORMULAS[1]:
            return float((a / width_mm) ** (1.0 / b)) if width_mm > 0.0 else np.nan
        low, high = self.range_mm_s
        if not self.width_mm(high) <= width_mm <= self.width_mm(low):
            return np.nan
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.width_mm(middle) > width_mm else (low, middle)
        return 0.5 * (low + high)

    def _width(self, speed: FloatArray) -> FloatArray:
        """The kerf at known speeds."""
        if self.speeds_mm_s is None:
            a, b = self.a or 0.0, self.b or 0.0
            with np.errstate(divide="ignore"):
                return np.asarray(a + b / speed if self.formula == FORMULAS[0] else a * speed**-b)
        return np.asarray(self._table(speed))

    @cached_property
    def _table(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator  # takes a while to load

        return PchipInterpolator(self.speeds_mm_s, self.widths_mm)


def kerf_law(kerf: KerfJob) -> KerfLaw | None:
    """The law that a job gives; None if it gives none, so that the kerf is `blade.kerf_mm` at every speed.

    Raises:
        InvalidInputError: a law that is incomplete or contradicts itself, speeds that are not ascending.
    """
    law = {name: getattr(kerf, name) for name in ("speeds_mm_s", "widths_mm", "formula", "a", "b")}
    if not kerf.min_speed_mm_s < kerf.max_speed_mm_s:
        raise InvalidInputError(
            f"min_speed_mm_s = {kerf.min_speed_mm_s:g} must be below max_speed_mm_s = {kerf.max_speed_mm_s:g}"
        )
    return None if all(value is None for value in law.values()) else KerfLaw(**law)


def fit_blade_to_law(kerf: KerfJob, blade: BladeJob) -> KerfLaw | None:
    """The law of a job, if it agrees with the blade's own values: it must give the kerf at `blade.speed_mm_s`.

    Raises:
        InvalidInputError: a speed outside the law's or the job's range; a kerf that differs from the law's by more than
            `kerf.tolerance_mm`.
    """
    law = kerf_law(kerf)
    if law is None:
        return None
    low, high = max(kerf.min_speed_mm_s, law.range_mm_s[0]), min(kerf.max_speed_mm_s, law.range_mm_s[1])
    if not low <= blade.speed_mm_s <= high:
        raise InvalidInputError(
            f"blade.speed_mm_s = {blade.speed_mm_s:g} is outside the {low:g} … {high:g} mm/s for which [kerf] holds; "
            "try a speed in that range, or measure the kerf at more speeds"
        )
    width = float(law.width_mm(blade.speed_mm_s))
    if not abs(width - blade.kerf_mm) <= kerf.tolerance_mm:
        speed = law.speed_mm_s(blade.kerf_mm)
        other = f", or speed_mm_s = {speed:.4g}" if low <= speed <= high else ""
        raise InvalidInputError(
            f"blade.kerf_mm = {blade.kerf_mm:g}, but [kerf] gives {width:.4g} mm at blade.speed_mm_s = "
            f"{blade.speed_mm_s:g}, more than kerf.tolerance_mm = {kerf.tolerance_mm:g} away; try kerf_mm = {width:.4g}"
            f"{other}"
        )
    return law


def kerf_width_mm(job: CutJob, speed_mm_s: ArrayLike) -> FloatArray:
    """The kerf at speeds of any shape: by the job's law, or `blade.kerf_mm` at every speed. Shape, NaN, ∞ as there."""
    law = kerf_law(job.kerf)
    speed = np.asarray(speed_mm_s, dtype=np.float64)
    return np.where(np.isnan(speed), np.nan, job.blade.kerf_mm) if law is None else law.width_mm(speed)


def blade_offset_mm(job: CutJob) -> float:
    """How far the blade's surface lies above the design, along its upward normal: ± half the nominal kerf, or 0.

    Example:
        >>> from batten.fabrication.job import SurfaceJob
        >>> job = CutJob(SurfaceJob(), blade=BladeJob(kerf_mm=1.2), kerf=KerfJob(offset=True, side="lower"))
        >>> blade_offset_mm(job)  # the lower part is kept: the blade melts its way above it
        0.6
    """
    if not job.kerf.offset:
        return 0.0
    return 0.5 * job.blade.kerf_mm if job.kerf.side == "lower" else -0.5 * job.blade.kerf_mm


def offset_along_normal_mm(job: CutJob, surface: BSplineSurface) -> float:
    """`blade_offset_mm`, counted along S_u × S_v of a surface that is single-valued in z over its plan."""
    (u0, u1), (v0, v1) = surface.domain
    up = surface.normal(0.5 * (u0 + u1), 0.5 * (v0 + v1))[2]
    return blade_offset_mm(job) if up > 0.0 else 0.0 - blade_offset_mm(job)


class BladeSurface(NamedTuple):
    """The surface that the blade is to sweep, and how far it is to be continued (`extend`) to reach `CONTINUED` in all."""

    surface: BSplineSurface
    extend: float


def blade_surface(job: CutJob, surface: BSplineSurface) -> BladeSurface:
    """The surface that the blade is to sweep: the design's parallel one at half the kerf, the design itself without offset.

    Raises:
        InvalidInputError: a design that is creased or too strongly curved for it.
        ConvergenceError: its spline cannot come close enough.

    Accuracy: at most a hundredth of `leaves.tolerance_mm`, and 0.01 mm, from the true parallel surface.
    """
    offset = offset_along_normal_mm(job, surface)
    if offset == 0.0:
        return BladeSurface(surface, CONTINUED)
    within = min(_SURFACE_MM, _SURFACE_SHARE * job.leaves.tolerance_mm)
    return BladeSurface(parallel_surface(surface, offset, extend=CONTINUED, within=within).surface, 0.0)


def _check_table(speeds: FloatArray, widths: FloatArray) -> None:
    right = speeds.ndim == 1 and speeds.shape == widths.shape and len(speeds) >= 2
    if not (right and np.isfinite(speeds).all() and speeds[0] > 0.0 and (np.diff(speeds) > 0.0).all()):
        raise InvalidInputError(
            f"speeds_mm_s = {speeds.tolist()} with {widths.size} widths; needed are two or more speeds above 0, ascending, "
            "and as many widths_mm"
        )
    if not (np.isfinite(widths).all() and widths[-1] >= 0.0 and (np.diff(widths) < 0.0).all()):
        raise InvalidInputError(
            f"widths_mm = {widths.tolist()}; the kerf must become less from speed to speed, and be 0 or more"
        )


def _check_formula(formula: str, a: float, b: float) -> None:
    least_a = 0.0 if formula == FORMULAS[0] else np.nextafter(0.0, 1.0)
    if formula not in FORMULAS or not (least_a <= a < np.inf and 0.0 < b < np.inf):
        raise InvalidInputError(
            f'formula = "{formula}" with a = {a:g}, b = {b:g}; allowed are "{FORMULAS[0]}" with a ≥ 0 and "{FORMULAS[1]}" '
            "with a > 0, and b > 0"
        )
