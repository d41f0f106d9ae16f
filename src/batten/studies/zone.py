"""The study of the projection zone Π: how large e_λ is where all constraints hold, Brander2018 §5.1, §5.3."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from batten.kernels.bezier_criteria import ZONE_BORDER
from batten.measures.lambda_class import BEST_BELOW, GOOD_BELOW
from batten.measures.lambda_residual import lambda_residual
from batten.solvers.bezier_criteria import ANGLE_LIMITS, BezierCriteria, bezier_criteria
from batten.studies.study import Columns, Outcome, Study
from batten.typing import BoolArray, FloatArray

DEFAULT_SIZE = 10_700_000
"""As in Brander2018 §5.3."""

PAPER_MAXIMUM = 0.393
PAPER_BELOW_03 = 0.98
"""Brander2018 §5.3, §6: maximum of e_λ; share below 0.3 of what was projected into Π."""

LEVELS = (0.5, 0.9, 0.99, 0.999, 0.9999)
"""Quantiles that are printed."""

_SHARPENED = 200
_GENERATIONS, _CHILDREN = 120, 40
"""Of the local search about the largest: it has a fixed number of steps."""


@dataclass(frozen=True, eq=False)
class ZonePart:
    """Some curves of the study, all constraints satisfied.

    Attributes:
        inner: (n, 2, 2), p₁ and p₂ in standard position, p₀ = (0, 0), p₃ = (1, 0).
        phi: (n, 2), φ₁ and φ₂.
        residual: (n,), e_λ.
    """

    inner: NDArray[np.float32]
    phi: NDArray[np.float32]
    residual: NDArray[np.float32]


def zone_beziers(count: int, rng: np.random.Generator) -> FloatArray:
    """Random cubics in standard position that satisfy all constraints of `is_elastica_like`: (count, 4, 2).

    (β₁, β₂) is uniform in angle constraints 1 and 2, and L₁, L₂ uniform in [Lmin, Lmax] of edge-length constraint 1
    (Brander2018 §5.1); what then breaks another constraint is drawn again, 45 % of them.
    """
    least, most = ANGLE_LIMITS
    found: list[FloatArray] = []
    missing = count
    while missing:
        beta = rng.uniform(least, 2.0 * math.pi - least, (4 * missing + 16, 2))
        beta = beta[np.abs(beta[:, 0] - beta[:, 1]) < most]
        # Any lengths give the limits; those then give lengths.
        limits = bezier_criteria(_placed(beta, np.ones_like(beta))).edge_limits
        share = rng.random(beta.shape)
        control = _placed(beta, limits[:, :1] + share * (limits[:, 1:] - limits[:, :1]))
        control = control[_satisfied(bezier_criteria(control))][:missing]
        found.append(control)
        missing -= len(control)
    return np.concatenate(found) if found else np.empty((0, 4, 2))


def _placed(beta: FloatArray, edges: FloatArray) -> FloatArray:
    """Control points in standard position from β and the lengths of the outer edges, (…, 2) each."""
    control = np.zeros((*beta.shape[:-1], 4, 2))
    control[..., 3, 0] = 1.0
    control[..., 1, 0] = -edges[..., 0] * np.cos(beta[..., 0])
    control[..., 1, 1] = edges[..., 0] * np.sin(beta[..., 0])
    control[..., 2, 0] = 1.0 + edges[..., 1] * np.cos(beta[..., 1])
    control[..., 2, 1] = edges[..., 1] * np.sin(beta[..., 1])
    return control


def _satisfied(found: BezierCriteria) -> BoolArray:
    """All constraints, as `is_elastica_like`."""
    within = found.angles_1 & found.angles_2 & found.lengths_1 & found.lengths_2
    return np.asarray(within & found.simple & found.in_zone)


def run_part(seed: int, part: int, count: int) -> ZonePart:
    """One part of the study."""
    control = zone_beziers(count, np.random.default_rng([seed, part]))
    phi = bezier_criteria(control).phi
    return ZonePart(
        control[:, 1:3].astype(np.float32), phi.astype(np.float32), lambda_residual(control).astype(np.float32)
    )


def sharpened(inner: FloatArray | NDArray[np.float32], seed: int = 0) -> tuple[FloatArray, float]:
    """The largest e_λ with all constraints that a local search about given curves finds: (control points (4, 2), e_λ).

    An evolution strategy in (β₁, β₂, log L₁, log L₂) from each curve: 120 times 40 normally distributed steps, of which
    the best is taken if it is inside and better; steps grow by 1.5 then and shrink by 0.7 else. The maximum lies where
    several constraints hold with equality, so that a gradient would lead out at once.

    Parameters:
        inner: p₁ and p₂ of the curves to start from, in standard position, shape (k, 2, 2), k ≥ 1. seed: of the steps.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> start = zone_beziers(1000, rng)
        >>> largest = lambda_residual(start).max()
        >>> control, value = sharpened(start[:, 1:3])
        >>> bool(largest < value), round(value, 3)
        (True, 0.412)
    """
    rng = np.random.default_rng(seed)
    control = np.zeros((len(inner), 4, 2))
    control[:, 3, 0] = 1.0
    control[:, 1:3] = inner
    found = bezier_criteria(control)
    place = np.concatenate([found.beta, np.log(found.edges)], axis=-1)
    # Rounding to float32 may have put a curve just outside.
    value = np.where(_satisfied(found), lambda_residual(control, tolerance=1e-10), -1.0)
    step = np.full(len(place), 0.02)
    rows = np.arange(len(place))
    for _ in range(_GENERATIONS):
        children = place[:, None] + step[:, None, None] * rng.standard_normal((len(place), _CHILDREN, 4))
        control = _placed(children[..., :2], np.exp(children[..., 2:]))
        values = np.full(control.shape[:2], -1.0)
        inside = _satisfied(bezier_criteria(control))
        values[inside] = lambda_residual(control[inside], tolerance=1e-10)
        best = values.argmax(axis=1)
        better = values[rows, best] > value
        place[better], value[better] = children[rows, best][better], values[rows, best][better]
        step *= np.where(better, 1.5, 0.7)
    top = int(value.argmax())
    return _placed(place[top, :2], np.exp(place[top, 2:])), float(value[top])


def zone_border(count: int = 100) -> FloatArray:
    """Points (φ₁, φ₂) on the border of Π, `count` on each of its sixteen pieces, closed: Brander2018 §5.1.

    The spline is that of `bezier_criteria`.

    Example:
        >>> border = zone_border(1)
        >>> border.shape, border[0].round(12).tolist(), border[2].round(2).tolist()
        ((17, 2), [1.05, 1.05], [3.14, 1.35])
    """
    t = np.arange(count) / count
    across, along = np.einsum("pcd,td->cpt", ZONE_BORDER, t[:, None] ** np.arange(4)).reshape(2, -1)
    middle = np.array([[0.0], [ZONE_BORDER[-1, 1].sum()]])
    half = np.stack([across, along])
    # From the corner with φ₁ = φ₂ to that with φ₁ + φ₂ = 2π, to the other with φ₁ = φ₂, and back by symmetry.
    half = np.concatenate([half, middle, half[:, :0:-1] * [[-1.0], [1.0]]], axis=1)
    across, along = np.concatenate([half, -half, half[:, :1]], axis=1)
    return np.stack([math.pi + 0.5 * (along - across), math.pi - 0.5 * (across + along)], axis=-1)


def lines(outcome: Outcome[ZonePart]) -> list[str]:
    """What the study prints: how large e_λ is where all constraints hold, and where it is largest.

    The paper's 0.393 is the maximum over its points, from which it concludes e_λ ≤ 0.4 in all of Π. That is not quite so:
    in a corner where L₁ = Lmin, and (φ₁, φ₂) on the border of Π near (1.3, 1.99), or a mirror image, e_λ rises to 0.4117,
    whatever the parameter of the border's spline. About one in two million of our curves lies there above 0.4, so a sample
    may miss it. Quantiles depend on how the "densely distributed" points were drawn, which the paper does not say.
    """
    results = outcome.results
    values = results.residual
    largest = np.argpartition(values, -min(_SHARPENED, len(values)))[-_SHARPENED:]
    control, value = sharpened(results.inner[largest], outcome.seed)
    above = int(np.count_nonzero(values >= np.float32(GOOD_BELOW)))
    out = [
        f"{outcome.size:,} Béziers that satisfy all constraints, (φ₁, φ₂) in Π (seed {outcome.seed}): λ-residual",
        "(Brander2018 §5.1, §5.3); end directions uniform within the angle constraints, edge lengths within theirs",
        "",
        f"{'':<22}{'ours':>10}{'paper':>10}",
        f"{'mean':<22}{values.mean(dtype=np.float64):>10.4f}",
    ]
    out += [f"{f'quantile {q:.2%}':<22}{v:>10.4f}" for q, v in zip(LEVELS, np.quantile(values, LEVELS))]
    out += [
        f"{'below 0.22':<22}{(values < np.float32(BEST_BELOW)).mean():>10.3%}",
        f"{'below 0.3':<22}{(values < np.float32(0.3)).mean():>10.3%}{PAPER_BELOW_03:>10.0%}",
        f"{'curves from 0.4 on':<22}{above:>10,}{0:>10}",
        f"{'maximum, sampled':<22}{values.max():>10.4f}{PAPER_MAXIMUM:>10}",
        f"{'maximum, sharpened':<22}{value:>10.4f}{'<= 0.4':>10}",
        "",
        f"the sharpened maximum, {value:.6f} by a local search about the {len(largest)} largest, lies at",
    ]
    return [*out, *_where(control)]


def _where(control: FloatArray) -> list[str]:
    found = bezier_criteria(control)
    low, high = found.edge_limits
    p1, p2 = control[1], control[2]
    return [
        f"  p₁ = ({p1[0]:.4f}, {p1[1]:.4f}), p₂ = ({p2[0]:.4f}, {p2[1]:.4f}) between (0, 0) and (1, 0), up to symmetry",
        f"  β = {found.beta[0]:.4f}, {found.beta[1]:.4f}, φ = {found.phi[0]:.4f}, {found.phi[1]:.4f}, "
        f"{'with' if found.inflectional else 'without'} an inflection",
        f"  L = {found.edges[0]:.4f}, {found.edges[1]:.4f} in [{low:.4f}, {high:.4f}]",
    ]


def columns(part: ZonePart) -> Columns:
    """Inner control points in standard position, inner angles, λ-residual."""
    points = {f"p{i + 1}_{axis}": part.inner[:, i, j] for i in range(2) for j, axis in enumerate("xy")}
    return {**points, "phi_1": part.phi[:, 0], "phi_2": part.phi[:, 1], "lambda_residual": part.residual}


STUDY = Study("zone", 100_000, ZonePart, run_part, lines, columns)
"""Curves with all constraints, end directions and edge lengths uniform."""
