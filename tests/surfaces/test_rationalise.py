"""Chains of elastica against surfaces swept by elastica, and against brute force where the surface is none."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from batten.curves.elastica import points_batch, states_at
from batten.errors import InvalidInputError
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.foliation import intersect_planes, parallel_planes
from batten.surfaces.rationalise import Chains, eased, rationalise

FORCE = (3e-6, 2e-6)
EDGES = np.array([0.0, 600.0, 1200.0, 1800.0])
TOLERANCE = 1.0


@pytest.fixture(scope="module")
def swept(made_surfaces):
    """An elastica of 1.8 m with an inflection, moved along y and lifted by 20 mm for every metre."""
    x = np.linspace(0.0, 1800.0, 241)
    heights = made_surfaces.elastica_heights(x, 0.0, 0.5, -1.0 / 700.0, FORCE)
    return made_surfaces.graph(lambda _, y: heights[:, None] + 0.02 * y, (0.0, 1800.0), (0.0, 900.0), (241, 8))


@pytest.fixture(scope="module")
def wall(made_surfaces):
    return made_surfaces.example_wall()[0]


@pytest.fixture(scope="module")
def difficult(wall):
    """Leaves of the example's wall, turned by 3°, on blocks of 600 mm; within the wall alone. (planes, edges, chains)."""
    turn = np.radians(3.0)
    planes = parallel_planes("x", np.linspace(-1400.0, 1400.0, 36), turn_rad=turn, centre=(1500.0, 1500.0))
    edges = np.tile(np.linspace(-1500.0, 1500.0, 6) / np.cos(turn), (36, 1))
    edges += np.array([(1500.0 - p.origin[0]) / np.cos(turn) for p in planes])[:, None]
    return planes, edges, rationalise(wall, planes, edges, TOLERANCE, inside=within)


def within(points):
    return ((points[..., :2] > -1e-6) & (points[..., :2] < 3000.0 + 1e-6)).all(axis=-1)


def assert_smooth(chains: Chains) -> None:
    """Every piece begins and ends in its joints, to 1e-12 of its length, and so neighbours share point and tangent."""
    p = chains.parameters
    ends = np.stack([states_at(p, np.zeros(p.shape[:2])), states_at(p, p[..., 6])])
    assert np.isfinite(ends).all()
    allowed = 1e-12 * p[..., 6]
    for side in range(2):
        joint = slice(side, p.shape[1] + side)
        x, y, angle = chains.edges[:, joint], *np.moveaxis(chains.joints[:, joint], -1, 0)
        assert (np.hypot(ends[side, ..., 0] - x, ends[side, ..., 1] - y) < allowed).all()
        turns = (ends[side, ..., 2] - angle) / (2.0 * np.pi)
        assert (np.abs(turns - np.round(turns)) < 1e-12).all()
    step = ends[1, :, :-1, :2] - ends[0, :, 1:, :2]
    assert (np.hypot(step[..., 0], step[..., 1]) < allowed[:, 1:]).all()
    a, b = ends[1, :, :-1, 2], ends[0, :, 1:, 2]
    assert (np.hypot(np.cos(a) - np.cos(b), np.sin(a) - np.sin(b)) < 1e-12).all()


def test_a_surface_swept_by_an_elastica_is_recovered_and_nothing_is_moved(swept, made_surfaces) -> None:
    planes = parallel_planes("x", [0.0, 250.0, 900.0])
    chains = rationalise(swept, planes, np.tile(EDGES, (3, 1)), 1e-3)
    assert (chains.status == 0).all()
    assert not chains.moved.any()
    assert chains.deviation.tolist() == chains.first_deviation.tolist()
    assert chains.deviation.max() < 3e-8 * 600.0
    assert chains.lambda_residual.max() < 1e-5
    assert_smooth(chains)
    # The pieces between their stations, against the integrated curve itself.
    for k, y in enumerate((0.0, 250.0, 900.0)):
        for points in points_batch(chains.parameters[k], np.linspace(0.0, 1.0, 12)):
            wanted = made_surfaces.elastica_heights(np.r_[0.0, points[1:, 0]], 0.0, 0.5, -1.0 / 700.0, FORCE)
            assert points[1:, 1] == pytest.approx(wanted[1:] + 0.02 * y, abs=3e-8 * 600.0)
    # The force belongs to the whole curve: the same in every piece, and in every leaf.
    assert chains.parameters[..., 4] == pytest.approx(np.full((3, 3), FORCE[0]), rel=1e-4)
    assert chains.parameters[..., 5] == pytest.approx(np.full((3, 3), FORCE[1]), rel=1e-4)


