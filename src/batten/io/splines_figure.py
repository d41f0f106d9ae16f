"""The page of pictures of the study of splines: every kind through the same points, with curvature combs."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from batten.errors import NoSolutionError
from batten.splines.interpolating_spline import InterpolatingSpline
from batten.studies.spline_measures import curvature_and_slope, makers
from batten.studies.splines import SplineSample
from batten.studies.study import Outcome
from batten.typing import FloatArray

_CURVE, _COMB, _POINTS = "#1f5fa8", "#d24a12", "#222222"
_TITLES = {
    "euler": "Euler spiral",
    "mec": "MEC",
    "log-aesthetic": "log-aesthetic, 1.78",
    "kurgla1": "kurgla 1",
    "hobby": "Hobby",
    "circle": "circle spline",
    "ikarus": "Ikarus",
    "lagrange": "cubic Lagrange",
    "si-mec": "SI-MEC",
}

WAVE: FloatArray = np.array([[0.0, 0.0], [0.9, 0.7], [2.0, 0.1], [2.6, 0.7], [3.7, 0.4]])
"""An open design."""

RING: FloatArray = np.array([[0.0, 0.1], [0.9, -0.35], [2.1, 0.0], [2.3, 0.9], [1.2, 1.25], [0.2, 1.0]])
"""A closed design."""


def figure(outcome: Outcome[SplineSample]) -> Figure:
    """Two designs, open and closed, by every method; the comb stands on the outside, its height is the curvature."""
    every = makers()
    drawing = Figure(figsize=(10.5, 11.0), layout="constrained")
    FigureCanvasAgg(drawing)
    for axes, (name, make) in zip(drawing.subplots(3, 3).ravel(), every.items()):
        for points, closed, shift in ((WAVE, False, 2.05), (RING, True, 0.0)):
            try:
                spline = make(points, closed)
            except NoSolutionError:
                axes.plot(points[:, 0], points[:, 1] + shift, "o", color=_POINTS, markersize=3.5)
                continue
            draw_with_comb(axes, spline, np.array([0.7 if closed else 0.0, shift]))
        axes.set_title(_TITLES[name], fontsize=11)
        axes.set_aspect("equal")
        axes.set_xlim(-0.45, 4.15)
        axes.set_ylim(-0.8, 3.45)
        axes.axis("off")
    return drawing


def draw_with_comb(axes: Any, spline: InterpolatingSpline, shift: FloatArray, scale: float = 0.16) -> None:
    """A spline, its points and its curvature comb, moved by `shift`; teeth are `scale` × curvature long, to the right."""
    t = np.linspace(0.0, 1.0, 33)
    t[0], t[-1] = 1e-9, 1.0 - 1e-9
    teeth, tips = [], []
    for segment in spline.segments:
        place = segment.point(t) + shift
        tangent = segment.derivative(t)
        _, kappa, _ = curvature_and_slope(segment, t)
        normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / np.hypot(*tangent.T)[:, None]
        tip = place + scale * kappa[:, None] * normal
        teeth += list(np.stack([place[::2], tip[::2]], axis=1))
        tips.append(tip)
        axes.plot(place[:, 0], place[:, 1], color=_CURVE, linewidth=1.6)
    axes.add_collection(LineCollection(teeth, colors=_COMB, linewidths=0.4, alpha=0.6))
    line = np.concatenate(tips)
    axes.plot(line[:, 0], line[:, 1], color=_COMB, linewidth=0.8)
    axes.plot(*(spline.points + shift).T, "o", color=_POINTS, markersize=3.5, zorder=3)
