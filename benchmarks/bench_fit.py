"""The elastica closest to a cubic Bézier, two thousand times: ours against Ipopt and scipy, from the same start on one core.

Curves: control points uniform in the unit disc, and the annulus sample of Fisker2018 §3.2 (end points (0, 0), (1, 0),
inner control points in the annuli of radii 0.25 and 1.5 about them). All minimise the normalised L² distance over the
same 32 Gauss nodes with free ends, from the canonical initial guess of Brander2016.

Ours fits all 2,000; the peers take a sample of them, their time is scaled up. Ipopt (through casadi) works on a symbolic
elastica with exact first and second derivatives. scipy's `least_squares` (trust region, tolerances 1e-12) runs twice: as
one would write it with scipy alone, on the closed form through `scipy.special` with the Jacobian that it takes itself; and
lent our points and analytic Jacobian, so that it measures the way around the kernel, not the kernel.

How good the fits are, with held ends and against several starts of Ipopt too, is proof_fit.py's to say.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from bench_elastica import scipy_points
from scipy.optimize import least_squares

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.solvers.curve_samples import CurveSamples, samples_of
from batten.solvers.elastica_fit import fit_elastica_batch
from batten.solvers.elastica_fit_ipopt import fit_elastica_ipopt
from batten.solvers.initial_guess import initial_elastica

COUNT, BY_IPOPT, BY_SCIPY = 2000, 40, 100


def unit_disc(count: int, seed: int = 1) -> np.ndarray:
    """Cubics with control points uniform in the unit disc, (count, 4, 2)."""
    rng = np.random.default_rng(seed)
    radius, angle = np.sqrt(rng.random((count, 4))), 2 * np.pi * rng.random((count, 4))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def annuli(count: int, seed: int = 2) -> np.ndarray:
    """Fisker2018 §3.2: inner control points uniform in annuli about (0, 0) and (1, 0), the second in the upper half."""
    rng = np.random.default_rng(seed)
    radius = np.sqrt(rng.uniform(0.25**2, 1.5**2, (count, 2)))
    angle = np.pi * rng.random((count, 2)) * [2, 1]
    out = np.zeros((count, 4, 2))
    out[:, 3, 0] = 1.0
    out[:, 1] = radius[:, :1] * np.column_stack([np.cos(angle[:, 0]), np.sin(angle[:, 0])])
    out[:, 2] = out[:, 3] + radius[:, 1:] * np.column_stack([np.cos(angle[:, 1]), np.sin(angle[:, 1])])
    return out


def by_scipy_alone(samples: CurveSamples, start: np.ndarray) -> float:
    """The same with scipy alone: the closed form of bench_elastica.py, Jacobian by differences."""
    length, fractions, points = samples.lengths[0], samples.fractions[0], samples.points[0]
    weight = np.sqrt(samples.weights[0] / length**3)[:, None]
    unit = np.array([length, length, 1.0, 1 / length, 1 / length**2, 1 / length**2, length])

    def residuals(p: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            there = scipy_points(p[None], fractions)[0]
        return np.nan_to_num((weight * (there - points)).ravel(), nan=1e3)

    bounds = ([-np.inf] * 6 + [min(0.05 * length, 0.5 * start[6])], np.inf)
    found = least_squares(
        residuals, start, bounds=bounds, x_scale=unit, ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=500
    )
    return float(np.sqrt(2 * found.cost))


def by_least_squares(samples: CurveSamples, start: np.ndarray) -> float:
    """The normalised L² distance that scipy's trust region reaches."""
    length, fractions, points = samples.lengths[0], samples.fractions[0], samples.points[0]
    weight = np.sqrt(samples.weights[0] / length**3)[:, None]
    unit = np.array([length, length, 1.0, 1 / length, 1 / length**2, 1 / length**2, length])

    def residuals(p: np.ndarray) -> np.ndarray:
        return (weight * (Elastica.from_parameters(p).point_at(fractions * p[6]) - points)).ravel()

    def jacobian(p: np.ndarray) -> np.ndarray:
        curve, s = Elastica.from_parameters(p), fractions * p[6]
        out = curve.jacobian_at(s)
        angle = curve.angle_at(s)
        out[..., 6] = fractions[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return (weight[:, :, None] * out).reshape(-1, 7)

    bounds = ([-np.inf] * 6 + [min(0.05 * length, 0.5 * start[6])], np.inf)
    found = least_squares(
        residuals, start, jacobian, bounds, x_scale=unit, ftol=1e-12, xtol=1e-12, gtol=1e-12, max_nfev=500
    )
    return float(np.sqrt(2 * found.cost))


def _each(curves: np.ndarray, solve: Callable[[CurveSamples, np.ndarray], float]) -> tuple[list[float], np.ndarray]:
    """Seconds and distances of a solver that takes one curve after the other; samples and starts are not timed."""
    spent, out = [], np.full(len(curves), np.nan)
    for i, control in enumerate(curves):
        samples, _ = samples_of(control)
        try:
            start = initial_elastica(samples).elastica.parameters
        except InvalidInputError:  # no canonical guess
            continue
        begin = time.perf_counter()
        out[i] = solve(samples, start)
        spent.append(time.perf_counter() - begin)
    return spent, out


def _compared(ours: np.ndarray, theirs: np.ndarray) -> str:
    both = np.isfinite(ours) & np.isfinite(theirs)
    ratio = ours[both] / theirs[both]
    exact = ours[both] < 1e-12
    worse, better = np.mean((ratio > 1 + 1e-9) & ~exact), np.mean(ratio < 1 - 1e-9)
    return f"on {both.sum()} curves ours ends closer in {better:.0%}, farther in {worse:.0%}"


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    rows: list[dict[str, object]] = []
    fit_elastica_batch(unit_disc(2), starts=1)  # compiled, or read from the cache, before anything is timed
    peers = (
        ("casadi-Ipopt, exact derivatives", BY_IPOPT, lambda c, s: fit_elastica_ipopt(c, s).distance),
        ("scipy alone: least_squares on scipy.special", BY_SCIPY, by_scipy_alone),
        ("scipy least_squares, lent our points and Jacobian", BY_SCIPY, by_least_squares),
    )
    for name, curves in (("unit disc", unit_disc(COUNT)), ("annuli", annuli(COUNT))):
        begin = time.perf_counter()
        ours = fit_elastica_batch(curves, starts=1)
        ours_s = time.perf_counter() - begin
        for peer, count, solve in peers:
            solve(*_start(curves[0]))  # builds the nonlinear program
            spent, theirs = _each(curves[:count], solve)
            peer_s = float(np.mean(spent)) * COUNT
            rows.append(
                {
                    "what": f"fit of {COUNT:,} Béziers, {name}, from one start",
                    "ours_s": ours_s,
                    "peer": f"{peer} ({count} fits, scaled)",
                    "peer_s": peer_s,
                    "ratio": peer_s / ours_s,
                    "note": f"{1e6 * ours_s / COUNT:.0f} µs a fit, the peer's median {1e3 * np.median(spent):.0f} ms; "
                    + _compared(ours.distance[:count], theirs),
                }
            )
    return rows


def _start(control: np.ndarray) -> tuple[CurveSamples, np.ndarray]:
    samples, _ = samples_of(control)
    return samples, initial_elastica(samples).elastica.parameters


if __name__ == "__main__":
    for row in run():
        print(row)
