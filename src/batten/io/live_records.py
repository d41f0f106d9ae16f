"""Lines of a live stream: a line with both ends of a rod becomes a pose, what was found a line. No state, no waiting.

Every line is one JSON object. Numbers come back bit by bit; an infinite one is the text "Infinity", one that does not exist
`null`: plain JSON has neither.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from batten.curves.elastica import Elastica
from batten.errors import FormatError, InvalidInputError
from batten.fabrication.rod import Rod
from batten.io.bend_numbers import bent_rod
from batten.typing import ArrayLike, FloatArray

LONGEST_LINE = 65536
"""Bytes that a line may have."""

SHOWN = 200
"""Characters of a wrong line that an error record repeats."""

_EXAMPLE = '{"start": [0, 0, 0.4], "end": [0.8, 0, -0.4]}'
_FIELDS = ("start", "end", "id", "t", "wrap")
_MOST_ANGLE = 1e6
_DEEPEST = 32
_MOST_POINTS = 10_000


class Ends(NamedTuple):
    """Both ends of a rod: positions and tangent angles, in the order that a tracker takes."""

    start_x: float
    start_y: float
    start_angle: float
    end_x: float
    end_y: float
    end_angle: float


@dataclass(frozen=True)
class LivePose:
    """A line that was understood.

    Attributes:
        ends: positions, and angles in radians with their turns.
        echo: the fields `id` and `t`, those that came, to be sent back.
        wrap: whether the angles are taken to the turn nearest to those before.
        line: the line's first characters, `SHOWN` at most, for the error if it cannot be followed.
    """

    ends: Ends
    echo: Mapping[str, Any]
    wrap: bool = True
    line: str = ""


@dataclass(frozen=True)
class LiveError:
    """A line that cannot be followed.

    Attributes:
        message: what came, what is allowed, what to try.
        line: the line's first characters, `SHOWN` at most.
        echo: the fields `id` and `t` of a pose that was understood but could not be followed.
    """

    message: str
    line: str
    echo: Mapping[str, Any]


class Snap(Protocol):
    """What `batten.solvers.track.Snap` offers."""

    @property
    def fraction(self) -> float:
        """Where between the pose before and this one the rod lost its shape, 0 to 1."""

    @property
    def pose(self) -> FloatArray:
        """The ends at that moment, shape (6,)."""

    @property
    def before(self) -> Elastica:
        """The shape that was lost."""

    @property
    def after(self) -> Elastica:
        """The shape that the rod fell into."""

    @property
    def energy_released(self) -> float:
        """Difference of their energies ∫κ² ds."""


class Tracked(Protocol):
    """What `batten.solvers.track.TrackedPose` offers."""

    @property
    def elastica(self) -> Elastica:
        """The rod's shape."""

    @property
    def energy(self) -> float:
        """∫κ² ds."""

    @property
    def margin(self) -> float:
        """The first conjugate length over the length: above 1 stable; infinite if there is none."""

    @property
    def stable(self) -> bool:
        """Whether the rod stays there by itself."""

    @property
    def snap(self) -> Snap | None:
        """The snap on the way from the pose before; None without."""


class Tracker(Protocol):
    """What `batten.solvers.track.RodTracker` offers: it follows one rod from pose to pose."""

    def move(self, pose: ArrayLike) -> Tracked:
        """The rod's shape at the next pose (6,); an error of `batten.errors` leaves everything as it was."""


@dataclass(frozen=True)
class RecordStyle:
    """What all records of a stream share.

    Parameters:
        length: the rod's, above 0; mm where a rod is given.
        points: how many points of the shape a record has, 2 to 10000, at equal steps of arc length, both ends included.
        rod: for N, J and strains; None without.

    Raises:
        InvalidInputError: a value outside these bounds.
    """

    length: float
    points: int = 33
    rod: Rod | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.length) and self.length > 0.0):
            raise InvalidInputError(f"length = {self.length!r}; allowed are finite numbers above 0")
        if not 2 <= self.points <= _MOST_POINTS:
            raise InvalidInputError(f"points = {self.points!r}; allowed are 2 to {_MOST_POINTS} for each shape; try 33")


