"""JSON of a bent rod: plain JSON, every number back bit by bit, one line with a way out for what is wrong."""

import dataclasses
import json
import math
import struct

import pytest

from batten.errors import BattenError, FormatError, InvalidInputError
from batten.fabrication.rod import Rod
from batten.fabrication.section import FlatSection, TubeSection
from batten.io.bend_json import bend_json, read_bend_json
from batten.io.bend_numbers import BendProblem, bend_numbers
from batten.solvers.boundary_value import BoundarySolution


def bits(value):
    return struct.pack("<d", value)


@pytest.fixture
def write(tmp_path):
    def write_text(text):
        path = tmp_path / "bend.json"
        path.write_text(text, encoding="utf-8")
        return path

    return write_text


def test_what_was_written_comes_back_bit_by_bit(bent, write):
    stored = read_bend_json(write(bend_json(bent.problem, bent.solutions, bent.rod)))
    assert stored.problem == bent.problem
    assert stored.rod == bent.rod
    assert stored.software.startswith("batten")
    assert len(stored.solutions) == 4
    for back, was in zip(stored.solutions, bent.by_energy):
        assert [bits(v) for v in back.elastica.parameters] == [bits(v) for v in was.elastica.parameters]
        assert back.ends == was.ends
        for field in dataclasses.fields(BoundarySolution)[1:-1]:
            value, expected = getattr(back, field.name), getattr(was, field.name)
            assert type(value) is type(expected)
            assert bits(value) == bits(expected)
    again = bend_json(stored.problem, stored.solutions, stored.rod)
    assert again == bend_json(bent.problem, bent.solutions, bent.rod)


def test_it_is_plain_json_with_all_that_the_table_says(bent):
    data = json.loads(bend_json(bent.problem, bent.solutions, bent.rod), parse_constant=pytest.fail)
    assert (data["format"], data["schema"], data["unit"]) == ("batten bend", 1, "mm")
    assert data["solutions"][0]["margin"] == "Infinity"
    assert data["problem"]["end"] == [600.0, 100.0]
    assert data["rod"]["bending_stiffness_nmm2"] == bent.rod.bending_stiffness_nmm2
    for entry, row in zip(data["solutions"], bend_numbers(bent.solutions, bent.rod)):
        assert entry["number"] == row.number
        assert entry["scaled_energy"] == 1000.0 * row.solution.energy
        assert entry["rod"]["energy_j"] == row.rod.energy_j
        assert entry["rod"]["too_strained"] is True
        assert math.hypot(*entry["rod"]["force_n"]) == pytest.approx(entry["rod"]["force_size_n"], rel=1e-14)
    without = json.loads(bend_json(bent.problem, bent.solutions))
    assert (without["unit"], without["rod"]) == (None, None)
    assert "rod" not in without["solutions"][0]


@pytest.mark.parametrize("section", [TubeSection(8.0, 0.5), FlatSection(20.0, 0.1)])
def test_every_section_comes_back_and_no_solutions_are_a_list_too(bent, write, section):
    rod = Rod(123.4, section, 70000.0, 0.002)
    stored = read_bend_json(write(bend_json(bent.problem, [], rod)))
    assert stored.rod == rod
    assert stored.solutions == ()


def test_the_energy_in_j_and_the_moments_from_the_ends_alone(bent):
    """The force is the same all along: the moments at the ends differ by force × lever arm; energy by summing up M²/2EI."""
    stiffness = bent.rod.bending_stiffness_nmm2
    for row in bend_numbers(bent.solutions, bent.rod):
        arm = (bent.problem.end[0] - bent.problem.start[0], bent.problem.end[1] - bent.problem.start[1])
        lever = arm[0] * row.rod.force_n[1] - arm[1] * row.rod.force_n[0]
        assert row.rod.moment_end_nmm - row.rod.moment_start_nmm == pytest.approx(lever, rel=1e-9)
        steps = 20000
        curve = row.solution.elastica
        moments = stiffness * curve.curvature_at([(i + 0.5) * 1000.0 / steps for i in range(steps)])
        assert row.rod.energy_j == pytest.approx(
            1e-3 * float((moments**2).sum()) / (2 * stiffness) * 1000.0 / steps, rel=1e-6
        )
        assert row.rod.strain == pytest.approx(1.5 * float(abs(moments).max()) / stiffness, rel=1e-6)
        assert row.rod.least_radius_mm == pytest.approx(stiffness / float(abs(moments).max()), rel=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "kind", "says"),
    [
        ('"schema": 1', '"schema": 2', FormatError, "schema = 2: this batten"),
        ('"batten bend"', '"batten cut"', FormatError, "format = 'batten cut': must be"),
        ('"problem"', '"riddle"', FormatError, "problem: 'problem' is missing"),
        ('"parameters":[0.0,', '"parameters":[', FormatError, "solutions[0]: an elastica has seven parameters"),
        ('"margin":"Infinity"', '"margin":"large"', FormatError, "solutions[0]: 'large' is missing"),
        ('"diameter_mm":3.0', '"diameter_mm":-3.0', FormatError, "rod: a round section's diameter_mm = -3.0"),
        ('"length":1000.0', '"length":NaN', FormatError, "NaN is no JSON number"),
        ("{", "", FormatError, "not a JSON file"),
    ],
)
def test_what_is_wrong_is_named(bent, write, old, new, kind, says):
    text = bend_json(bent.problem, bent.solutions, bent.rod)
    assert old in text
    path = write(text.replace(old, new, 1))
    with pytest.raises(BattenError) as caught:
        read_bend_json(path)
    assert type(caught.value) is kind
    assert says in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InvalidInputError, match="no such file"):
        read_bend_json(tmp_path / "absent.json")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"start": (0.0, math.nan)}, "start = "),
        ({"end": (0.0,)}, "end = "),
        ({"end_angle": math.inf}, "end_angle = inf"),
        ({"length": 0.0}, "length = 0.0; allowed are numbers above 0"),
        ({"max_inflections": -1}, "max_inflections = -1"),
    ],
)
def test_what_is_no_problem_is_refused_by_name(change, says):
    values = {"start": (0.0, 0.0), "start_angle": 0.0, "end": (1.0, 0.0), "end_angle": 0.0, "length": 2.0}
    with pytest.raises(InvalidInputError) as caught:
        BendProblem(**(values | change))
    assert says in str(caught.value)
