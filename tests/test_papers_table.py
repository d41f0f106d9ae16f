"""docs/papers.md names only what exists, and misses no module that cites a paper; its misprints are computed again."""

import ast
import importlib
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipeinc, ellipj

import batten
from batten import Elastica

TESTS = Path(__file__).parent
SOURCE = TESTS.parent / "src" / "batten"
PAGE = (TESTS.parent / "docs" / "papers.md").read_text("utf-8")
KEY = r"\b(?:Brander2016|Brander2018|Fisker2018|Levien2009|Moreton1995)\b"


def tables():
    """The rows of every table on the page, each a dictionary by column."""
    rows = []
    for block in re.findall(r"(?:^\|.*\n)+", PAGE, re.MULTILINE):
        lines = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in block.splitlines()]
        rows += [dict(zip(lines[0], line, strict=True)) for line in lines[2:]]
    return rows


ROWS = tables()
CODE = [(row["concept"], row["module.function"]) for row in ROWS if "module.function" in row]
NAMED = [cell for row in ROWS if "test" in row for cell in re.findall(r"`([^`]+)`", row["test"])]


def module_of(name):
    """The longest part of a dotted name that is a module of batten, and what is left."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        file = SOURCE.joinpath(*parts[:end])
        if file.with_suffix(".py").is_file() or (file / "__init__.py").is_file():
            return ".".join(parts[:end]), parts[end:]
    return None, parts


def find(name):
    module, rest = module_of(name)
    assert module is not None, f"{name} is in no module of batten"
    thing = importlib.import_module(f"batten.{module}")
    for part in rest:
        assert hasattr(thing, part), f"batten.{module} has no {'.'.join(rest)}"
        thing = getattr(thing, part)
    return module


def modules_named():
    """Every module that a row names; names after the first of a cell may leave their module or package out."""
    found = set()
    for _, cell in CODE:
        last = None
        for name in re.findall(r"`([^`]+)`", cell):
            if module_of(name)[0] is None and last is not None:
                name = next(n for n in (f"{last}.{name}", f"{last.rpartition('.')[0]}.{name}") if module_of(n)[0])
            last = find(name)
            found.add(last)
    return found


def test_the_page_has_its_tables():
    assert len(CODE) >= 35
    assert len([row for row in ROWS if "printed" in row]) >= 8
    for row in ROWS:
        for column in ("test", "module.function"):
            assert "`" in row.get(column, "`"), row


@pytest.mark.parametrize("name", sorted(set(NAMED)))
def test_the_tests_exist(name):
    path, _, function = name.partition("::")
    text = (TESTS / path).read_text("utf-8")
    functions = [n.name for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef)]
    assert (function in functions) if function else any(f.startswith("test_") for f in functions)


def test_every_module_that_cites_a_paper_has_a_row():
    named = modules_named()
    cites = {
        path.relative_to(SOURCE).with_suffix("").as_posix().replace("/", ".")
        for path in SOURCE.rglob("*.py")
        if re.search(KEY, path.read_text("utf-8"))
    }
    assert cites - named == set()


def test_papers_are_cited_by_their_keys():
    keys = set(re.findall(KEY, PAGE))
    assert keys == {row["key"] for row in ROWS if "key" in row}


# What is printed, and what holds


def falling_basic(k, s):
    """ζ_k(s) for 0 < s < K: y rises, so u = −y falls (S = 1, φ = 0)."""
    return Elastica.from_modulus(k, 0.0, s).point(1.0)


def test_exact_elastica_come_back():
    rng = np.random.default_rng(5)
    for k in (0.35, 0.75, 0.93, 1.2, 2.0):
        s0, ell = rng.uniform(-0.5, 0.5), rng.uniform(1.5, 2.5) / max(k, 1.0)
        curve = Elastica.from_modulus(k, s0, ell, scale=3.0, rotation=rng.uniform(-3, 3), origin=(5.0, -2.0))
        for found in (batten.initial_elastica(curve).elastica, batten.fit_elastica(curve).elastica):
            unit = np.array([3, 3, 1, 1 / 3, 1 / 9, 1 / 9, 3])
            turns = np.array([0, 0, 2 * math.pi, 0, 0, 0, 0])
            off = found.parameters - curve.parameters
            off -= turns * round(off[2] / (2 * math.pi))
            assert np.abs(off / unit).max() < 1e-8


@pytest.mark.parametrize("k", [0.4, 0.9])
def test_misprint_e_is_a_function_of_the_argument(k):
    s = 1.3
    by_argument = quad(lambda u: ellipj(u, k * k)[2] ** 2, 0, s)[0]
    x = falling_basic(k, s)[0]
    assert 2 * by_argument - s == pytest.approx(x, abs=1e-12)
    assert abs(2 * ellipeinc(s, k * k) - s - x) > 1e-3  # the integral over an amplitude s


def test_misprint_interval_of_u_without_inflections():
    curve = Elastica.from_modulus(1.3, 0.0, 12.0, scale=2.0, rotation=0.4, origin=(1.0, -3.0)).reversed()
    points, angle, kappa = (
        f(np.linspace(0, curve.length, 4001)) for f in (curve.point_at, curve.angle_at, curve.curvature_at)
    )
    assert (kappa < 0).all()  # ℓ < 0
    l1, l2 = curve.force
    lam = math.hypot(l1, l2)
    u = points @ [l2, -l1] / lam
    alpha = (kappa - lam * u).mean()
    beta = ((l1 * np.cos(angle) + l2 * np.sin(angle)) / lam - 0.5 * lam * u**2 - alpha * u).mean()
    minus, plus = (math.sqrt(alpha**2 - 2 * lam * (beta - e)) for e in (1, -1))
    assert [u.min(), u.max()] == pytest.approx([(-alpha - minus) / lam, (-alpha - plus) / lam], abs=1e-5)
    assert u.max() < (-alpha + plus) / lam - 0.1  # as printed
    assert minus / (2 * math.sqrt(lam)) == pytest.approx(1.3)  # (12)


def test_misprint_amplitude_without_inflections():
    k, s = 1.4, 0.9
    y = falling_basic(k, s)[1]  # Δ(u) on the first segment, u falling
    amplitude = math.asin(math.sqrt(y * (k - y / 4)))
    assert amplitude == pytest.approx(ellipj(k * s, 1 / k**2)[3])
    assert abs(amplitude - ellipj(s / k, 1 / k**2)[3]) > 0.1


@pytest.mark.parametrize(("s", "k"), [(0.7, 0.6), (2.3, 0.85)])
def test_misprint_derivatives_by_the_modulus(s, k):
    h = 1e-5
    measured = (falling_basic(k + h, s) - falling_basic(k - h, s)) / (2 * h)
    slopes = [Elastica.from_modulus(q, s, 1.0).start_angle for q in (k + h, k - h)]
    mixed = (np.array([np.cos(slopes[0]), np.sin(slopes[0])]) - [np.cos(slopes[1]), np.sin(slopes[1])]) / (2 * h)
    sn, cn, dn, am = ellipj(s, k * k)
    e = ellipeinc(am, k * k)

    def formulas(q, factor):
        """∂ζ/∂k and ∂²ζ/∂s∂k with q for k′² and `factor` for 2/k′²."""
        x = k * (sn * cn * dn - e * cn**2 - s * q * sn**2)
        y = q + cn * (k**2 - dn**2) - sn * dn * (e - s * q)
        vector = np.array([-2 * k * sn * dn, 2 * dn**2 - 1])
        return factor * np.array([x, y]), factor * (sn * dn - cn * (e - s * q)) * vector

    for found, wanted in zip(formulas(1 - k**2, 2 / (1 - k**2)), (measured, mixed), strict=True):
        assert found == pytest.approx(wanted, abs=1e-7)
    assert np.abs(formulas(k**2, 2 / k**2)[0] - measured).max() > 1e-2  # as printed


def test_reading_of_the_form_without_inflections():
    k, s = 0.7, 1.9
    _, _, dn, am = ellipj(s / k, k * k)
    printed = [(1 - 2 / k**2) * s + 2 / k * ellipeinc(am, k * k), 2 / k * (1 - dn)]
    assert falling_basic(1 / k, s) == pytest.approx(printed, abs=1e-12)