def parse_line(line: bytes, length: float) -> LivePose | LiveError:
    """A line as a pose, or as the error that it is; nothing is raised, whatever the bytes are.

    A pose is `{"start": [x, y, angle], "end": [x, y, angle]}`, with, if wanted, `id` (any JSON, nested at most 30 deep), `t`
    (a number) and `wrap` (true or false).

    Parameters:
        line: without its end; at most `LONGEST_LINE` bytes.
        length: the rod's; ends farther apart are an error.

    Example:
        >>> parse_line(b'{"start": [0, 0, 0.5], "end": [3, 4, -0.5], "id": 7}', 6.0).ends[3:]
        (3.0, 4.0, -0.5)
        >>> print(parse_line(b'{"start": [0, 0, 0.5], "end": [3, 4, -0.5]}', 4.0).message)
        the ends are 5 apart and the rod is only 4 long; bring the ends together or take a longer rod
    """
    text = line.decode("utf-8", errors="replace").removeprefix("\ufeff")
    try:
        if len(line) > LONGEST_LINE:
            raise FormatError(f"the line has more than {LONGEST_LINE} bytes; a pose has about 100: try {_EXAMPLE}")
        return replace(_pose(_fields(line, text), length), line=text[:SHOWN])
    except (FormatError, InvalidInputError) as error:
        return LiveError(str(error), text[:SHOWN], {})


def unwrapped(pose: LivePose, last: LivePose | None) -> LivePose:
    """The pose with its angles turned by whole turns to be the nearest to those of the last one, unless it says no.

    Degenerate: without a last pose, the angles stay as they are.

    Example:
        >>> first, second = (LivePose(Ends(0, 0, 0, 1, 0, angle), {}) for angle in (3.1, -3.1))
        >>> round(unwrapped(second, first).ends.end_angle, 3)
        3.183
    """
    if last is None or not pose.wrap:
        return pose
    ends, before = pose.ends, last.ends
    start, end = _nearest(ends.start_angle, before.start_angle), _nearest(ends.end_angle, before.end_angle)
    if (start, end) == (ends.start_angle, ends.end_angle):
        return pose
    return replace(pose, ends=ends._replace(start_angle=start, end_angle=end))


def pose_record(pose: LivePose, tracked: Tracked, style: RecordStyle, n: int, dropped: int = 0) -> dict[str, Any]:
    """What is told of a pose that was followed; `lag_ms` is for the one who sends it.

    Fields: `id` and `t` as they came, `n`, `elastica` (the seven numbers of `Elastica.parameters`), `points` [[x, y], …],
    `energy` ∫κ² ds, `force` [λ₁, λ₂], `moments` [κ(0), κ(L)], `margin`, `stable`, `snap` (null, or `fraction`, `pose`,
    `energy_released`, `before` and `after` as seven numbers each), `dropped`. With a rod, its `force_n` [x, y] (what the
    gripper at the start exerts; the one at the end exerts the opposite), `moments_nmm` (EI·κ at both ends), `energy_j`,
    `strain` (the greatest), `strain_ok`, and `energy_released_j` in `snap`.

    Parameters:
        pose: with the angles that were followed.
        tracked: what the tracker found.
        style: what all records share.
        n: the line's number.
        dropped: how many stale poses were left out since the record before.
    """
    curve, snap, rod = tracked.elastica, tracked.snap, style.rod
    record: dict[str, Any] = {
        **pose.echo,
        "n": n,
        "elastica": _numbers(curve.parameters),
        "points": curve.point_at(np.linspace(0.0, curve.length, style.points)).tolist(),
        "energy": _number(tracked.energy),
        "force": _numbers(curve.force),
        "moments": _numbers(curve.curvature_at([0.0, curve.length])),
        "margin": _number(tracked.margin),
        "stable": bool(tracked.stable),
        "snap": None if snap is None else _snap(snap, rod),
        "dropped": dropped,
    }
    if rod is not None:
        bent = bent_rod(curve, rod)
        record["force_n"] = _numbers(bent.force_n)
        record["moments_nmm"] = _numbers((bent.moment_start_nmm, bent.moment_end_nmm))
        record["energy_j"] = _number(bent.energy_j)
        record["strain"] = _number(bent.strain)
        record["strain_ok"] = not bent.too_strained
    return record


def error_record(error: LiveError, n: int, unreported: int = 0) -> dict[str, Any]:
    """What is told of a line that cannot be followed: `error`, `line`, `n`; `id` and `t` where they are known.

    Parameters:
        error: the error.
        n: the line's number.
        unreported: how many errors just before had no record of their own, since nobody took them in time; where there
            are any, the record has a field of this name.
    """
    record = {**error.echo, "n": n, "error": error.message, "line": error.line}
    return record | {"unreported": unreported} if unreported else record


