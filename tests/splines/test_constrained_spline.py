"""Constrained splines: what holds at each type of knot, measured on the curves; libspiro's paths; invariance; the MVC."""

import itertools

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.kernels import four_parameter
from batten.splines.constrained_spline import ConstrainedSpline, constrained_spline
from batten.splines.interpolating_spline import interpolating_spline

OPEN = np.array([[0.0, 0.0], [1.0, 0.6], [2.2, 0.2], [3.0, 1.0], [4.0, 0.8], [5.0, 1.6]])
BOW = np.array([[0.0, 0.0], [0.8, 1.2], [2.0, 1.9], [3.4, 2.0], [4.6, 1.4], [5.2, 0.2]])
RING = np.array([[0.0, 0.0], [2.0, -0.4], [3.0, 0.8], [1.6, 2.0], [0.1, 1.2]])


def _angle_gap(a: float, b: float) -> float:
    return abs(np.remainder(a - b + np.pi, 2.0 * np.pi) - np.pi)


def _misses(spline: ConstrainedSpline) -> dict[str, float]:
    """By letter the greatest miss of what holds there, measured on the curves; "points": over the length of the segment.

    Derivatives of curvature count times the chord's power, against 1 + their own size. Where a run was replaced by Euler
    spirals what counts is the angle, and between two of them the curvature.
    """
    found = dict.fromkeys(["points", *set(spline.types)], 0.0)
    n, m, chords = len(spline.points), len(spline.segments), spline.chords
    for i, s in enumerate(spline.segments):
        for t, p in ((0.0, spline.points[i]), (1.0, spline.points[(i + 1) % n])):
            found["points"] = max(found["points"], np.hypot(*(s.point(t) - p)) / s.length)

    def value(i: int, side: int, order: int) -> float:
        s = spline.segments[i]
        return float(s.curvature_at(s.length if side else 0.0, order))

    for j, asked in enumerate(spline.types):
        letter = "c" if j in spline.relaxed else asked
        after = j if j < m else None
        before = (j - 1) % m if spline.closed or j > 0 else None
        replaced = {i for i in (before, after) if i is not None and spline.statuses[i] == "not converged"}
        gaps = []
        if before is not None and after is not None and letter not in "va":
            gaps.append(_angle_gap(spline.segments[before].end_angle, spline.segments[after].start_angle))
            orders = 3 if letter == "o" else 1
            if replaced:
                orders = 1 if len(replaced) == 2 else 0
            for order in range(orders):
                scale = min(chords[before], chords[after]) ** (order + 1)
                one, other = scale * value(before, 1, order), scale * value(after, 0, order)
                gaps.append(abs(one - other) / (1.0 + abs(one)))
        for i, side in ((before, 1), (after, 0)):
            if i is None or spline.parameters[i] != 4 or i in replaced:
                continue
            outer = letter in "v{}" or (letter == "[" and side == 0) or (letter == "]" and side == 1)
            orders = [2] if letter == "c" else [0] if letter == "a" else [1, 2] if outer else []
            size = 1.0 + max(abs(value(i, side, k)) * chords[i] ** (k + 1) for k in range(4))
            gaps += [abs(value(i, side, k)) * chords[i] ** (k + 1) / size for k in orders]
        found[letter] = max([found.get(letter, 0.0), *gaps])
    for i, count in enumerate(spline.parameters):
        assert not np.any(spline.middle[i, count:])
    return found


def _loops(spline: ConstrainedSpline) -> bool:
    """Whether a tangent is more than half a turn from its chord at an end of a segment, or turns by a full one within."""
    steps = np.diff(np.vstack([spline.points, spline.points[:1]]), axis=0)
    for s, (x, y) in zip(spline.segments, steps, strict=False):
        angles = s.angle_at(np.linspace(0.0, s.length, 200))
        # The tangent in the middle is less than half a turn from the chord by definition.
        middle = float(s.angle_at(0.5 * s.length))
        chord = middle - (np.remainder(middle - np.arctan2(y, x) + np.pi, 2.0 * np.pi) - np.pi)
        if np.abs(angles[[0, -1]] - chord).max() > np.pi + 1e-6 or np.ptp(angles) > 2.0 * np.pi + 1e-2:
            return True
    return False


