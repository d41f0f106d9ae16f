"""Writes elastica_table.json: elastica of every kind, hard ones above all, to 35 digits.

Run from anywhere (about four minutes on one core):  python tests/reference/make_elastica_table.py

The only source is elastica_reference.py beside this file: Taylor series of the differential equation in 62-digit
integer arithmetic. Elliptic functions serve here only to *choose* parameters of a wanted modulus and phase; what is
stored are the rounded doubles, taken as exact by the reference.
"""

from __future__ import annotations

import json
import math
import random
import sys
from pathlib import Path

import mpmath

sys.path.insert(0, str(Path(__file__).parent))
from elastica_reference import ReferencePoint, reference_points

HERE = Path(__file__).parent
Case = dict[str, object]
Vector = tuple[float, float]


def case(
    group: str, angle: float, curvature: float, force: Vector, length: float, rng: random.Random, **more: object
) -> Case:
    """One input, shifted off the origin in every other case, with three arc lengths."""
    start = (0.0, 0.0) if rng.random() < 0.5 else (length * rng.uniform(-5, 5), length * rng.uniform(-5, 5))
    s = sorted((length * rng.uniform(0.02, 0.6), length * rng.uniform(0.6, 0.98), length))
    numbers = [*start, float(angle), float(curvature), float(force[0]), float(force[1]), float(length)]
    return {"group": group, "input": numbers, "s": s, **more}


def anywhere(rng: random.Random) -> float:
    """A length between 1e-6 and 1e6."""
    return 10 ** rng.uniform(-6, 6)


def of_modulus(
    group: str, k: mpmath.mpf, phase: float, periods: float, rng: random.Random, length: float | None = None
) -> Case:
    """A rotated, scaled elastica of modulus k, mirrored at random; `phase` in quarter periods."""
    with mpmath.workdps(60):
        if k < 1:
            quarter = mpmath.ellipk(k * k)
            u0 = quarter * mpmath.mpf(phase)
            half_sin = k * mpmath.ellipfun("sn", u0, k=k)
            rate = 2 * k * mpmath.ellipfun("cn", u0, k=k)
            angle = 2 * mpmath.asin(half_sin)
            span = 4 * quarter * periods
        else:
            quarter = mpmath.ellipk(1 / (k * k))
            sn, cn, dn = (mpmath.ellipfun(f, quarter * mpmath.mpf(phase), k=1 / k) for f in ("sn", "cn", "dn"))
            angle, rate = 2 * mpmath.atan2(sn, cn), 2 * k * dn
            span = 2 * quarter / k * periods
        scale = mpmath.mpf(length if length is not None else anywhere(rng)) / span
        mirror = rng.choice((-1, 1))
        phi = rng.uniform(-math.pi, math.pi)
        size = 1 / scale**2
        return case(
            group,
            float(mirror * angle + phi),
            float(mirror * rate / scale),
            (float(size * mpmath.cos(phi)), float(size * mpmath.sin(phi))),
            float(scale * span),
            rng,
            modulus=mpmath.nstr(k, 20),
        )


def lines(rng: random.Random) -> list[Case]:
    out = [case("line", rng.uniform(-3, 3), 0.0, (0.0, 0.0), anywhere(rng), rng) for _ in range(6)]
    for load in (1e-12, 1e-3, 1.0, 9.8696044010893586, 39.478417604357434, 400.0, 1e4):
        for sign in (-1.0, 1.0):
            length = anywhere(rng)
            name = "line in tension" if sign < 0 else "line in compression"
            out.append(case(name, 0.0, 0.0, (sign * load / length**2, 0.0), length, rng))
            out.append(case(name, math.pi / 2, 0.0, (0.0, sign * min(load, 400.0) / length**2), length, rng))
    return out


def circles(rng: random.Random) -> list[Case]:
    turns = [10 ** rng.uniform(-3, 1) * rng.choice((-1, 1)) for _ in range(26)] + [1.0, -1.0, 0.5, 10.0]
    return [
        case("circle", rng.uniform(-3, 3), 2 * math.pi * t / length, (0.0, 0.0), length, rng)
        for t in turns
        for length in (anywhere(rng),)
    ]


def near_lines(rng: random.Random) -> list[Case]:
    out = []
    for exponent in range(-13, -1):
        for load in (0.0, 10 ** rng.uniform(-3, 1), 10 ** rng.uniform(1, 3)):
            length, phi = anywhere(rng), rng.uniform(-3, 3)
            tilt = rng.choice((0.0, 1.0, -1.0)) * 10.0**exponent * rng.random()
            axis = phi + rng.choice((0.0, math.pi))
            force = (load / length**2 * math.cos(axis), load / length**2 * math.sin(axis))
            out.append(case("near line", phi + tilt, rng.choice((-1, 1)) * 10.0**exponent / length, force, length, rng))
    return out