def test_a_usual_tolerance_costs_a_hundredth_of_itself(swept) -> None:
    # Of shapes that are near enough, the fit prefers the one with less force; the price stays far below the tolerance.
    chains = rationalise(swept, parallel_planes("x", [100.0]), EDGES[None], 0.5)
    assert 0.0 < chains.deviation.max() < 0.005
    assert (chains.parameters[..., 4] < FORCE[0]).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_cylinder_is_cut_into_its_circles(made_surfaces, side) -> None:
    surface = made_surfaces.cylinder(700.0, 400.0).transformed(np.diag([1.0, 1.0, side, 1.0]))
    edges = np.tile([-500.0, -100.0, 150.0, 550.0], (2, 1))
    chains = rationalise(surface, parallel_planes("x", [10.0, 390.0]), edges, 0.5)
    assert not chains.moved.any()
    assert chains.deviation.max() < 1e-6
    assert chains.parameters[..., 3] == pytest.approx(np.full((2, 3), -side / 700.0), rel=1e-7)
    angles = np.diff(np.arcsin(edges[0] / 700.0))
    assert chains.parameters[0, :, 6] == pytest.approx(700.0 * angles, rel=1e-9)
    assert np.abs(chains.parameters[..., 4:6]).max() < 1e-7 / 700.0
    assert_smooth(chains)


def test_turned_planes_cut_a_cylinder_into_ellipses_that_still_join(made_surfaces) -> None:
    surface = made_surfaces.cylinder(700.0, 4000.0)
    planes = parallel_planes("x", [-500.0, 700.0], turn_rad=0.6, centre=(0.0, 2000.0))
    edges = np.tile(np.array([-500.0, 0.0, 500.0]) / np.cos(0.6), (2, 1))
    edges += np.array([-p.origin[0] / np.cos(0.6) for p in planes])[:, None]
    for tolerance in (5.0, 0.002):
        chains = rationalise(surface, planes, edges, tolerance)
        assert_smooth(chains)
        assert (chains.moved != 0.0).any() == (tolerance < chains.first_deviation.max())
    assert (chains.moved != 0.0).any()
    assert (chains.deviation.max(axis=1) < chains.first_deviation.max(axis=1)).all()


def test_joints_are_moved_only_where_the_tolerance_is_missed_and_it_helps(difficult) -> None:
    _, _, chains = difficult
    worst, first = np.nanmax(chains.deviation, axis=1), np.nanmax(chains.first_deviation, axis=1)
    moved = (chains.moved != 0.0).any(axis=(1, 2))
    missed = first > TOLERANCE
    assert 5 < missed.sum() < 31, "the case must have both kinds"
    assert not moved[~missed].any()
    assert (worst[~moved] == first[~moved]).all()
    assert moved[missed].all()
    assert (worst[moved] < first[moved]).all()
    assert first.max() > 5.0
    assert worst.max() < 0.5 * first.max()
    assert (worst[moved] < 0.6 * first[moved]).mean() > 0.7
    assert_smooth(chains)


def test_no_round_makes_it_worse(wall, difficult) -> None:
    planes, edges, chains = difficult
    some = np.r_[0:11, 26:36]
    worst = np.array([
        np.nanmax(
            rationalise(wall, [planes[i] for i in some], edges[some], TOLERANCE, inside=within, rounds=r).deviation, axis=1
        )
        for r in range(6)
    ])  # fmt: skip
    assert worst[0] == pytest.approx(np.nanmax(chains.first_deviation[some], axis=1), abs=0.02 * TOLERANCE)
    assert (np.diff(worst, axis=0) <= 0.0).all()
    assert (np.diff(worst, axis=0) < 0.0).any(axis=1)[:3].all(), "and the first rounds help"