@pytest.mark.parametrize(
    "types",
    ["{oooo}", "{cccc}", "{ococ}", "{oo[]}", "{vcoo}", "{coah}", "{[]oo}", "{c[c]}", "{oo[o}", "{o]co}"]
    + [t + "z" for t in ("ooooo", "ccccc", "ocooc", "o[]co", "ovocv", "ocah" + "o")],
)
def test_what_holds_at_each_type_of_knot(types):
    points = BOW[: len(types)] if types[0] == "{" else RING
    spline = constrained_spline(points, types)
    assert (spline.status, spline.message) == ("converged", "")
    misses = _misses(spline)
    assert misses.pop("points") < 1e-14
    assert max(misses.values()) < 1e-12
    assert spline.residual < 1e-12
    assert spline.types == types.replace("z", "").replace("h", "")


def test_continuity_of_a_smooth_knot_ends_with_the_second_derivative():
    """κ‴ jumps at an `o`, κ′ at a `c`: what holds is no accident of these points."""
    smooth, g2 = constrained_spline(OPEN, "{oooo}"), constrained_spline(OPEN, "{cccc}")
    for spline, order in ((smooth, 3), (g2, 1)):
        for a, b in itertools.pairwise(spline.segments):
            assert abs(a.curvature_at(a.length, order) - b.curvature_at(0.0, order)) > 1e-3


def test_points_on_a_circle_give_the_circle():
    random = np.random.default_rng(4)
    angles = np.sort(random.uniform(0.0, 2.0 * np.pi, 9))
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for types in ("o" * 9 + "z", "{" + "o" * 7 + "}", "{" + "c" * 7 + "}", "{ococooc}"):
        curve = constrained_spline(points, types).curve
        assert np.abs(np.hypot(*curve.point(np.linspace(0.0, 1.0, 300)).T) - 1.0).max() < 1e-12


def test_a_line_between_brackets_is_straight_and_joined_without_curvature():
    spline = constrained_spline([[0, 0], [1, 1], [2, 1.2], [4, 1.2], [5, 0.5], [5, -1]], "{o[]o}")
    assert spline.parameters.tolist() == [4, 4, 0, 4, 4]
    line = spline.segments[2]
    assert not line.curvatures.any()
    assert line.length == 2.0
    assert line.start_angle == 0.0
    before, after = spline.segments[1], spline.segments[3]
    assert abs(before.end_angle) < 1e-14
    assert abs(after.start_angle) < 1e-14
    assert abs(before.curvature_at(before.length)) < 1e-13
    assert abs(after.curvature_at(0.0)) < 1e-13


# Two paths of libspiro's documentation, and what libspiro 20221101 (Debian) finds for them by `run_spiro`: k₀ … k₃ of the
# segments; it ends its iteration at about 1e-12.
_PATH_5 = (
    "{c[]c[]c[]c}",
    [0, 0, 100, 100, 200, 200, 300, 200, 400, 150, 300, 100, 200, 100, 150, 50, 100, 0, 0, -100, -50, -200],
)
_PATH_6 = (
    "{cahcahcahc}",
    [0, 0, 100, 100, 200, 200, 300, 200, 300, 150, 200, 100, 150, 100, 150, 50, 100, 0, 0, -100, 50, -100],
)
_CURVES = [
    [0.9608828, 0.0, 0.0, 0.0],
    [-2.1588783, -2.8265534, 21.4329298, 42.8658595],
    [-1.4548261, -3.8374139, -2.7832849, 5.5665698],
    [-1.4548261, 3.8374139, -2.7832849, -5.5665698],
    [2.1290378, -3.9343738, -24.5773484, 49.1546968],
    [-0.0538958, 2.233293, -6.3765041, -12.7530082],
    [0.8784543, -1.6552587, -10.2365018, 20.4730036],
    [-0.4139094, 0.0, 0.0, 0.0],
]


@pytest.mark.parametrize(("path", "last"), [(_PATH_5, (-80, -250)), (_PATH_6, (20, -150))])
def test_libspiros_own_examples(path, last):
    types, places = path
    spline = constrained_spline(np.reshape([*places, *last], (-1, 2)), types)
    curved = spline.middle[spline.parameters > 0]
    assert spline.status == "converged"
    np.testing.assert_allclose(curved, _CURVES, atol=2e-7)


def test_the_handle_gives_the_tangent_and_its_distance_means_nothing():
    points = np.array([[0, 0], [1, 1], [2, 1.5], [3, 1], [4, 2.0]])
    for handle in ([2.3, 1.6], [3.5, 2.0]):
        spline = constrained_spline(np.insert(points, 3, handle, axis=0), "{oaho}")
        wanted = np.arctan2(0.1, 0.3)
        assert len(spline.segments) == 4
        assert spline.segments[1].end_angle == pytest.approx(wanted, abs=1e-13)
        assert spline.segments[2].start_angle == pytest.approx(wanted, abs=1e-13)
        np.testing.assert_array_equal(spline.points, points)


