"""Straight wires against rulings, the circle's sagitta and a search over all divisions."""

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.kernels.minimax_line import minimax_line_batch
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.foliation import parallel_planes
from batten.surfaces.hot_wire import best_wire_direction, wire_columns, wires_between
from batten.surfaces.plane import Plane

RADIUS, LENGTH = 400.0, 300.0


def best_lines(x, y):
    out = np.empty((len(x), 3))
    minimax_line_batch(np.ascontiguousarray(x), np.ascontiguousarray(y), out)
    return out


def saddle(turn, size=500.0):
    """z = c p q over a square about the origin, p and q along axes turned by `turn`: ruled along them."""
    c, s = np.cos(turn), np.sin(turn)
    corners = [[(a, b) for b in (-size, size)] for a in (-size, size)]
    net = [[(c * a - s * b, s * a + c * b, 2e-4 * a * b) for a, b in row] for row in corners]
    return BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, net)


@pytest.mark.parametrize("tolerance", [20.0, 3.0, 0.5, 0.05])
def test_a_cylinder_across_its_rulings_takes_what_the_sagitta_says(made_surfaces, tolerance) -> None:
    surface = made_surfaces.cylinder(RADIUS, LENGTH)
    reach = RADIUS * np.sin(np.pi / 3)
    planes = parallel_planes("x", [0.0, 0.5 * LENGTH, LENGTH])
    wires = wire_columns(surface, planes, -reach, reach, tolerance)
    # A chord of an arc of angle a has the sagitta R (1 − cos a/2); the best line halves it.
    arc = 2.0 * np.arccos(1.0 - 2.0 * tolerance / RADIUS)
    count = int(np.ceil(2.0 * np.pi / 3.0 / arc))
    assert wires.count == count
    assert wires.worst <= tolerance
    assert wires.deviation[:, :-1].min() >= 0.995 * tolerance, "every column but the last is as long as can be"
    borders = RADIUS * np.sin(-np.pi / 3 + arc * np.arange(1, count))
    assert wires.edges[0, 1:-1] == pytest.approx(borders, abs=2e-3 * np.diff(wires.edges[0]).min() * count)
    assert wires.edges[:, [0, -1]] == pytest.approx(np.tile([-reach, reach], (3, 1)))
    # The best division of the same number is the even one.
    even = wire_columns(surface, planes, -reach, reach, tolerance, count=count)
    assert even.count == count
    best = 0.5 * RADIUS * (1.0 - np.cos(np.pi / 3.0 / count))
    assert even.worst == pytest.approx(best, rel=2.5e-3)
    assert best <= tolerance


def test_along_rulings_one_column_does(made_surfaces) -> None:
    surface = made_surfaces.cylinder(RADIUS, LENGTH)
    wires = wire_columns(surface, parallel_planes("y", [-300.0, 0.0, 111.0]), 0.0, LENGTH, 1e-6)
    assert (wires.count, wires.steps.shape) == (1, (3, 0))
    assert wires.worst < 1e-9
    best = best_wire_direction(surface, (-340.0, 0.0), (340.0, LENGTH), 20.0, 0.5)
    assert best.pieces == 1
    assert best.turn_rad == pytest.approx(np.pi / 2, abs=1e-12)
    assert best.columns.worst < 1e-9


@pytest.mark.parametrize("turn_deg", [0.0, 33.3, 71.85])
def test_a_saddle_is_ruled_in_two_directions_and_in_no_other(turn_deg) -> None:
    turn = np.radians(turn_deg)
    surface = saddle(turn)
    for angle in (turn, turn + np.pi / 2):
        planes = parallel_planes("x", np.linspace(-120.0, 120.0, 7), turn_rad=angle)
        wires = wire_columns(surface, planes, -300.0, 300.0, 1e-6)
        assert wires.count == 1
        assert wires.worst < 1e-9
    across = wire_columns(surface, parallel_planes("x", [0.0], turn_rad=turn + np.pi / 4), -300.0, 300.0, 0.5)
    # z = c t²/2 along the bisector: columns of equal width, sagitta c w²/8 and half of it for the best line, nearly level.
    assert across.count == pytest.approx(600.0 / np.sqrt(16.0 * 0.5 / 2e-4), abs=1.1)
    found = best_wire_direction(surface, (-250.0, -250.0), (250.0, 250.0), 25.0, 0.05)
    off = (found.turn_rad - turn) % (np.pi / 2)
    assert min(off, np.pi / 2 - off) < 2e-4
    assert found.pieces == 1
    assert found.columns.worst < 0.05


def test_no_division_has_fewer_columns(made_surfaces) -> None:
    # All divisions of a grid, by dynamic programming over points of three unlike leaves; the borders of ours are free.
    def height(x, y):
        return 6.0 * np.sin(x / (9.0 + y / 4.0)) + 0.05 * x * y

    surface = made_surfaces.graph(height, (0.0, 100.0), (0.0, 12.0), (60, 12))
    planes = parallel_planes("x", [1.0, 6.0, 11.0])
    x = np.linspace(0.0, 100.0, 81)
    for tolerance in (0.1, 0.4, 1.3, 4.0):
        wires = wire_columns(surface, planes, 0.0, 100.0, tolerance)
        feasible = np.zeros((81, 81), dtype=bool)
        for i in range(81):
            for j in range(i + 1, 81):
                fine = np.linspace(x[i], x[j], 6 * (j - i) + 1)
                lines = best_lines(np.tile(fine, (3, 1)), np.stack([height(fine, y) for y in (1.0, 6.0, 11.0)]))
                feasible[i, j] = lines[:, 2].max() <= tolerance
                if not feasible[i, j]:
                    break
        least = np.full(81, 10**6)
        least[0] = 0
        for j in range(1, 81):
            least[j] = 1 + min((least[i] for i in range(j) if feasible[i, j]), default=10**6)
        assert wires.count <= least[-1]
        assert wires.count >= least[-1] - 1, "the grid costs one at most"
        assert wires.worst <= tolerance
        balanced = wire_columns(surface, planes, 0.0, 100.0, tolerance, count=wires.count)
        assert balanced.worst <= wires.worst * (1.0 + 1e-4)
        assert wire_columns(surface, planes, 0.0, 100.0, 1.01 * balanced.worst).count <= wires.count
        assert wire_columns(surface, planes, 0.0, 100.0, 0.98 * balanced.worst).count > wires.count