def test_unmoved_joints_are_the_surfaces_own_points_and_tangents(wall, difficult) -> None:
    planes, edges, chains = difficult
    own = chains.joints - chains.moved
    h = 1e-3
    for i in (0, 17, 30):
        # Here u = x/300 and v = y/300: heights and slopes by evaluation and by differences.
        x = edges[i][1:-1]
        here, left, right = (
            wall.point(*(planes[i].to_world(np.stack([x + d, 0 * x], axis=-1))[:, :2] / 300.0).T)[:, 2]
            for d in (0.0, -h, h)
        )
        assert own[i, 1:-1, 0] == pytest.approx(here, abs=1e-9)
        assert np.tan(own[i, 1:-1, 1]) == pytest.approx((right - left) / (2.0 * h), abs=1e-7)


def test_the_reported_deviation_is_that_of_a_dense_polyline_in_the_plane(wall, difficult) -> None:
    planes, edges, chains = difficult
    dense = points_batch(chains.parameters, np.linspace(0.0, 1.0, 513))
    for i in range(36):
        for j in range(5):
            points = dense[i, j][within(planes[i].to_world(dense[i, j]))]
            x = np.arange(edges[i, j] - 50.0, edges[i, j + 1] + 50.0, 0.25)
            x = np.sort(np.concatenate([x, edges[i, [0, -1]]]))
            plan = planes[i].to_world(np.stack([x, 0.0 * x], axis=-1))
            x, plan = x[within(plan)], plan[within(plan), :2] / 300.0  # u = x/300 and v = y/300
            line = np.stack([x, wall.point(*plan.T)[:, 2]], axis=-1)
            # The distance from the polyline's two edges beside its nearest point; it ends where the wall ends.
            near = cKDTree(line).query(points)[1]
            distance = np.inf
            for first in (np.maximum(near - 1, 0), np.minimum(near, len(x) - 2)):
                along, away = line[first + 1] - line[first], points - line[first]
                share = np.clip((along * away).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-30), 0.0, 1.0)
                distance = np.minimum(distance, np.linalg.norm(away - share[:, None] * along, axis=1))
            # The report looks at 33 stations only, and to the first order.
            assert distance.max() == pytest.approx(chains.deviation[i, j], rel=0.02, abs=0.004 * TOLERANCE)