def test_points_of_type_c_are_the_euler_spiral_spline():
    spline = constrained_spline(OPEN, "{cccc}")
    other = interpolating_spline(OPEN, "euler", start="arc", end="arc")
    for a, b in zip(spline.segments, other.segments, strict=True):
        np.testing.assert_allclose(a.point(0.4), b.point(0.4), atol=1e-13)
    assert spline.parameters.tolist() == [1, 2, 2, 2, 1]


# --- invariance ---

_BRACKETS = str.maketrans("[]{}", "][}{")


@pytest.mark.parametrize("types", ["{oooo}", "{oc[]}", "o[]coc" + "z", "{coah}"])
def test_similarity_and_mirror_change_nothing(types):
    spline = constrained_spline(OPEN, types)
    t = np.array([0.2, 0.7])
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    for points, back in [
        (3.0 * OPEN @ turn + [5.0, -2.0], lambda p: ((p - [5.0, -2.0]) / 3.0) @ turn.T),
        (OPEN * [1.0, -1.0], lambda p: p * [1.0, -1.0]),
    ]:
        other = constrained_spline(points, types)
        for a, b in zip(spline.segments, other.segments, strict=True):
            np.testing.assert_allclose(back(b.point(t)), a.point(t), atol=1e-11)


@pytest.mark.parametrize("types", ["{oooo}", "{oc[]}", "o[]coc" + "z"])
def test_reversal_changes_nothing(types):
    spline = constrained_spline(OPEN, types)
    letters = types.rstrip("z")[::-1].translate(_BRACKETS) + ("z" if types.endswith("z") else "")
    other = constrained_spline(OPEN[::-1], letters)
    m = len(spline.segments)
    for i, a in enumerate(spline.segments):
        b = other.segments[(m - 2 - i) % m if spline.closed else m - 1 - i]
        np.testing.assert_allclose(b.point(0.7), a.point(0.3), atol=1e-11)


def test_reversal_with_a_handle():
    """The handle of the reversed path lies on the other side of its anchor."""
    points = np.array([[0, 0], [1, 1], [2, 1.5], [2.3, 1.6], [3, 1], [4, 2.0]])
    spline = constrained_spline(points, "{oaho}")
    other = constrained_spline([[4, 2], [3, 1], [2, 1.5], [1.7, 1.4], [1, 1], [0, 0]], "{oaho}")
    for a, b in zip(spline.segments, other.segments[::-1], strict=True):
        np.testing.assert_allclose(b.point(0.7), a.point(0.3), atol=1e-11)


@pytest.mark.parametrize(("types", "points"), [("{oooo}", OPEN), ("ooooo" + "z", RING)])
@pytest.mark.parametrize("segment", [0, 2, 4])
def test_splines_of_type_o_are_extensional(types, points, segment):
    """A point of the curve added to the points changes nothing."""
    spline = constrained_spline(points, types)
    extra = spline.segments[segment].point(0.37)
    again = constrained_spline(np.insert(points, segment + 1, extra, axis=0), types[:1] + "o" + types[1:])
    assert again.status == "converged"
    for i, old in enumerate(spline.segments):
        if i != segment:
            np.testing.assert_allclose(again.segments[i + (i > segment)].point(0.4), old.point(0.4), atol=1e-10)
    assert again.variation_energy() == pytest.approx(spline.variation_energy(), rel=1e-10)


# --- energies ---


def test_energies_against_integration():
    spline = constrained_spline(OPEN, "{oco[}")
    x, w = np.polynomial.legendre.leggauss(30)
    bending = variation = 0.0
    for s in spline.segments:
        places = 0.5 * s.length * (x + 1.0)
        bending += 0.5 * s.length * w @ s.curvature_at(places) ** 2
        variation += 0.5 * s.length * w @ s.curvature_at(places, 1) ** 2
    assert spline.bending_energy() == pytest.approx(bending, rel=1e-13)
    assert spline.variation_energy() == pytest.approx(variation, rel=1e-13)


