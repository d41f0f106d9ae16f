"""Levien2009, Figs. 3.10 to 3.17: what he says about them, and that docs/levien-figures.md says what the code gives."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk, gamma

from batten.curves.elastica import Elastica
from batten.solvers.boundary_value import solve_boundary

ROOT = Path(__file__).parents[2]
RIGHT = (np.pi / 2, np.pi / 2)


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("levien_figures", ROOT / "examples" / "levien_figures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rows(script):
    return script.by_chord(*RIGHT, np.linspace(0.01, 0.93, 93))


def test_levien_lambda(script):
    for k in (0.4, np.sqrt(0.5), 0.97, 1.3, 4.0):
        curve = Elastica.from_modulus(k, 0.4, 1.1, scale=2.0, rotation=0.3)
        assert script.levien_lambda(curve) == pytest.approx(1 / (4 * k**2), rel=1e-12)
    assert script.levien_lambda(Elastica((0, 0), 0.2, 1.0, (0, 0), 1.0)) == 0.0


def test_fig_3_10_about_0_34_at_chord_0(script):
    """The drop with parallel ends: ψ = ±π/2 there and both displacements vanish, 2K − E twice."""

    def gap(k):
        """The displacement along the force, from the end past its inflection over the crest; half of it."""
        top = 2 * np.arcsin(k)
        arc = [quad(lambda t: np.cos(2 * np.arcsin(k * np.sin(t))) / np.sqrt(1 - (k * np.sin(t)) ** 2), 0, b)[0]
               for b in (np.pi / 2, np.arcsin(np.sin(np.pi / 4) / k))]  # fmt: skip
        return 2 * arc[0] - arc[1] if top > np.pi / 2 else np.nan

    k = brentq(gap, 0.8, 0.95)
    row = script.by_chord(*RIGHT, np.array([1e-6]))[0]
    assert row.levien == pytest.approx(1 / (4 * k**2), abs=1e-5)
    assert row.levien == pytest.approx(0.34, abs=5e-3)  # as printed


def test_fig_3_10_maximum(rows, script):
    """½ is the maximum, where the end curvatures vanish: at π/ϖ² of the length."""
    lemniscate = gamma(0.25) ** 2 / (2 * np.sqrt(2 * np.pi))
    best = max(rows, key=lambda r: r.levien)
    assert best.levien < 0.5
    assert best.chord == pytest.approx(np.pi / lemniscate**2, abs=0.01)
    near = script.by_chord(*RIGHT, np.pi / lemniscate**2 + np.array([-1e-4, 1e-4]))
    assert [r.levien for r in near] == pytest.approx([0.5, 0.5], abs=1e-6)
    assert [r.elastica.start_curvature for r in near] == pytest.approx([0.0, 0.0], abs=5e-3)
    signs = np.sign([-r.elastica.start_curvature for r in near])
    assert signs.tolist() == [-1.0, 1.0]


def test_fig_3_10_falls_to_0_at_the_half_circle(rows, script):
    circle = script.by_chord(*RIGHT, np.array([2 / np.pi]))[0]
    assert abs(circle.levien) < 1e-9
    assert circle.elastica.curvature_at([0.0, 0.5, 1.0]) == pytest.approx([-np.pi] * 3, rel=1e-9)
    levien = np.array([r.levien for r in rows])
    chord = np.array([r.chord for r in rows])
    for low, high, rising in ((0.0, 0.45, True), (0.46, 2 / np.pi, False), (2 / np.pi, 0.89, True)):
        steps = np.diff(levien[(chord > low) & (chord < high)])
        assert ((steps > 0.0) == rising).all()


def test_fig_3_10_towards_a_quarter(rows):
    gaps = [0.25 - r.levien for r in rows if r.chord > 0.7]
    assert all(g > 0.0 for g in gaps)
    assert gaps[-1] < 1e-5


def test_one_inflection_is_not_enough(rows):
    """Levien2009 §3.7: "the principal solution always has at most one"; left of the maximum there is none with so few."""
    for row in rows:
        assert row.inflections == (2 if row.chord < 0.45 else 0 if row.chord > 0.46 else row.inflections)
    for chord in (0.1, 0.3, 0.44):
        held = solve_boundary((0, 0), np.pi / 2, (chord, 0), -np.pi / 2, 1.0, max_inflections=3)
        assert held[0].inflections == 2
        assert min(h.inflections for h in held) == 2


def test_fig_3_15_the_mec_energy_is_level_at_the_rectangular_elastica_but_no_minimum(rows, script):
    energies = np.array([r.mec for r in rows])
    assert (np.diff(energies) > 0.0).all()
    mec, si_mec = script.marked(*RIGHT)
    assert mec.levien == pytest.approx(0.5, rel=1e-12)
    near = script.by_chord(*RIGHT, mec.chord + np.array([-0.02, -0.01, 0.01, 0.02]))
    # stationary and inflected: what is left is of third order
    rises = np.array([r.mec - mec.mec for r in near])
    assert rises[3] == pytest.approx(8 * rises[2], rel=0.1)
    assert rises[0] == pytest.approx(8 * rises[1], rel=0.1)
    assert si_mec.si_mec == pytest.approx(np.pi**2, rel=1e-12)
    assert min(r.si_mec for r in rows) > si_mec.si_mec
    assert abs(si_mec.levien) < 1e-12


def test_fig_3_16(script):
    """Both are minima for π/3, and nearer to one another than for π/2."""
    found = script.by_chord(np.pi / 3, np.pi / 3, np.linspace(0.5, 0.93, 87))
    mec, si_mec = script.marked(np.pi / 3, np.pi / 3)
    assert mec.mec < min(r.mec for r in found) < mec.mec + 1e-2
    assert si_mec.si_mec < min(r.si_mec for r in found) < si_mec.si_mec + 1e-2
    assert min(found, key=lambda r: r.mec).chord == pytest.approx(mec.chord, abs=0.006)
    assert min(found, key=lambda r: r.si_mec).chord == pytest.approx(si_mec.chord, abs=0.006)
    wide = script.marked(*RIGHT)
    assert si_mec.chord - mec.chord < 0.1 * (wide[1].chord - wide[0].chord)
    assert 1.0 / si_mec.chord < 1.0 / mec.chord  # the SI-MEC is the shorter one, the chord held
    assert max(r.levien for r in found) == pytest.approx(1.0, abs=2e-3)  # the top of the printed axis


def test_fig_3_17(script):
    """The SI-MEC is a piece of the lemnoid elastica, with a vertical line of action."""
    k = brentq(lambda k: 2 * ellipe(k * k) - ellipk(k * k), 0.8, 0.99)
    mec, si_mec = script.marked(np.pi / 2, -np.pi / 2)
    assert si_mec.levien == pytest.approx(1 / (4 * k**2), rel=1e-10)
    assert abs(si_mec.elastica.force[0]) < 1e-10 * abs(si_mec.elastica.force[1])
    found = script.by_chord(np.pi / 2, -np.pi / 2, np.linspace(0.6, 0.93, 67))
    assert min(found, key=lambda r: r.mec).chord == pytest.approx(mec.chord, abs=0.006)
    assert min(found, key=lambda r: r.si_mec).chord == pytest.approx(si_mec.chord, abs=0.006)
    assert mec.mec < min(r.mec for r in found)
    assert si_mec.si_mec < min(r.si_mec for r in found)


def test_the_page_holds_the_tables(script):
    def cells(text):
        return [[c.strip() for c in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]

    written, computed = (cells(t) for t in ((ROOT / "docs" / "levien-figures.md").read_text("utf-8"), script.page()))
    assert len(computed) == 4 * 2 + 13 + 14 + 14 + 17
    assert len(written) == len(computed)
    for one, other in zip(written, computed, strict=True):
        for a, b in zip(one, other, strict=True):
            try:
                assert float(a) == pytest.approx(float(b), abs=1.1 * 10.0 ** -len(b.partition(".")[2]))
            except ValueError:
                assert a == b


@pytest.mark.parametrize("name", ["3_10", "3_13", "3_15", "3_16", "3_17"])
def test_the_pictures_are_there_and_shown(name):
    picture = ROOT / "docs" / "pictures" / f"levien_{name}.png"
    assert 10_000 < picture.stat().st_size < 200_000
    assert f"pictures/{picture.name}" in (ROOT / "docs" / "levien-figures.md").read_text("utf-8")