def test_the_distance_in_space_is_no_greater_and_agrees_with_a_brute_search(wall, difficult) -> None:
    planes, _, chains = difficult
    stations = np.linspace(0.05, 0.95, 41)
    hard = np.argsort(-np.nan_to_num(chains.deviation[2:-2, 1:-1]).max(axis=1))[:3] + 2
    u = np.linspace(0.0, 10.0, 401)
    grid = wall.point(u[:, None], u[None, :]).reshape(-1, 3)
    tree = cKDTree(grid)
    for i in hard:
        for j in range(1, 4):
            points = planes[i].to_world(points_batch(chains.parameters[i : i + 1, j], stations)[0])
            computed = surface_deviation(wall, points)
            assert np.abs(computed.signed).max() <= chains.deviation[i, j] * 1.01 + 1e-9
            for k in (0, 10, 20, 30, 40):
                near = tree.query(points[k])[1]
                first = (u[near // 401], u[near % 401])
                best = least_squares(lambda q, p=points[k]: wall.point(*q) - p, first, xtol=1e-12, ftol=1e-12)
                assert np.sqrt(2.0 * best.cost) == pytest.approx(abs(computed.signed[k]), abs=1e-6)


def test_only_points_inside_count(wall) -> None:
    planes = parallel_planes("x", [1000.0, 1450.0])
    edges = np.tile(np.linspace(0.0, 3000.0, 6), (2, 1))
    whole = rationalise(wall, planes, edges, 2.0, rounds=0)

    def left(points):
        return points[..., 0] < 600.0

    part = rationalise(wall, planes, edges, 2.0, inside=left, rounds=0)
    assert np.isfinite(part.deviation).tolist() == [[True, False, False, False, False]] * 2
    assert part.parameters.tolist() == whole.parameters.tolist(), "what does not count is fitted all the same"
    assert part.deviation[:, 0] == pytest.approx(whole.deviation[:, 0], rel=0.05)
    # Where only the good pieces count, the bad ones move no joint.
    good, bad = whole.deviation[0].argmin(), whole.deviation[0].argmax()
    between = 0.5 * (whole.deviation[0, good] + whole.deviation[0, bad])
    low, high = edges[0, good] + 1e-3, edges[0, good + 1] - 1e-3

    def easy(points):
        return (points[..., 0] > low) & (points[..., 0] < high)

    assert not rationalise(wall, planes[:1], edges[:1], between, inside=easy).moved.any()
    assert rationalise(wall, planes[:1], edges[:1], between).moved.any()


def test_a_plane_that_misses_spoils_no_other_chain(swept) -> None:
    edges = np.tile(EDGES, (4, 1))
    alone = rationalise(swept, parallel_planes("x", [0.0, 300.0, 600.0]), edges[:3], 0.5)
    chains = rationalise(swept, parallel_planes("x", [0.0, 300.0, 5000.0, 600.0]), edges, 0.5)
    assert (chains.status[2] > 1).all()
    for values in (chains.parameters, chains.deviation, chains.first_deviation, chains.joints):
        assert np.isnan(values[2]).all()
    kept = [0, 1, 3]
    assert chains.parameters[kept].tolist() == alone.parameters.tolist()
    assert chains.deviation[kept].tolist() == alone.deviation.tolist()
    nothing = rationalise(swept, parallel_planes("x", [5000.0]), edges[:1], 0.5)
    assert np.isnan(nothing.deviation).all()


def test_chains_do_not_depend_on_the_company_they_keep(wall, difficult) -> None:
    planes, edges, chains = difficult
    some = [1, 12, 20, 34]
    alone = rationalise(wall, [planes[i] for i in some], edges[some], TOLERANCE, inside=within)
    # Only the price of force is common to those that are fitted together; but moves of the joints follow from it.
    moved = (chains.moved[some] != 0.0).any(axis=(1, 2))
    assert moved.tolist() == [True, False, False, True]
    assert alone.deviation[~moved] == pytest.approx(chains.deviation[some][~moved], abs=0.01 * TOLERANCE)
    worst, before = (np.nanmax(c, axis=1) for c in (alone.deviation, chains.deviation[some]))
    assert worst == pytest.approx(before, abs=0.1 * TOLERANCE)


def test_progress_is_told_in_portions(swept) -> None:
    told: list[tuple[int, int]] = []
    planes = parallel_planes("x", np.linspace(0.0, 900.0, 19))
    rationalise(swept, planes, np.tile(EDGES, (19, 1)), 0.5, progress=lambda done, of: told.append((done, of)))
    assert told == [(8, 19), (16, 19), (19, 19)]


def test_chains_between_others() -> None:
    def chains(numbers: list[float]) -> Chains:
        n = np.array(numbers)
        planes = parallel_planes("x", n)
        shaped = [np.tile(n.reshape(-1, *[1] * d), (1, *[2] * d)) for d in (1, 2, 2, 2, 1, 1, 1, 1)]
        return Chains(planes, *shaped)

    together = chains([0.0, 10.0, 20.0, 30.0]).with_between(np.array([0, 2]), chains([5.0, 25.0]))
    wanted = [0.0, 5.0, 10.0, 20.0, 25.0, 30.0]
    assert [p.origin[1] for p in together.planes] == wanted
    for name in Chains.__dataclass_fields__:
        if name != "planes":
            assert getattr(together, name).reshape(6, -1)[:, 0].tolist() == wanted, name


@pytest.mark.parametrize(
    ("edges", "tolerance", "says"),
    [
        ([[0.0, 600.0]] * 3, 0.5, r"shape \(3, 2\) for 2 planes"),
        ([0.0, 600.0], 0.5, r"shape \(2,\)"),
        ([[0.0]] * 2, 0.5, r"shape \(2, 1\)"),
        ([[0.0, 600.0, 600.0]] * 2, 0.5, "ascending"),
        ([[0.0, np.nan]] * 2, 0.5, "ascending"),
        ([[0.0, 600.0]] * 2, 0.0, "tolerance = 0"),
        ([[0.0, 600.0]] * 2, np.nan, "tolerance = nan"),
    ],
)
def test_bad_input_gets_one_clear_line(edges, tolerance, says) -> None:
    flat = BSplineSurface([0, 0, 9, 9], [0, 0, 9, 9], 1, 1, [[(0, 0, 0), (0, 9, 0)], [(9, 0, 0), (9, 9, 0)]])
    with pytest.raises(InvalidInputError, match=says):
        rationalise(flat, parallel_planes("x", [1.0, 2.0]), edges, tolerance)


def test_a_flat_surface_gives_lines(made_surfaces) -> None:
    flat = made_surfaces.graph(lambda x, y: 0.3 * x - 0.1 * y, (0.0, 1200.0), (0.0, 600.0), (8, 8), 3)
    planes = parallel_planes("x", [0.0, 300.0], turn_rad=0.2, centre=(600.0, 300.0))
    chains = rationalise(flat, planes, np.tile([-400.0, 0.0, 300.0], (2, 1)), 0.5)
    assert (chains.status <= 1).all()
    assert chains.deviation.max() < 1e-9
    assert not chains.moved.any()
    assert np.abs(chains.parameters[..., 3]).max() < 1e-12
    slope = (intersect_planes(flat, planes, [0.0]).slope).ravel()
    assert np.tan(chains.parameters[..., 2]) == pytest.approx(np.tile(slope[:, None], (1, 2)), abs=1e-12)
    assert_smooth(chains)


def test_easing_lets_moves_swell_and_fade_within_the_tolerance(wall, difficult) -> None:
    """Neighbours that keep the tolerance no longer jump against one another, and none leaves it for that."""
    planes, edges, chains = difficult
    soft = eased(wall, chains, TOLERANCE, inside=within)
    before, after = (np.nan_to_num(c.deviation).max(axis=1) for c in (chains, soft))
    kept = before <= TOLERANCE
    assert 5 < kept.sum() < len(kept)
    assert (after[kept] <= TOLERANCE).all()
    assert np.array_equal(soft.parameters[~kept], chains.parameters[~kept])
    assert np.array_equal(soft.joints[~kept], chains.joints[~kept])
    jumps = [np.abs(np.diff(c.moved[..., 1], axis=0)).max(axis=1)[kept[1:] & kept[:-1]] for c in (chains, soft)]
    assert jumps[1].max() < 0.7 * jumps[0].max()
    assert np.abs(chains.joints - chains.moved - soft.joints + soft.moved).max() < 1e-12
    assert_smooth(soft)
    ends = points_batch(soft.parameters, [0.0, 1.0])
    assert np.abs(ends[:, :, 0] - np.stack([edges[:, :-1], soft.joints[:, :-1, 0]], axis=-1)).max() < 1e-8
    deviation = soft.deviation
    again = surface_deviation(
        wall,
        np.stack([p.to_world(points_batch(q, np.linspace(0.0, 1.0, 33))) for p, q in zip(planes, soft.parameters)]),
        extend=0.25,
    )
    worst = np.abs(again.signed).max(axis=-1)
    inner = np.isfinite(deviation) & (np.arange(len(planes)) > 4)[:, None] & (np.arange(len(planes)) < 31)[:, None]
    assert (worst[inner] <= deviation[inner] * 1.02 + 1e-3).all()  # in space no farther than in the plane


def test_nothing_is_eased_where_nothing_was_moved(swept) -> None:
    planes = parallel_planes("x", np.linspace(0.0, 300.0, 5))
    chains = rationalise(swept, planes, np.tile(EDGES, (5, 1)), TOLERANCE)
    assert eased(swept, chains, TOLERANCE) is chains
    with pytest.raises(InvalidInputError, match=r"tolerance = 0.0; allowed are numbers above 0"):
        eased(swept, chains, 0.0)