def _variation(points: np.ndarray, tangents: np.ndarray, curvatures: np.ndarray) -> float:
    """∫κ′² of segments with cubic curvature through points with given tangents and curvatures: G², each solved alone."""
    total = 0.0
    for i in range(len(points) - 1):
        d = points[i + 1] - points[i]
        chord, angle = np.hypot(*d), np.arctan2(d[1], d[0])
        wanted = np.array(
            [tangents[i] - angle, curvatures[i] * chord, tangents[i + 1] - angle, curvatures[i + 1] * chord]
        )
        k, row, work = np.zeros(4), np.empty(four_parameter.WIDTH), np.empty(10)
        for _ in range(30):
            four_parameter.segment_ends(k, work, row)
            step = np.linalg.solve(row[10:].reshape(8, 4)[[0, 1, 4, 5]], wanted - row[[2, 3, 6, 7]])
            k = k + step
            if np.abs(step).max() < 1e-13:
                break
        x, w = np.polynomial.legendre.leggauss(3)
        s = 0.5 * x
        total += 0.5 * w @ (k[1] + k[2] * s + 0.5 * k[3] * s * s) ** 2 * (row[0] / chord) ** 3
    return total


def test_type_o_is_the_mvc_to_first_order():
    """∫κ′² is below that of the Euler spiral spline, and level at the `o`-spline but for terms two orders smaller.

    Varied are tangents and curvatures at all points, by an amount that falls with the height of the points; the slope
    of the energy against its bend falls with the height's square.
    """
    shape = OPEN * [1.0, 1.0]
    random = np.random.default_rng(3)
    ways = random.normal(0.0, 0.1, (6, 2, 6))
    slopes = []
    for height in (0.4, 0.2, 0.1):
        points = shape * [1.0, height]
        spline = constrained_spline(points, "{oooo}")
        least = spline.variation_energy()
        for types in ("{cccc}", "{ocoo}"):
            assert constrained_spline(points, types).variation_energy() > 1.0001 * least
        tangents = np.array([s.start_angle for s in spline.segments] + [spline.segments[-1].end_angle])
        last = spline.segments[-1]
        curvatures = np.array([s.curvatures[0] for s in spline.segments] + [last.curvature_at(last.length)])
        assert _variation(points, tangents, curvatures) == pytest.approx(least, rel=1e-10)
        ratio = []
        for by_tangent, by_curvature in height * ways:
            up, down = (
                _variation(points, tangents + sign * by_tangent, curvatures + sign * by_curvature)
                for sign in (1.0, -1.0)
            )
            assert up + down > 2.0 * least
            ratio.append(abs(up - down) / (up + down - 2.0 * least))
        slopes.append(np.mean(ratio))
    order = np.log2(np.array(slopes[:-1]) / slopes[1:])
    assert order[-1] == pytest.approx(2.0, abs=0.15)


# --- hard input, status, cost ---


def _random_path(random: np.random.Generator, turns: float | None, letters: str) -> tuple[np.ndarray, str]:
    n = int(random.integers(3, 31))
    if turns is None:
        points = random.uniform(0.0, 1.0, (n, 2))
    else:
        direction, size = np.cumsum(random.uniform(-turns, turns, n)), np.exp(random.uniform(-1.0, 1.0, n))
        points = np.cumsum(np.stack([size * np.cos(direction), size * np.sin(direction)], axis=1), axis=0)
    types = "".join(random.choice(list(letters), n))
    return points, types + "z" if random.integers(2) else "{" + types[1:-1] + "}"


@pytest.mark.parametrize(
    ("turns", "letters", "count", "least"),
    [(1.2, "o", 40, 24), (1.2, "ooccv[]", 40, 14), (None, "o", 30, 1), (None, "ooccv[]", 16, 1)],
)
def test_random_paths_are_solved_or_marked(turns, letters, count, least):
    """Turning angles up to 1.2 with chords up to seven times as long as others, and points uniform in a square."""
    random = np.random.default_rng(11)
    found = {"converged": 0, "relaxed": 0, "higher winding": 0, "not converged": 0}
    for i in range(count):
        points, types = _random_path(random, turns, letters)
        spline = constrained_spline(points, types, relax=i % 2 == 0)
        found[spline.status] += 1
        assert bool(spline.relaxed) == ("relaxed" in spline.statuses)
        assert (spline.message == "") == (spline.status == "converged")
        assert max(_misses(spline).values()) < 1e-9
        if spline.status in ("converged", "relaxed"):
            assert not _loops(spline)
    assert found["converged"] >= least