def test_given_borders_and_what_happens_at_them(made_surfaces) -> None:
    surface = made_surfaces.graph(lambda x, y: 0.002 * x**2 + 0.0 * y, (0.0, 400.0), (0.0, 100.0))
    edges = np.array([[0.0, 150.0, 250.0, 400.0]] * 2)
    wires = wires_between(surface, parallel_planes("x", [10.0, 90.0]), edges)
    # A parabola c x²: the best line over a width w has the chord's slope; vertical distance c w²/8.
    slopes = 0.002 * (edges[:, 1:] + edges[:, :-1])
    assert wires.slopes == pytest.approx(slopes, abs=1e-6)
    high = 0.002 * np.diff(edges) ** 2 / 8.0
    assert wires.deviation == pytest.approx(high / np.hypot(1.0, slopes), rel=1e-5)
    assert wires.heights[..., 0] == pytest.approx(0.002 * edges[:, :-1] ** 2 - high, rel=1e-4, abs=1e-4)
    assert wires.steps == pytest.approx(high[:, :-1] - high[:, 1:], abs=1e-4)
    assert wires.kinks == pytest.approx(np.diff(np.arctan(slopes)), abs=1e-6)


def test_only_points_inside_count_and_a_longest_width_is_kept(made_surfaces) -> None:
    surface = made_surfaces.cylinder(RADIUS, LENGTH)
    planes = parallel_planes("x", [50.0, 250.0])
    whole = wire_columns(surface, planes, -300.0, 300.0, 1.0)
    left = wire_columns(surface, planes, -300.0, 300.0, 1.0, lambda p: p[..., 0] < 0.0)
    assert left.count == whole.count // 2 + 1
    one = wire_columns(surface, planes, -300.0, 300.0, 1.0, lambda p: p[..., 1] > 100.0)
    assert np.isnan(one.deviation[0]).all()
    assert one.deviation[1] == pytest.approx(whole.deviation[1], abs=1e-9)
    short = wire_columns(surface, planes, -300.0, 300.0, 1.0, longest=20.0)
    assert np.diff(short.edges).max() <= 20.0 + 1e-9
    assert short.count == 30
    beyond = wire_columns(surface, planes, -900.0, 300.0, 1.0)
    assert np.isfinite(beyond.deviation).any()
    # Planes in any position: turned upright about the cylinder's own axis they cut the same leaves.
    c, s = np.cos(0.3), np.sin(0.3)
    tilted = surface.transformed([[c, 0, -s, 0], [0, 1, 0, 0], [s, 0, c, 0], [0, 0, 0, 1]])
    leaning = [Plane((0, y, 0), (c, 0, s), (-s, 0, c)) for y in (50.0, 250.0)]
    assert wire_columns(tilted, leaning, -300.0, 300.0, 1.0).edges == pytest.approx(whole.edges, abs=1e-6)


def test_a_row_width_counts_blocks(made_surfaces) -> None:
    surface = made_surfaces.cylinder(RADIUS, LENGTH)
    best = best_wire_direction(surface, (-340.0, 0.0), (340.0, LENGTH), 20.0, 0.5, row_width=170.0)
    # Four rows along the rulings; across them two rows of as many columns as the sagitta asks for are more.
    assert best.pieces == 4
    across = wire_columns(surface, parallel_planes("x", [0.0, LENGTH]), -340.0, 340.0, 0.5)
    assert best.tried[0].tolist() == [0.0, 2.0 * across.count]


def test_what_is_refused(made_surfaces) -> None:
    surface = made_surfaces.cylinder(RADIUS, LENGTH)
    planes = parallel_planes("x", [50.0, 250.0])
    for low, high, tolerance, more in (
        (-10.0, 10.0, 0.0, {}),
        (10.0, -10.0, 1.0, {}),
        ([0.0, 1.0, 2.0], 10.0, 1.0, {}),
        (-10.0, 10.0, 1.0, {"longest": 0.0}),
        (-10.0, 10.0, 1.0, {"count": 0}),
        (-10.0, 10.0, np.nan, {}),
    ):
        with pytest.raises(InvalidInputError, match="allowed are"):
            wire_columns(surface, planes, low, high, tolerance, **more)
    with pytest.raises(InvalidInputError, match="try count = 4"):
        wire_columns(surface, planes, -10.0, 10.0, 1.0, count=3, longest=5.0)
    with pytest.raises(InvalidInputError, match="ascending"):
        wires_between(surface, planes, [[0.0, 1.0, 1.0]] * 2)
    with pytest.raises(InvalidInputError, match="at least one plane"):
        wire_columns(surface, [], -10.0, 10.0, 1.0)
    with pytest.raises(InvalidInputError, match="row_width"):
        best_wire_direction(surface, (-10.0, 0.0), (10.0, LENGTH), 20.0, 0.5, row_width=0.0)