def line_of(record: Mapping[str, Any]) -> str:
    """A record as one line of ASCII, without its end.

    Example:
        >>> line_of({"n": 1, "margin": "Infinity", "snap": None})
        '{"n":1,"margin":"Infinity","snap":null}'
    """
    return json.dumps(record, allow_nan=False, separators=(",", ":"))


def _fields(line: bytes, text: str) -> dict[str, Any]:
    """The object that the line is; nothing is nested deeper than `_DEEPEST`, so that all that follows can go down it."""
    try:
        line.decode("utf-8")
        data = json.loads(text, parse_float=_finite, parse_constant=_no_constant)
    except UnicodeDecodeError as error:
        raise FormatError(f"not UTF-8 text: {error.reason} at byte {error.start}; try {_EXAMPLE}") from error
    except RecursionError as error:
        raise FormatError(f"nested too deep; allowed are {_DEEPEST} levels; try {_EXAMPLE}") from error
    except ValueError as error:
        raise FormatError(f"not JSON: {' '.join(str(error).split())[:SHOWN]}; a line is like {_EXAMPLE}") from error
    if not isinstance(data, dict):
        raise FormatError(f"a JSON {type(data).__name__} came; a line is an object like {_EXAMPLE}")
    level: list[Any] = [data]
    for _ in range(_DEEPEST):
        level = [v for part in level for v in (part.values() if isinstance(part, dict) else part)]
        level = [v for v in level if isinstance(v, dict | list)]
        if not level:
            return data
    raise FormatError(f"nested too deep; allowed are {_DEEPEST} levels; try {_EXAMPLE}")


def _pose(data: Mapping[str, Any], length: float) -> LivePose:
    unknown = [name for name in data if name not in _FIELDS]
    if unknown:
        raise FormatError(
            f"unknown field {_shown(unknown[0])}; allowed are {', '.join(_FIELDS)}; put anything else into id"
        )
    ends = Ends(*_end(data, "start"), *_end(data, "end"))
    if "t" in data:
        _real(data["t"], "t", "a number, such as the time in seconds; try 0.02")
    wrap = data.get("wrap", True)
    if not isinstance(wrap, bool):
        raise FormatError(f"wrap = {_shown(wrap)}; allowed are true and false")
    chord = math.dist(ends[:2], ends[3:5])
    if not chord <= length:
        raise InvalidInputError(
            f"the ends are {chord:.9g} apart and the rod is only {length:.9g} long; bring the ends together or take a "
            "longer rod"
        )
    return LivePose(ends, {name: data[name] for name in ("id", "t") if name in data}, wrap)


def _end(data: Mapping[str, Any], name: str) -> tuple[float, float, float]:
    if name not in data:
        raise FormatError(f"{name} is missing; a line is like {_EXAMPLE}")
    value = data[name]
    if not (isinstance(value, list) and len(value) == 3):
        raise FormatError(f"{name} = {_shown(value)}; allowed are three numbers [x, y, angle]; try [0.8, 0, -0.4]")
    x, y, angle = (_real(v, f"{name}[{i}]", "finite numbers; try [0.8, 0, -0.4]") for i, v in enumerate(value))
    if abs(angle) > _MOST_ANGLE:
        raise InvalidInputError(f"{name}[2] = {angle!r}; allowed are radians from -1e6 to 1e6; take whole turns away")
    return x, y, angle


def _real(value: Any, name: str, allowed: str) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError as error:
            raise FormatError(f"{name} = {_shown(value)}: too large; allowed are {allowed}") from error
    raise FormatError(f"{name} = {_shown(value)}; allowed are {allowed}")


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:60] + "…"


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:30]} is larger than numbers can be")
    return value


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON number")


def _nearest(angle: float, before: float) -> float:
    turns = round((angle - before) / math.tau)
    return angle - turns * math.tau if turns else angle


def _snap(snap: Snap, rod: Rod | None) -> dict[str, Any]:
    told: dict[str, Any] = {
        "fraction": _number(snap.fraction),
        "pose": _numbers(snap.pose),
        "energy_released": _number(snap.energy_released),
        "before": _numbers(snap.before.parameters),
        "after": _numbers(snap.after.parameters),
    }
    if rod is not None:
        told["energy_released_j"] = _number(0.5e-3 * rod.bending_stiffness_nmm2 * float(snap.energy_released))
    return told


def _numbers(values: ArrayLike) -> list[float | str | None]:
    return [_number(v) for v in np.asarray(values, dtype=np.float64).tolist()]


def _number(value: float) -> float | str | None:
    value = float(value)
    if math.isfinite(value):
        return value
    return None if math.isnan(value) else "Infinity" if value > 0.0 else "-Infinity"