def near_circles(rng: random.Random) -> list[Case]:
    out = []
    for exponent in (
        -300,
        -200,
        -100,
        -60,
        -40,
        -30,
        -24,
        -20,
        -18,
        -17,
        -16,
        -15,
        -14,
        -13,
        -12,
        -11,
        -10,
        -9,
        -8,
        -7,
        -6,
        -5,
        -4,
    ):
        for turns in (10 ** rng.uniform(-3, -0.5), rng.uniform(0.3, 10)):
            length, phi = (anywhere(rng), rng.uniform(-3, 3)) if exponent > -200 else (1.0, rng.uniform(-3, 3))
            size = 10.0**exponent / length**2
            curvature = rng.choice((-1, 1)) * 2 * math.pi * turns / length
            force = (size * math.cos(phi), size * math.sin(phi))
            out.append(case("near circle", rng.uniform(-3, 3), curvature, force, length, rng))
    return out


def moduli(rng: random.Random) -> list[Case]:
    out = []
    for _ in range(44):
        k = mpmath.mpf(10 ** rng.uniform(-8, -0.01))
        out.append(of_modulus("inflectional", k, rng.uniform(-2, 2), 10 ** rng.uniform(-2, 1), rng))
    for _ in range(44):
        k = mpmath.mpf(10 ** rng.uniform(0.01, 8))
        out.append(of_modulus("non-inflectional", k, rng.uniform(-2, 2), 10 ** rng.uniform(-2, 1), rng))
    for k in ("1e-8", "1e8", "0.5", "2", "0.9089085575", "0.70710678118654752"):
        out.append(of_modulus("ten periods", mpmath.mpf(k), rng.uniform(-2, 2), 10.0, rng))
    return out


def near_one(rng: random.Random) -> list[Case]:
    out = []
    with mpmath.workdps(60):
        for sign in (-1, 1):
            for exponent in [*range(1, 17), *range(9, 17), 12, 12, 12, 13, 14, 15]:
                k = 1 + sign * mpmath.mpf(10) ** -exponent * mpmath.mpf(rng.uniform(0.2, 1))
                phase = rng.choice((rng.uniform(-2, 2), rng.uniform(-0.2, 0.2), 1 + rng.uniform(-0.05, 0.05)))
                out.append(of_modulus("near one", k, phase, 10 ** rng.uniform(-2, 0.3), rng))
        for sign in (-1, 1):
            for exponent in (3, 12, 14):
                k = 1 + sign * mpmath.mpf(10) ** -exponent
                out.append(of_modulus("near one, ten periods", k, rng.uniform(-2, 2), 10.0, rng))
    return out


def separatrix(rng: random.Random) -> list[Case]:
    """k = 1: κ₀ = 2√λ cos((θ₀−φ)/2), exactly with θ₀ = φ = 0, and as nearly as doubles allow elsewhere."""
    out = []
    for length in (1e-3, 1.0, 3.0, 8.0, 20.0, 30.0):
        for sign in (-2.0, 2.0):
            scale = 2.0 ** rng.randint(-18, 18)
            out.append(case("separatrix", 0.0, sign / scale, (1.0 / scale**2, 0.0), length * scale, rng))
    for length in (0.5, 2.0, 5.0, 10.0, 15.0, 30.0):
        for _ in range(3):
            phi, tilt, scale = rng.uniform(-3, 3), rng.uniform(-3.1, 3.1), anywhere(rng)
            curvature = rng.choice((-2, 2)) * math.cos(tilt / 2) / scale
            force = (math.cos(phi) / scale**2, math.sin(phi) / scale**2)
            out.append(case("separatrix", phi + tilt, curvature, force, length * scale, rng))
    return out


def near_saddle(rng: random.Random) -> list[Case]:
    out = []
    for exponent in range(-14, 0):
        for _ in range(2):
            phi, scale = rng.uniform(-3, 3), anywhere(rng)
            tilt = math.pi + rng.choice((-1, 1)) * 10.0**exponent * rng.random()
            curvature = rng.choice((0.0, 1.0, -1.0)) * 10.0**exponent * rng.random() / scale
            force = (math.cos(phi) / scale**2, math.sin(phi) / scale**2)
            out.append(case("near saddle", phi + tilt, curvature, force, 10 ** rng.uniform(-0.5, 1.6) * scale, rng))
    return out