def test_a_turn_that_is_too_sharp_beside_a_line_has_no_spline():
    """κ = K(1 − (s + ½)³) is left between a free end and a line: at no K does the line turn from the chord by more than 83°.

    Only the run that failed is replaced, by an Euler spiral with the line's tangent; the residual is that of what was asked.
    """
    size = np.linspace(0.0, 60.0, 2001)
    middle = np.outer(size, [7.0 / 8.0, -0.75, -3.0, -6.0])
    rows, status = np.empty((len(size), four_parameter.WIDTH)), np.empty(len(size), dtype=np.int64)
    four_parameter.segment_ends_batch(middle, rows, status)
    assert np.abs(rows[:, [4, 5, 7]]).max() < 1e-11
    assert np.remainder(rows[:, 6], 2.0 * np.pi).max() == pytest.approx(np.deg2rad(82.8), abs=1e-3)
    spline = constrained_spline([[0, 0], [1, 0], [1, 1], [2, 2], [3, 2]], "{[]o}")
    assert spline.status == "not converged"
    assert spline.statuses == ("not converged", "converged", "converged", "converged")
    assert "no spline with the types between points 0 and 1 was found" in spline.message
    assert "joined G1: put a point between, or make one c or a corner" in spline.message
    assert not spline.middle[0, 2:].any()
    assert spline.residual > 0.1
    assert max(_misses(spline).values()) < 1e-12
    gentle = constrained_spline([[0, 0], [1, 0], [2, 1], [3, 2], [4, 2]], "{[]o}")
    assert gentle.status == "converged"


def test_where_there_is_no_spline_as_few_points_as_will_do_are_relaxed():
    random = np.random.default_rng(6)
    for _ in range(9):
        direction = np.cumsum(random.uniform(-1.5, 1.5, 20))
        points = np.cumsum(np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    types = "{" + "o" * 18 + "}"
    spline = constrained_spline(points, types)
    assert (spline.status, spline.relaxed) == ("relaxed", (16,))
    assert "c was taken for o at points 16: put a point between" in spline.message
    assert max(_misses(spline).values()) < 1e-11
    assert spline.residual > 0.01
    wanted = constrained_spline(points, types[:16] + "c" + types[17:])
    assert wanted.status == "converged"
    np.testing.assert_allclose(spline.middle, wanted.middle, atol=1e-9)
    assert constrained_spline(points[::-1], types).relaxed == (3,)
    strict = constrained_spline(points, types, relax=False)
    assert not strict.relaxed
    assert strict.status in ("higher winding", "not converged")


def test_a_solution_with_loops_is_marked():
    random = np.random.default_rng(11)
    marked = [
        s
        for s in (constrained_spline(*_random_path(random, None, "o"), relax=False) for _ in range(25))
        if s.status[0] == "h"
    ]
    assert marked
    for spline in marked:
        assert "make no loop" in spline.message
        assert _loops(spline) or np.ptp(np.unwrap([s.start_angle for s in spline.segments])) > np.pi


def test_many_points_take_no_more_steps_than_few():
    """The work of a step is linear: a band of 11 diagonals (`benchmarks/bench_constrained_spline.py`: to 100,000 points)."""
    random = np.random.default_rng(0)
    direction = np.cumsum(random.uniform(-0.6, 0.6, 20_000))
    points = np.cumsum(np.stack([np.cos(direction), np.sin(direction)], axis=1), axis=0)
    few, many = (constrained_spline(points[:n], "{" + "o" * (n - 2) + "}") for n in (200, 20_000))
    assert (few.status, many.status) == ("converged", "converged")
    assert many.iterations <= few.iterations + 2
    assert many.residual < 1e-12


def test_points_on_a_line_in_order_give_the_line():
    spline = constrained_spline(np.stack([np.arange(6.0), 2.0 * np.arange(6.0)], axis=1), "{oco[}")
    assert np.abs(spline.middle).max() < 1e-13
    assert spline.lengths == pytest.approx(np.sqrt(5.0))


@pytest.mark.parametrize(
    ("points", "types", "words"),
    [
        (OPEN, "{oooxo", "allowed are .*smooth, G4"),
        (OPEN, "oooooo", "begin with { or end with z"),
        (OPEN, "{oo", "one type for each"),
        (OPEN * np.nan, "{oooo}", "finite"),
        (OPEN, "{ooao}", "needs its handle"),
    ],
)
def test_bad_input_is_refused_in_words(points, types, words):
    with pytest.raises(InvalidInputError, match=words):
        constrained_spline(points, types)
