"""Points on ten thousand elastica: ours against the closed form through scipy.special, on one core and on the same input.

The peer is what a careful user would write: Brander2016 §2.2 with `ellipj` (which gives sn, cn, dn and the amplitude at
once) and `ellipeinc`, vectorised over everything, the incomplete integrals of the start once a curve. On a few of the
curves both are then held against the tests' 30-digit reference: the closed form as printed, x = 2E(s) − s and y = 2k(1
− cn s), loses digits for small and for large k and near k = 1. Errors are relative to the length.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from pathlib import Path

import numpy as np
from scipy.special import ellipeinc, ellipj, ellipkinc

from batten.curves.elastica import points_batch

CURVES, POINTS, CHECKED = 10_000, 64, 90


def scipy_points(parameters: np.ndarray, fractions: np.ndarray) -> np.ndarray:
    """Points (n, m, 2) of elastica in force form (n, 7) by scipy.special; force ≠ 0."""
    x0, y0, angle, curvature, force_x, force_y, length = parameters.T
    root = np.sqrt(np.hypot(force_x, force_y))
    phi = np.arctan2(force_y, force_x)
    half = (angle - phi) / 2
    half -= np.pi * np.round(half / np.pi)
    k_sn, k_cn = np.sin(half), curvature / (2 * root)
    k = np.hypot(k_sn, k_cn)
    bends = k < 1  # with inflections
    sign = np.where(bends, 1.0, np.sign(k_cn))
    m = np.where(bends, k * k, 1 / (k * k))
    rate = root * np.where(bends, 1.0, k)
    start = np.where(bends, np.arctan2(k_sn, k_cn), half * sign)
    u = ellipkinc(start, m)[:, None] + rate[:, None] * length[:, None] * fractions
    _, cn, dn, amplitude = ellipj(u, m[:, None])
    epsilon = ellipeinc(amplitude, m[:, None]) - ellipeinc(start, m)[:, None]
    du = rate[:, None] * length[:, None] * fractions
    k, bends = k[:, None], bends[:, None]
    along = np.where(bends, 2 * epsilon - du, (1 / k - 2 * k) * du + 2 * k * epsilon)
    cn0, dn0 = np.cos(start)[:, None], np.sqrt(1 - m * np.sin(start) ** 2)[:, None]
    across = 2 * k * np.where(bends, cn0 - cn, sign[:, None] * (dn0 - dn))
    cos, sin = (np.cos(phi) / root)[:, None], (np.sin(phi) / root)[:, None]
    return np.stack([x0[:, None] + along * cos - across * sin, y0[:, None] + along * sin + across * cos], axis=-1)


def ordinary(count: int, seed: int = 1) -> np.ndarray:
    """Segments as a design holds them, of length about 1: with and without inflections, (count, 7)."""
    rng = np.random.default_rng(seed)
    force, direction = rng.uniform(0.5, 60, count), rng.uniform(-np.pi, np.pi, count)
    columns = [np.zeros(count), np.zeros(count), rng.uniform(-np.pi, np.pi, count), rng.uniform(-10, 10, count)]
    return np.column_stack(
        [*columns, force * np.cos(direction), force * np.sin(direction), rng.uniform(0.5, 1.5, count)]
    )


def degenerate(count: int, seed: int = 2) -> np.ndarray:
    """Near lines, near circles and near k = 1, a third each, (count, 7)."""
    rng = np.random.default_rng(seed)
    p = ordinary(count, seed)
    kind = np.arange(count) % 3
    small = 10 ** rng.uniform(-8, -3, count)
    direction = np.arctan2(p[:, 5], p[:, 4])
    line, circle, one = (kind == i for i in range(3))
    p[line, 2] = direction[line] + small[line]
    p[line, 3] = small[line]
    p[circle, 4:6] *= small[circle, None]
    half = (p[:, 2] - direction) / 2
    p[one, 3] = 2 * np.sqrt(np.hypot(p[:, 4], p[:, 5]))[one] * np.cos(half)[one] * (1 + small[one] ** 2)
    return p


def _reference(parameters: np.ndarray, fractions: np.ndarray) -> np.ndarray:
    """The same points to 30 digits, rounded: the Taylor series that the tests use."""
    path = Path(__file__).parents[1] / "tests" / "reference" / "elastica_reference.py"
    spec = importlib.util.spec_from_file_location("elastica_reference", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    out = np.empty((len(parameters), len(fractions), 2))
    for row, points in zip(parameters, out, strict=True):
        s = [float(row[6] * fraction) for fraction in fractions]
        found = module.reference_points(row[2], row[3], (row[4], row[5]), s, derivatives=False)
        points[:] = [(row[0] + float(p.x), row[1] + float(p.y)) for p in found]
    return out


def _seconds(function, *args, repeat: int = 5) -> tuple[float, np.ndarray]:
    best = np.inf
    for _ in range(repeat):
        start = time.perf_counter()
        value = function(*args)
        best = min(best, time.perf_counter() - start)
    return best, value


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    fractions = np.linspace(0.0, 1.0, POINTS)
    points_batch(ordinary(2), fractions)  # compiled, or read from the cache, before anything is timed
    rows: list[dict[str, object]] = []
    for name, parameters in (("ordinary", ordinary(CURVES)), ("near lines, circles and k = 1", degenerate(CURVES))):
        ours_s, ours = _seconds(points_batch, parameters, fractions)
        with np.errstate(all="ignore"):
            peer_s, peer = _seconds(scipy_points, parameters, fractions)
        few, some = slice(0, CHECKED), slice(7, None, 8)
        exact = _reference(parameters[few], fractions[some])
        off = [np.linalg.norm(value[few, some] - exact, axis=-1) / parameters[few, 6:] for value in (ours, peer)]
        failed = int((~np.isfinite(peer)).any(axis=(1, 2)).sum())
        rows.append(
            {
                "what": f"{POINTS} points on each of {CURVES:,} elastica, {name}",
                "ours_s": ours_s,
                "peer": "scipy.special: ellipj, ellipeinc",
                "peer_s": peer_s,
                "ratio": peer_s / ours_s,
                "note": f"{1e9 * ours_s / CURVES / POINTS:.0f} ns a point; largest error on {CHECKED} of them: ours "
                f"{off[0].max():.0e}, peer {np.nanmax(off[1]):.0e}" + (f"; {failed} curves NaN" if failed else ""),
            }
        )
    return rows


if __name__ == "__main__":
    for row in run():
        print(row)