def ordinary(rng: random.Random) -> list[Case]:
    """What a design holds: every number of order one."""
    out = []
    for _ in range(40):
        force = (rng.uniform(-20, 20), rng.uniform(-20, 20))
        out.append(case("ordinary", rng.uniform(-3, 3), rng.uniform(-8, 8), force, rng.uniform(0.3, 3), rng))
    return out


def steps_of_one_ulp(numbers: list[float], s: float) -> list[float]:
    return [math.ulp(v) for v in (*numbers[2:6], s)]


def sensitivity(point: ReferencePoint, ulps: list[float]) -> tuple[float, float, float]:
    """How far position, angle and curvature move when θ₀, κ₀, λ₁, λ₂ and s each move by one unit in the last place."""
    rows = [[float(v) for v in row] for row in point.derivatives]
    position = ulps[4] + sum(math.hypot(row[0], row[1]) * ulp for row, ulp in zip(rows, ulps, strict=False))
    angle = abs(float(point.curvature)) * ulps[4] + sum(abs(row[2]) * ulp for row, ulp in zip(rows, ulps, strict=False))
    curvature = sum(abs(row[3]) * ulp for row, ulp in zip(rows, ulps, strict=False))
    return position, angle, curvature


def jacobian_sensitivity(numbers: list[float], s: float, point: ReferencePoint, ulps: list[float]) -> list[float]:
    """The same for the columns of the Jacobian, by moving each number in turn."""
    totals = [0.0] * 4
    for i, ulp in enumerate(ulps):
        with mpmath.workdps(80):
            moved = [mpmath.mpf(v) for v in (*numbers[2:6], s)]
            moved[i] += ulp
            (other,) = reference_points(moved[0], moved[1], (moved[2], moved[3]), [moved[4]])
            for column in range(4):
                a, b = point.derivatives[column], other.derivatives[column]
                totals[column] += float(mpmath.hypot(a[0] - b[0], a[1] - b[1]))
    return totals


def solved(entry: Case) -> Case:
    numbers, lengths = entry["input"], entry["s"]
    points = reference_points(numbers[2], numbers[3], (numbers[4], numbers[5]), lengths)
    rows = []
    for s, point in zip(lengths, points, strict=True):
        with mpmath.workdps(60):
            digits = [
                mpmath.nstr(v, n) for v, n in ((point.x, 35), (point.y, 35), (point.angle, 25), (point.curvature, 25))
            ]
        sensitive = sensitivity(point, steps_of_one_ulp(numbers, s))
        rows.append({"s": s.hex(), "xyak": digits, "sensitivity": [float(f"{v:.3e}") for v in sensitive]})
    end, ulps = points[-1], steps_of_one_ulp(numbers, lengths[-1])
    rows[-1]["jacobian"] = [[float(v) for v in row[:2]] for row in end.derivatives]
    if rows[-1]["sensitivity"][0] > 1e-14 * lengths[-1]:
        rows[-1]["jacobian_sensitivity"] = [
            float(f"{v:.3e}") for v in jacobian_sensitivity(numbers, lengths[-1], end, ulps)
        ]
    out = {"group": entry["group"], "input": [v.hex() for v in numbers], "points": rows}
    if "modulus" in entry:
        out["modulus"] = entry["modulus"]
    return out


NOTE = (
    "Frozen reference values, written by make_elastica_table.py through elastica_reference.py (Taylor series of the "
    "differential equation in 62-digit arithmetic; no elliptic functions). input = start_x, start_y, start_angle, "
    "start_curvature, force_x, force_y, length as hex floats, taken as exact. xyak = x and y relative to the start, "
    "angle, curvature at arc length s. sensitivity = by how much position, angle, curvature move when each of "
    "start_angle, start_curvature, force_x, force_y, s moves by one unit in the last place. jacobian = (dx, dy) by "
    "start_angle, start_curvature, force_x, force_y at the end; jacobian_sensitivity = how far each of these columns "
    "moves likewise, given where it may matter."
)


def main() -> None:
    rng = random.Random(20160427)
    groups = (lines, circles, near_lines, near_circles, moduli, near_one, separatrix, near_saddle, ordinary)
    entries = [entry for group in groups for entry in group(rng)]
    done = []
    for i, entry in enumerate(entries):
        done.append(solved(entry))
        print(f"\r{i + 1}/{len(entries)} {entry['group']:40}", end="", flush=True)
    lines_out = ",\n".join(json.dumps(entry, separators=(",", ":")) for entry in done)
    target = HERE / "elastica_table.json"
    target.write_text('{"note": ' + json.dumps(NOTE) + ',\n"cases": [\n' + lines_out + "\n]}\n", encoding="utf-8")
    print(f"\n{len(done)} cases, {target.stat().st_size} bytes")


if __name__ == "__main__":
    main()
