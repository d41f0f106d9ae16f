"""Elastica as Rhino's NURBS curves, the model that takes them, and .3dm files of curves in a plane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rhino3dm as _rhino3dm

from batten.curves.elastica import Elastica, states_along
from batten.errors import FormatError
from batten.io.drawn_curve import LAYERS, DrawnCurve, Unit
from batten.surfaces.plane import Plane
from batten.typing import FloatArray

rhino3dm: Any = _rhino3dm  # its own stubs call read-only what can be written, and leave out much

_MOST_PIECES = 4096
_COLOURS = {"stable": (0, 90, 200), "unstable": (200, 60, 40)}


def write_curves_3dm(curves: Sequence[DrawnCurve], path: str | Path, tolerance: float, unit: Unit = None) -> None:
    """Curves of the plane as a .3dm file, in the plane z = 0: NURBS on the layers `stable` and `unstable`.

    Every object bears its curve's name and user texts.

    Parameters:
        curves: the curves.
        path: the file; it appears whole or not at all, and replaces an earlier one.
        tolerance: greatest distance from the elastica, in the curves' unit, above 0.
        unit: "mm", or None for a file without a unit.

    Raises:
        FormatError: Rhino's library calls a geometry invalid, or a curve would need more than 4096 cubics; nothing is
            written then.
        OSError: the file cannot be written.

    Accuracy: the curves are C¹ cubic NURBS within the tolerance of the elastica, their parameter is the arc length up to
    the tolerance, and their ends and end tangents are exact.

    Example:
        >>> import tempfile
        >>> arc = DrawnCurve(1, Elastica((0, 0), 0.0, 1.0, (0, 0), 3.0), True, {"energy": "3"})
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_curves_3dm([arc], Path(folder) / "arc.3dm", 1e-6)
        ...     model = rhino3dm.File3dm.Read(str(Path(folder) / "arc.3dm"))
        >>> [item.Geometry.IsValid for item in model.Objects], [layer.Name for layer in model.Layers]
        ([True], ['stable', 'unstable'])
    """
    draw = Drawing({layer: _COLOURS[layer] for layer in LAYERS}, unit)
    plane = Plane(np.zeros(3), np.eye(3)[0], np.eye(3)[1])
    nurbs = nurbs_curves([curve.elastica for curve in curves], [plane] * len(curves), 0.9 * tolerance)
    for curve, geometry in zip(curves, nurbs):
        draw.add(curve.layer, curve.name, geometry, curve.texts)
    draw.write(Path(path))


class Drawing:
    """A Rhino model that takes valid geometry only.

    Parameters:
        colours: the layers to make, in this order, and their red, green and blue, 0 … 255.
        unit: "mm", or None for a model without a unit.
    """

    def __init__(self, colours: Mapping[str, tuple[int, int, int]], unit: Unit) -> None:
        self.model = rhino3dm.File3dm()
        self.model.ApplicationName = "batten"
        units = rhino3dm.UnitSystem
        self.model.Settings.ModelUnitSystem = units.Millimeters if unit == "mm" else getattr(units, "None")
        self.layers: dict[str, int] = {}
        for name, colour in colours.items():
            layer = rhino3dm.Layer()
            layer.Name = name
            layer.Color = (*colour, 255)
            self.layers[name] = self.model.Layers.Add(layer)

    def add(
        self, layer: str, name: str, geometry: Any, texts: Mapping[str, str], colour: tuple[int, int, int] | None = None
    ) -> None:
        """Put a geometry on a layer, with its name, its user texts, and a colour of its own or the layer's.

        Raises:
            FormatError: Rhino's library calls it invalid.
        """
        if geometry is None or not geometry.IsValid:
            log = "no geometry" if geometry is None else " ".join(geometry.IsValidWithLog[1].split())
            raise FormatError(f"{layer}: {name} is not valid for Rhino ({log}); it cannot be written")
        attributes = rhino3dm.ObjectAttributes()
        attributes.LayerIndex = self.layers[layer]
        attributes.Name = name
        for key, value in texts.items():
            attributes.SetUserString(key, value)
        if colour is not None:
            attributes.ColorSource = rhino3dm.ObjectColorSource.ColorFromObject
            attributes.ObjectColor = (*colour, 255)
        self.model.Objects.Add(geometry, attributes)

    def write(self, path: Path) -> None:
        """Write the model as a file of Rhino 7; it appears whole or not at all.

        Raises:
            OSError: the file cannot be written.
        """
        part = path.with_name(f".{path.name}.part")
        try:
            if not self.model.Write(str(part), 7):
                raise OSError(f"{path}: cannot be written; is the folder there, writable and not full?")
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def nurbs_curves(rods: Sequence[Elastica], planes: Sequence[Plane], stray: float) -> list[Any]:
    """Elastica as C¹ cubic NURBS in space whose parameter is the arc length, up to `stray`.

    The cubic on a piece of length h keeps both end points and unit tangents; it strays by h⁴/384 · |γ⁗| at most, and
    most in its middle, where that is measured. As many pieces are taken as this needs.

    Parameters:
        rods: the elastica, in the coordinates of their planes. planes: one for each.
        stray: greatest distance in the middle of a cubic, in the elastica's unit, above 0.

    Returns:
        A `rhino3dm.NurbsCurve` for each; None where 4096 cubics are not enough, which `Drawing.add` refuses.
    """
    parameters = np.array([rod.parameters for rod in rods]).reshape(-1, 7)
    result: list[Any] = [None] * len(rods)
    pieces, pending = np.full(len(rods), 4), np.arange(len(rods))
    while len(pending):
        count = int(pieces[pending].min())
        some = pending[pieces[pending] == count]
        s = parameters[some, 6:] * np.linspace(0.0, 1.0, 2 * count + 1)
        controls, error = _cubics(states_along(parameters[some], s), s[:, 2])
        done = ~(error > stray)  # what is not finite is found by Rhino's own check
        for i, knots, control in zip(some[done].tolist(), s[done, ::2], controls[done]):
            result[i] = _nurbs_curve(np.repeat(knots, 2), planes[i].to_world(control))
        more = np.ceil(count * (error[~done] / stray) ** 0.25)
        pieces[some[~done]] = np.maximum(more, count + 1).astype(np.int64)
        pending = np.flatnonzero([curve is None for curve in result])
        pending = pending[pieces[pending] <= _MOST_PIECES]
    return result


def _cubics(states: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Control points (n, 2 c + 2, 2) of c cubics each, and how far they stray (n,), from states at 2 c + 1 even stations.

    `step`, (n,), is the length of a cubic.
    """
    points, ends = states[:, 1::2, :2], states[:, ::2, :2]
    arms = np.stack([np.cos(states[:, ::2, 2]), np.sin(states[:, ::2, 2])], axis=-1) * (step / 3.0)[:, None, None]
    first, second = ends[:, :-1] + arms[:, :-1], ends[:, 1:] - arms[:, 1:]
    middle = (ends[:, :-1] + 3.0 * first + 3.0 * second + ends[:, 1:]) / 8.0
    inner = np.stack([first, second], axis=2).reshape(len(states), -1, 2)
    stray = np.linalg.norm(middle - points, axis=-1).max(axis=1)
    return np.concatenate([ends[:, :1], inner, ends[:, -1:]], axis=1), stray


def _nurbs_curve(double_knots: FloatArray, points: FloatArray) -> Any:
    """A cubic NurbsCurve over knots that come twice each, at the ends once more."""
    curve = rhino3dm.NurbsCurve.CreateControlPointCurve([rhino3dm.Point3d(*point) for point in points.tolist()], 3)
    knots = curve.Knots
    for i, knot in enumerate([*double_knots[:1].tolist(), *double_knots.tolist(), *double_knots[-1:].tolist()]):
        knots[i] = knot
    return curve
