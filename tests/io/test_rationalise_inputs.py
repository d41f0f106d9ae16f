"""The inputs of examples/rationalise against what is known of the teapot, the wing's formula and the bow's table."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from batten.io.face_reading import read_faces

FOLDER = Path(__file__).parents[2] / "examples" / "rationalise"


@pytest.fixture(scope="module")
def make_inputs():
    spec = importlib.util.spec_from_file_location("make_inputs", FOLDER / "make_inputs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module", params=["teapot", "wing", "bow"])
def made(request, make_inputs):
    return request.param, getattr(make_inputs, request.param)()


def test_the_files_hold_what_the_script_makes(made):
    name, surfaces = made
    for layer, surface in surfaces.items():
        (face,) = read_faces(FOLDER / f"{name}.3dm", layer=layer)
        assert face.name == layer
        assert not face.is_trimmed
        assert face.surface.control_points == pytest.approx(surface.control_points, abs=1e-9)
        assert face.surface.knots_u[1:-1] == pytest.approx(surface.knots_u[1:-1], abs=1e-12)
        assert face.surface.knots_v[1:-1] == pytest.approx(surface.knots_v[1:-1], abs=1e-12)


def test_the_teapot_is_round_and_smooth(make_inputs):
    body, rim = make_inputs.teapot()["body"], make_inputs.teapot()["rim"]
    points = body.point(np.linspace(0, 4, 81)[:, None], np.linspace(0, 2, 41)) / make_inputs.TEAPOT_MM
    assert points.min(axis=(0, 1)) == pytest.approx([-2, -2, 0.15], abs=1e-12)
    assert points.max(axis=(0, 1)) == pytest.approx([2, 2, 2.4], abs=1e-12)
    # A quarter turn takes it to itself.
    assert np.stack([points[:61, :, 1], -points[:61, :, 0]], axis=-1) == pytest.approx(points[20:, :, :2], abs=1e-12)
    radius = np.hypot(points[..., 0], points[..., 1])
    # In the middle of a quarter x = y = (1 + 3 + 3 × 0.56) / 8 of the radius.
    assert radius.max(axis=0) / radius.min(axis=0) == pytest.approx(np.full(41, np.sqrt(2) * 0.71), abs=1e-12)
    # C¹ where patches meet, round and down: derivatives from both sides.
    for u, v in [(1.0, 0.5), (2.0, 1.5), (3.0, 0.1), (0.7, 1.0), (2.2, 1.0)]:
        du, dv = (1e-9, 0.0) if u == int(u) else (0.0, 1e-9)
        before, after = body.derivatives(u - du, v - dv), body.derivatives(u + du, v + dv)
        assert after[1, 0] == pytest.approx(before[1, 0], abs=1e-4)
        assert after[0, 1] == pytest.approx(before[0, 1], abs=1e-4)
    u = np.linspace(0, 4, 33)
    assert body.derivatives(0.0, 1.3)[1, 0] == pytest.approx(body.derivatives(4.0, 1.3)[1, 0], abs=1e-9)
    assert rim.point(u, 1.0) == pytest.approx(body.point(u, 0.0), abs=1e-12)
    assert np.abs(rim.normal(u, 1.0) - body.normal(u, 0.0)).max() < 1e-12


def test_the_teapots_numbers_are_newells(make_inputs):
    """The profile as published, swept round with inner points at 0.56 of the radius."""
    profile = np.array([(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4), (1.75, 1.875), (2, 1.35), (2, 0.9),
                        (2, 0.45), (1.5, 0.225), (1.5, 0.15)])  # fmt: skip
    rows = np.loadtxt(FOLDER / "teapot-body.txt").reshape(3, 4, 4, 4, 3)
    first_quarter = np.array([(1, 0), (1, -0.56), (0.56, -1), (0, -1)])
    turn = np.array([(0, -1), (1, 0)])
    for ring in range(3):
        for quarter in range(4):
            directions = first_quarter @ np.linalg.matrix_power(turn, quarter)
            part = profile[3 * ring : 3 * ring + 4]
            assert rows[ring, quarter, ..., :2] == pytest.approx(part[:, None, :1] * directions, abs=1e-12)
            assert rows[ring, quarter, ..., 2] == pytest.approx(np.broadcast_to(part[:, 1:], (4, 4)))


@pytest.mark.parametrize(("name", "side"), [("upper", 1), ("lower", -1)])
def test_the_wing_is_the_formula(make_inputs, name, side):
    surface = make_inputs.wing()[name]
    u, v = np.linspace(0, 1, 2001), np.linspace(0, 1, 7)
    points = surface.point(u[:, None], v)
    chord = 1800 - 200 * v - 500 * v**2
    x = (points[..., 0] - 450 - 150 * v - 550 * v**2) / chord + 0.25
    z = (points[..., 2] - 60 * v - 240 * v**2) / chord
    assert points[..., 1] == pytest.approx(np.broadcast_to(3000 * v, points.shape[:2]), abs=1e-9)
    # The other way round: a point of a section lies the half thickness off the camber line, across it.
    t, m, p = u**2, 0.04, 0.4
    half = 5 * 0.15 * (0.2969 * np.sqrt(t) - 0.126 * t - 0.3516 * t**2 + 0.2843 * t**3 - 0.1036 * t**4)
    camber = np.where(t < p, m * t / p**2 * (2 * p - t), m * (1 - t) / (1 - p) ** 2 * (1 + t - 2 * p))
    angle = np.arctan(np.where(t < p, 2 * m / p**2, 2 * m / (1 - p) ** 2) * (p - t))
    wanted_x, wanted_z = t - side * half * np.sin(angle), camber + side * half * np.cos(angle)
    assert (np.hypot(x - wanted_x[:, None], z - wanted_z[:, None]) * chord).max() < 0.015
    # C¹: no jump of the tangent where the camber line's parabolas meet.
    knee = np.sqrt(p)
    assert surface.derivatives(knee - 1e-9, 0.5)[1, 0] == pytest.approx(
        surface.derivatives(knee + 1e-9, 0.5)[1, 0], abs=1e-2
    )


def test_published_ordinates_of_the_section(make_inputs):
    """What the four digits say: 4 % of camber at 40 % of the chord, 15 % of thickness, by the formula at 30 %."""
    upper, lower = make_inputs.naca_section(0.4, 1), make_inputs.naca_section(0.4, -1)
    assert upper + lower == pytest.approx([0.8, 0.08])  # on the camber line's summit, 4 % at 40 %
    x = np.linspace(0, 1, 1001)
    thickness = np.linalg.norm(make_inputs.naca_section(x, 1) - make_inputs.naca_section(x, -1), axis=1)
    assert x[np.argmax(thickness)] == pytest.approx(0.3, abs=0.002)
    assert thickness.max() == pytest.approx(0.15, abs=1e-4)
    assert thickness[-1] == pytest.approx(0.0, abs=1e-12)


def test_the_bow_keeps_to_its_table(make_inputs):
    hull = make_inputs.bow()["hull"]
    stations, waterlines, offsets = make_inputs.read_offsets(FOLDER / "bow-offsets.csv")
    points = hull.point(stations[:, None], waterlines)
    assert np.sqrt(np.mean((points[..., 1] - offsets) ** 2)) == pytest.approx(12**-0.5, abs=0.01)
    assert np.abs(points[..., 1] - offsets).max() < 1.8
    assert points[..., 0] == pytest.approx(np.broadcast_to(stations[:, None], offsets.shape))
    assert points[..., 2] == pytest.approx(np.broadcast_to(waterlines, offsets.shape))

    def formula(s, z):
        wigley = 1100 * s * (2 - s) * (1 - np.maximum(0, 1 - z / 1400) ** 2)
        flare = 350 * 6.75 * s * (1 - s) ** 2 * (np.maximum(0, z - 1400) / 1000) ** 2
        return wigley + flare + 160 * (s / 0.12) * np.exp(1 - s / 0.12) * ((z / 450) * np.exp(1 - z / 450)) ** 2

    assert np.abs(formula(stations[:, None] / 5000, waterlines) - offsets).max() <= 0.5 + 1e-9
    x, z = np.linspace(0.02, 0.98, 193)[:, None], np.linspace(100, 2300, 111)
    assert np.abs(hull.point(5000 * x, z)[..., 1] - formula(x, z)).max() < 3.0  # between the lines
    # Faired: its bends are nearer to the formula's than those of the spline through the rounded table.
    step = 1e-4
    bend = (formula(x + step, z) - 2 * formula(x, z) + formula(x - step, z)) / (5000 * step) ** 2
    through = make_interp_spline(
        waterlines, make_interp_spline(stations, offsets).derivative(2)(5000 * x[:, 0]), axis=1
    )
    faired = np.sqrt(np.mean((hull.derivatives(5000 * x, z, 2)[2, 0][..., 1] - bend) ** 2))
    assert faired < 0.6 * np.sqrt(np.mean((through(z) - bend) ** 2))
