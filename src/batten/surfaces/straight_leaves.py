"""Leaves that come near a straight line: finding them, and families of planes without any (Fisker2018 §5.4.3).

A rod in the shape of a line can give way to either side; it wobbles, and leaves a ridge. Solution 1 turns all planes by one
angle, Solution 2 turns them about two centres, so that the turn grows from the first border to the middle and falls again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import blade_directions, covering_offsets, intersect_planes, parallel_planes
from batten.surfaces.plane import Plane
from batten.typing import ArrayLike, BoolArray, FloatArray

_STATIONS = 65  # along each piece
_ALIKE = 1e-7  # radians: centres so far away that the planes count as parallel
_UP = np.array([0.0, 0.0, 1.0])


class Straightness(NamedTuple):
    """How far pieces of leaves are from straight, (m, c) each; NaN where no point of the piece counts.

    `bow`: greatest distance of the piece from the chord of its ends, in the surface's unit. `bend`: its greatest |κ| times
    its length, a pure number: what it would turn if it were as curved everywhere, so bow ≤ bend · length / 8.
    """

    bow: FloatArray
    bend: FloatArray


def leaf_straightness(
    surface: BSplineSurface,
    planes: Sequence[Plane],
    edges: ArrayLike,
    *,
    inside: Callable[[FloatArray], BoolArray] | None = None,
    extend: float = 0.25,
) -> Straightness:
    """Bow and curvature of every leaf between its borders: the detection of lines, before anything is fitted.

    Parameters:
        surface: single-valued along the planes' y axes.
        planes: m planes.
        edges: (m, c + 1), ascending abscissae of the borders in each plane, as for `rationalise`.
        inside: which points in space, (…, 3), make a piece count; all if None. A piece of which one point counts is
            measured as a whole, like the rod that cuts it.
        extend: how far the surface may be continued beyond its domain (see `BSplineSurface`).

    Returns:
        `Straightness`.

    Raises:
        InvalidInputError: edges of another shape or not ascending.

    Accuracy: 65 stations on each piece, exact heights and curvatures there.

    Degenerate: a piece that the surface does not reach over has NaN.

    Example:
        >>> fold = BSplineSurface([0, 0, 0, 4, 4, 4], [0, 0, 1, 1], 2, 1, [[(x, y, 0.5 * z * y) for y in (0, 1)]
        ...                       for x, z in ((0, 0), (2, 4), (4, 0))])  # z = y (x − x²/4): straight at y = 0
        >>> found = leaf_straightness(fold, parallel_planes("x", [0.0, 0.5, 1.0]), [[0.0, 4.0]] * 3)
        >>> found.bow.ravel().tolist(), found.bend.ravel().round(3).tolist()
        ([0.0, 0.5, 1.0], [0.0, 1.04, 2.296])
    """
    borders = np.asarray(edges, dtype=np.float64)
    if borders.ndim != 2 or len(borders) != len(planes) or borders.shape[1] < 2 or not (np.diff(borders) > 0).all():
        raise InvalidInputError(
            f"edges: got shape {borders.shape} for {len(planes)} planes; allowed is (planes, pieces + 1), ascending"
        )
    x = borders[:, :-1, None] + np.diff(borders)[..., None] * np.linspace(0.0, 1.0, _STATIONS)
    section = intersect_planes(surface, list(planes), x.reshape(len(x), -1), extend=extend)
    y, slope, curvature = (v.reshape(x.shape) for v in (section.y, section.slope, section.curvature))
    chord = np.stack([x[..., -1] - x[..., 0], y[..., -1] - y[..., 0]])
    across = (y - y[..., :1]) * chord[0][..., None] - (x - x[..., :1]) * chord[1][..., None]
    bow = np.abs(across).max(axis=-1) / np.hypot(*chord)
    length = np.trapezoid(np.sqrt(1.0 + slope**2), x, axis=-1)
    bend = np.abs(curvature).max(axis=-1) * length
    if inside is not None:
        points = np.stack([p.to_world(np.stack(pair, axis=-1)) for p, pair in zip(planes, zip(x, y))])
        none = ~inside(points).any(axis=-1)
        bow[none] = bend[none] = np.nan
    return Straightness(bow, bend)


def fan_planes(
    blade_axis: Literal["x", "y"],
    rectangle: ArrayLike,
    spacing: float,
    *,
    turn_rad: float,
    border_turn_rad: float = 0.0,
) -> tuple[Plane, ...]:
    """Vertical planes that turn about two centres, to the left of the front and to the right of the back of a rectangle in
    plan (Fisker2018 §5.4.3, Solution 2, Fig. 5.26d).

    Definition: the first family goes through one centre, the second through the other, and one plane, through the middle
    of the rectangle, belongs to both. From the front to this plane they turn one way, about the first centre, from there to
    the back the other way, about the second. All planes of a family meet in its centre alone, and the two families lie on
    either side of the common plane, so none cross in the rectangle. The angles `turn_rad` = α of the common plane and
    `border_turn_rad` = β of the first and last ones determine the centres: c = (D + 2W tan β − W tan α)/(2 (tan α − tan β))
    beside the rectangle and d = (W + c) tan β before it, W its width along the blade, D its depth. With β = 0 the borders
    are planes, and d = 0; with β = α the centres are infinitely far, and it is Solution 1, planes turned alike.

    Parameters:
        blade_axis: the wall axis along which the planes lie before they are turned.
        rectangle: [[x₀, y₀], [x₁, y₁]], least and greatest corner.
        spacing: greatest distance between neighbouring planes within the rectangle; towards the centre they come closer.
        turn_rad: α, |α| < π/2, counter-clockwise seen from above; the other sign takes the mirrored centres, right of the
            front and left of the back.
        border_turn_rad: β, between 0 and |α|; it has the sign of α.

    Returns:
        Planes from the front (low y for a blade along x, low x for one along y) to the back, with `x_axis` along the
        blade, x counted from the circle about the centre through the rectangle's middle.

    Raises:
        InvalidInputError: angles outside these bounds or so great that the centres would lie within the rectangle's width
            (tan α > (D + 2W tan β)/W); another axis, rectangle or spacing.

    Degenerate: α − β below 1e-7 gives parallel planes, those of `covering_offsets`.

    Example:
        >>> planes = fan_planes("x", [[0, 0], [6, 2]], 0.5, turn_rad=0.1)
        >>> [round(float(np.degrees(np.arctan2(p.x_axis[1], p.x_axis[0]))), 2) for p in planes]
        [0.0, 1.91, 3.82, 5.73, 3.82, 1.91, 0.0]
    """
    corners = np.asarray(rectangle, dtype=np.float64)
    covering_offsets(blade_axis, corners, spacing)  # checks all but the angles
    turn, border = abs(float(turn_rad)), float(border_turn_rad)
    if not (turn < 0.5 * np.pi and 0.0 <= border <= turn):
        raise InvalidInputError(
            f"turn_rad = {turn_rad}, border_turn_rad = {border_turn_rad}; allowed are turns below π/2 = 90°, and at the "
            f"borders from 0 to the size of the turn; try border_turn_rad = {0.5 * turn:g}"
        )
    centre = corners.mean(axis=0)
    if turn - border < _ALIKE:
        offsets = covering_offsets(blade_axis, corners, spacing, turn_rad=turn_rad)
        return parallel_planes(blade_axis, offsets, turn_rad=turn_rad, centre=centre)
    size = corners[1] - corners[0]
    width, depth = size if blade_axis == "x" else size[::-1]
    steep, slight = float(np.tan(turn)), float(np.tan(border))
    beside = (depth + 2.0 * width * slight - width * steep) / (2.0 * (steep - slight))
    if beside < 0.0:
        most = np.degrees(np.arctan((depth + 2.0 * width * slight) / width))
        raise InvalidInputError(
            f"a turn of {np.degrees(turn):g}° about centres beside a rectangle {width:g} wide and {depth:g} deep; allowed "
            f"are up to {most:.4g}° with {np.degrees(border):g}° at the borders; try that or turn the borders more"
        )
    before = (width + beside) * slight
    # From the first centre: how far the rectangle reaches within the first family, which the spacing has to serve.
    middle_end = min(width, 0.5 * (width + depth / steep)) + beside
    reach = max(middle_end / np.cos(turn), float(np.hypot(width + beside, before)))
    if middle_end < width + beside:  # the common plane leaves through the back: the corner behind it is farther
        reach = max(reach, float(np.hypot(width + beside, before + depth)))
    angles = np.linspace(border, turn, max(1, int(np.ceil((turn - border) * reach / spacing - 1e-9))) + 1)
    # In coordinates (along the blade, across it) about the middle; mirrored along for the other sense.
    first = np.array([-0.5 * width - beside, -0.5 * depth - before])
    radius = float(np.hypot(*first))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    origins = np.concatenate([first + radius * rays, (-first - radius * rays)[-2::-1]])
    axes = np.concatenate([rays, rays[-2::-1]])
    along, across = blade_directions(blade_axis)
    clockwise = (turn_rad < 0.0) != (blade_axis == "y")  # across is to the right of a blade along y
    mirror = np.array([-1.0, 1.0]) if clockwise else np.ones(2)
    frame = np.stack([along, across])
    # The mirrored blade direction points backwards: it is turned about.
    return tuple(
        Plane(np.append(centre + (mirror * o) @ frame, 0.0), np.append((mirror[0] * mirror * a) @ frame, 0.0), _UP)
        for o, a in zip(origins, axes)
    )


def plane_between(first: Plane, second: Plane) -> Plane:
    """The plane half-way between two neighbours: parallel ones, or two of one family of `fan_planes`, whose bisector it is.

    Example:
        >>> first, second, *_ = parallel_planes("x", [0.0, 10.0])
        >>> plane_between(first, second).origin.tolist()
        [0.0, 5.0, 0.0]
    """
    return Plane(
        0.5 * (first.origin + second.origin), 0.5 * (first.x_axis + second.x_axis), 0.5 * (first.y_axis + second.y_axis)
    )


@dataclass(frozen=True, eq=False)
class LeastTurn:
    """What `least_turn` found.

    Attributes:
        turn: the least turn that clears, or the one that comes nearest to it.
        clearance: there.
        clears: whether it is at least 1.
        tried: (k, 2), turns and clearances of the thorough tries, by turn.
    """

    turn: float
    clearance: float
    clears: bool
    tried: FloatArray


def least_turn(
    clearance: Callable[[float], float],
    *,
    step: float,
    most: float,
    unit: float,
    quick: Callable[[float], float] | None = None,
) -> LeastTurn:
    """The least turn, of either sense, at which a family of planes holds no straight leaf (Fisker2018 §5.4.3).

    Turns grow in steps, both senses at once, until one clears; then the step before it is bisected, and the other sense is
    asked for less. The answer is a multiple of a unit, so that it can be written down and used again.

    Parameters:
        clearance: of a turn, a pure number: 1 or more where it clears, for example the least bow over what is needed.
            NaN counts as 0.
        step: of the search outwards, > 0.
        most: greatest turn that is tried, ≥ 0.
        unit: the answer is a multiple of it; 0 < unit ≤ step.
        quick: a cheaper estimate of the clearance, by which the search outwards chooses what it tries thoroughly.

    Returns:
        `LeastTurn`; without one that clears, of all that were tried thoroughly the one of greatest clearance.

    Raises:
        InvalidInputError: step, most or unit outside these bounds.

    Accuracy: the next lesser multiple of the unit does not clear. A range of turns that clear can be missed if it is
    narrower than a step, or if `quick` denies it.

    Example:
        >>> found = least_turn(lambda degrees: degrees / 2.117, step=0.5, most=20.0, unit=0.01)
        >>> found.turn, found.clears
        (2.12, True)
    """
    if not (0.0 < unit <= step and 0.0 <= most < np.inf):
        raise InvalidInputError(
            f"unit = {unit}, step = {step}, most = {most}; allowed are 0 < unit ≤ step and a finite most from 0 on"
        )
    share = round(step / unit)
    seen: dict[int, float] = {}

    def thorough(k: int) -> float:
        if k not in seen:
            seen[k] = float(np.nan_to_num(clearance(round(k * unit, 12)), nan=0.0))
        return seen[k]

    def promises(k: int) -> bool:
        return quick is None or quick(round(k * unit, 12)) >= 1.0

    found: list[int] = [0] if thorough(0) >= 1.0 else []
    last, outer = int(np.floor(most / unit + 1e-9)), 0
    while not found and outer < last:
        inner, outer = outer, min(outer + share, last)
        for sense in (1, -1):
            low, high = inner, abs(found[0]) - 1 if found else outer  # the second sense has to do with less
            if high > low and promises(sense * high) and thorough(sense * high) >= 1.0:
                while high - low > 1:
                    middle = (low + high) // 2
                    low, high = (low, middle) if thorough(sense * middle) >= 1.0 else (middle, high)
                found.append(sense * high)
    best = min(found, key=abs) if found else max(seen, key=lambda k: (seen[k], -abs(k)))
    tried = np.array([(round(k * unit, 12), seen[k]) for k in sorted(seen)])
    return LeastTurn(round(best * unit, 12), seen[best], bool(found), tried)
