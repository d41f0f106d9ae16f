"""Projections of 100,000 cubic Béziers within the angle constraints: ours against numpy, on one core, on the same input.

The peer is the feedback projection as a careful user of numpy would write it: all curves at once, way by way and step
by step, with masks for those that have left the first way, and the vectorised λ-residual of `bench_lambda_residual`
with two rules: 24 Gauss nodes where they are sure to do, the same on 2, 4, … dyadic panels elsewhere, as ours decides
it, so that both take the same steps. Times are those of the processor, so that what else runs on the machine does not
count. "nearest" has no peer; its rows say what a curve costs.
"""

from __future__ import annotations

import importlib.util
import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from batten.kernels.quadrature import panel_condition
from batten.solvers.bezier_criteria import bezier_criteria
from batten.solvers.bezier_projection import project_bezier

COUNT = 100_000
STEPS = 11


def _sibling(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_residuals = _sibling("bench_lambda_residual")


def _needed_panels(control: np.ndarray, condition: float) -> np.ndarray:
    """Equal panels, a power of two, with which every one has the zeros of γ' outside its ellipse."""
    z = control[..., 0] + 1j * control[..., 1]
    a, b, c = z[:, 1] - z[:, 0], z[:, 2] - z[:, 1], z[:, 3] - z[:, 2]
    second, half = a - 2.0 * b + c, b - a
    root = np.sqrt(half * half - second * a)
    root = np.where((root * np.conj(half)).real < 0.0, -root, root)
    q = -half - root
    out = np.ones(len(control), dtype=np.int64)
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = np.stack([q / second, a / q])
    zeros = np.where(np.isfinite(zeros), zeros, 1e30)
    for level in range(7):
        panels = 1 << level
        bad = np.zeros(len(control), dtype=bool)
        for r in zeros:
            nearest = np.clip(np.floor(r.real * panels), 0, panels - 1)
            u = (r.real * panels - nearest - 0.5) * 2.0
            v = r.imag * panels * 2.0
            bad |= u * u / condition**2 + v * v / (condition**2 - 1.0) < 1.0
        out[bad] = panels * 2
    return out


def numpy_lambda_residual(control: np.ndarray) -> np.ndarray:
    """e_λ within 1e-6 but for near-cusps: 24 nodes for most, as many equal panels of 24 as are needed for others."""
    needed = _needed_panels(control, panel_condition(1e-6))
    out = np.empty(len(control))
    for panels in np.unique(needed):
        rows = needed == panels
        out[rows] = _panels_residual(control[rows], int(panels))
    return out


def _panels_residual(control: np.ndarray, panels: int) -> np.ndarray:
    if panels == 1:
        return np.asarray(_residuals.numpy_lambda_residual(control))
    x, w = np.polynomial.legendre.leggauss(24)
    t = ((np.arange(panels)[:, None] + 0.5 * (x + 1.0)) / panels).ravel()
    w = np.tile(0.5 * w / panels, panels)
    u = 1.0 - t
    value = np.stack([u**3, 3 * t * u**2, 3 * t**2 * u, t**3])
    slope = 3.0 * np.stack([u**2, 2 * t * u, t**2])
    cross = 18.0 * np.stack([u**2, t * u, t**2])
    out = np.empty(len(control))
    chunk = max(16, _residuals.CHUNK // panels)
    for start in range(0, len(control), chunk):
        p = control[start : start + chunk]
        p = p - p[:, :1]
        d = np.diff(p, axis=1)
        xs, ys = p[..., 0] @ value, p[..., 1] @ value
        ds = np.hypot(d[..., 0] @ slope, d[..., 1] @ slope)
        q = np.stack([d[:, i, 0] * d[:, j, 1] - d[:, i, 1] * d[:, j, 0] for i, j in ((0, 1), (0, 2), (1, 2))], axis=1)
        k = (q @ cross) / ds**3
        ds *= w
        length = ds.sum(axis=1, keepdims=True)
        xs -= (ds * xs).sum(axis=1, keepdims=True) / length
        ys -= (ds * ys).sum(axis=1, keepdims=True) / length
        r = k - (ds * k).sum(axis=1, keepdims=True) / length
        xx, xy, yy = (ds * xs * xs).sum(1), (ds * xs * ys).sum(1), (ds * ys * ys).sum(1)
        xk, yk = (ds * xs * r).sum(1), (ds * ys * r).sum(1)
        det = xx * yy - xy * xy
        r -= ((xk * yy - yk * xy) / det)[:, None] * xs + ((xx * yk - xy * xk) / det)[:, None] * ys
        out[start : start + chunk] = np.sqrt((ds * r * r).sum(1) / (ds * k * k).sum(1))
    return out


def _fitted(t1: np.ndarray, t2: np.ndarray) -> np.ndarray:
    f = (
        0.00001475 * np.exp(10.39 * t1 - 10.48 * t2)
        + 0.4574 * t1 * np.exp(1.711 * t1 - 2.535 * t2)
        + 2.772 * t2 * np.exp(-0.08504 * t1 - 0.9109 * t2)
        - 0.2957 * t1 * t2 * np.exp(-0.6606 * t1)
    )
    return np.maximum(0.12, f)


def _both_ways(e1: np.ndarray, e2: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Whether the control polygon turns to both sides; e₁, e₂ unit vectors as complex numbers, lengths (n, 2)."""
    middle = 1.0 + length[:, 1] * e2 - length[:, 0] * e1
    phi1 = np.angle(-middle * np.conj(e1)) % (2 * math.pi)
    phi2 = np.angle(e2 * np.conj(middle)) % (2 * math.pi)
    return ((phi2 <= math.pi) & (math.pi <= phi1)) | ((phi1 <= math.pi) & (math.pi <= phi2))


def numpy_feedback(control: np.ndarray) -> np.ndarray:
    """Brander2018 §6 with threshold 0 for curves within the angle constraints: control points (n, 4, 2)."""
    z = control[..., 0] + 1j * control[..., 1]
    chord = z[:, 3] - z[:, 0]
    e1, e2 = (z[:, 1] - z[:, 0]) / chord, (z[:, 2] - z[:, 3]) / chord
    drawn = np.stack([np.abs(e1), np.abs(e2)], axis=1)
    e1, e2 = e1 / drawn[:, 0], e2 / drawn[:, 1]
    n = len(z)
    # Edges that cross are made shorter.
    cross = (np.conj(e1) * e2).imag
    meet = np.stack([e2.imag, e1.imag], axis=1) / cross[:, None]
    meet[(meet < 0.0).any(axis=1)] = np.inf
    factor = 0.99 * (meet / drawn).max(axis=1)
    length = np.where((drawn >= meet).all(axis=1)[:, None], drawn * factor[:, None], drawn)
    # Lmax; with an outer edge on each side of the chord it is 0.58.
    theta1, theta2 = np.angle(e1), np.angle(e2)
    beta1, beta2 = (math.pi - theta1) % (2 * math.pi), theta2 % (2 * math.pi)
    above, below = np.maximum(beta1, beta2) <= math.pi, np.minimum(beta1, beta2) >= math.pi
    delta = np.where(above, 1.0 - (beta1 + beta2) / math.pi, np.where(below, (beta1 + beta2) / math.pi - 3.0, -1.0))
    longest = np.maximum(1.2 * (1.0 + 5.0 * delta), 0.58)
    # Where the second way ends.
    flip = theta1 < 0.0
    theta1, theta2 = np.where(flip, -theta1, theta1), np.where(flip, -theta2, theta2)
    image = (theta2 < 0.0) & (theta1 - theta2 < math.pi)
    theta1, theta2 = np.where(image, math.pi + theta2, theta1), np.where(image, theta1 - math.pi, theta2)
    last = np.stack([_fitted(theta1, theta2), _fitted(math.pi - theta2, math.pi - theta1)], axis=1)
    last[image] = last[image][:, ::-1]

    best = np.full(n, np.inf)
    found = length.copy()
    way_start, way_end, way_t = length.copy(), last.copy(), np.zeros(n)

    def look(rows: np.ndarray, start: np.ndarray, end: np.ndarray, t: np.ndarray) -> None:
        """Take what is better at t (n,) of the way of these rows; `start`, `end` of all rows."""
        here = (1.0 - t)[:, None] * start[rows] + t[:, None] * end[rows]
        p = np.zeros((len(rows), 4, 2))
        p[:, 1, 0], p[:, 1, 1] = here[:, 0] * e1.real[rows], here[:, 0] * e1.imag[rows]
        p[:, 2, 0], p[:, 2, 1] = 1.0 + here[:, 1] * e2.real[rows], here[:, 1] * e2.imag[rows]
        p[:, 3, 0] = 1.0
        e = numpy_lambda_residual(p)
        better = (e < best[rows] - 1e-9) & (here < meet[rows]).any(axis=1)
        at = rows[better]
        best[at], found[at] = e[better], here[better]
        way_start[at], way_end[at], way_t[at] = start[at], end[at], t[better]

    clipped = np.minimum(longest[:, None], np.maximum(0.27, length))
    rows = np.flatnonzero(_both_ways(e1, e2, clipped))
    second = np.ones(n, dtype=bool)
    second[rows] = False
    begin = length.copy()
    begin[rows] = clipped[rows]
    short = np.full((n, 2), 0.27)
    for j in range(STEPS):
        t = np.full(len(rows), j * 0.1)
        here = (1.0 - t)[:, None] * clipped[rows] + t[:, None] * 0.27
        stay = _both_ways(e1[rows], e2[rows], here)
        second[rows[~stay]] = True
        begin[rows[~stay]] = here[~stay]
        rows = rows[stay]
        look(rows, clipped, short, t[stay])
    rows = np.flatnonzero(second)
    for j in range(STEPS):
        look(rows, begin, last, np.full(len(rows), j * 0.1))
    rows = np.arange(n)
    start, end, centre = way_start.copy(), way_end.copy(), way_t.copy()
    for j in range(STEPS):
        look(rows, start, end, np.clip(centre - 0.1 + 0.02 * j, 0.0, 1.0))
    out = control.copy()
    scale = found / drawn
    out[:, 1] = control[:, 0] + scale[:, :1] * (control[:, 1] - control[:, 0])
    out[:, 2] = control[:, 3] + scale[:, 1:] * (control[:, 2] - control[:, 3])
    return out


def curves(count: int = COUNT, seed: int = 1) -> np.ndarray:
    """Cubics with control points uniform in the unit disc that meet both angle constraints."""
    control = _residuals.unit_disc(2 * count + 1000, seed)
    found = bezier_criteria(control)
    return np.ascontiguousarray(control[found.angles_1 & found.angles_2][:count])


def _seconds(function: Any, *args: Any, repeat: int = 2, **keywords: Any) -> tuple[float, Any]:
    best, value = np.inf, None
    for _ in range(repeat):
        start = time.process_time()
        value = function(*args, **keywords)
        best = min(best, time.process_time() - start)
    return best, value


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    control = curves()
    project_bezier(control[:2])  # compiled, or read from the cache, before anything is timed
    ours_s, ours = _seconds(project_bezier, control)
    peer_s, peer = _seconds(numpy_feedback, control)
    apart = np.abs(ours.control_points - peer).max(axis=(1, 2))
    table = [
        {
            "what": f"feedback projection of {COUNT:,} cubics",
            "ours_s": ours_s,
            "peer": "numpy, vectorised",
            "peer_s": peer_s,
            "ratio": peer_s / ours_s,
            "note": f"{1e6 * ours_s / COUNT:.1f} µs a cubic; control points within 1e-6 for {(apart < 1e-6).mean():.3%}",
        }
    ]
    some = np.ascontiguousarray(_residuals.unit_disc(COUNT // 5, 2))
    for name, options in (
        ("nearest, least e_λ", {}),
        ("nearest, e_λ ≤ 0.22, keep tangents", {"threshold": 0.22}),
        ("nearest, e_λ ≤ 0.22, keep points", {"threshold": 0.22, "keep": "points"}),
        ("nearest, e_λ ≤ 0.22, keep nothing", {"threshold": 0.22, "keep": "nothing"}),
    ):
        project_bezier(some[:2], "nearest", **options)
        ours_s, _ = _seconds(project_bezier, some, "nearest", **options)
        table.append(
            {
                "what": f"{name}: {len(some):,} wholly random cubics",
                "ours_s": ours_s,
                "peer": "–",
                "peer_s": None,
                "ratio": None,
                "note": f"{1e6 * ours_s / len(some):.0f} µs a cubic",
            }
        )
    return table


if __name__ == "__main__":
    for row in run():
        print(row)
