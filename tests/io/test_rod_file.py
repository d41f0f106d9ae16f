"""Rod files: the fields of a job's [rod] alone, at the top or under [rod], with the errors of job files."""

from pathlib import Path

import pytest

from batten.errors import BattenError, FormatError, InvalidInputError
from batten.fabrication.rod import Rod
from batten.fabrication.section import FlatSection, RoundSection, TubeSection
from batten.io.rod_file import load_rod

ROOT = Path(__file__).parents[2]
MATERIAL = "youngs_modulus_mpa = 200000.0\nmax_strain = 0.008\n"


@pytest.fixture
def write(tmp_path):
    def write_rod(text: str) -> Path:
        path = tmp_path / "rod.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write_rod


def test_the_example_and_a_whole_job_give_their_rod():
    steel = Rod(1000.0, RoundSection(3.0), 200000.0, 0.008)
    assert load_rod(ROOT / "examples/bend/rod.toml") == steel
    assert load_rod(ROOT / "examples/freeform-wall/wall.toml", 1000.0) == steel
    assert load_rod(ROOT / "examples/bend/rod.toml", 640.0).length_mm == 640.0


@pytest.mark.parametrize("head", ["", "[rod]\n"])
@pytest.mark.parametrize(
    ("sizes", "section"),
    [
        ("diameter_mm = 3\n", RoundSection(3.0)),
        ("diameter_mm = 8.0\nwall_mm = 0.5\n", TubeSection(8.0, 0.5)),
        ("width_mm = 20.0\nthickness_mm = 0.5\n", FlatSection(20.0, 0.5)),
    ],
)
def test_every_section_at_the_top_or_under_rod(write, head, sizes, section):
    path = write(head + sizes + MATERIAL)
    assert load_rod(path, 700.0) == Rod(700.0, section, 200000.0, 0.008)
    with pytest.raises(InvalidInputError, match="length_mm is missing; give the length"):
        load_rod(path)
    assert load_rod(write(head + "length_mm = 650\n" + sizes + MATERIAL)).length_mm == 650.0


@pytest.mark.parametrize(
    ("text", "kind", "says"),
    [
        ("diameter_mm = -3\n" + MATERIAL, InvalidInputError, ":1: diameter_mm = -3: must be a number > 0 and ≤ 100"),
        ("[rod]\ndiameter_mm = 0\n" + MATERIAL, InvalidInputError, ":2: rod.diameter_mm = 0: must be"),
        ("diametre_mm = 3\n" + MATERIAL, FormatError, ":1: diametre_mm: unknown field; did you mean diameter_mm?"),
        ("[rod]\n[rob]\n" + MATERIAL, FormatError, "rob: unknown field; did you mean rod?"),
        ("diameter_mm = 3\nmax_strain = 0.01\n", FormatError, "youngs_modulus_mpa is missing; must be a number ≥ 1"),
        (MATERIAL, InvalidInputError, "a rod's section needs diameter_mm (round)"),
        ("[rod]\n" + MATERIAL, InvalidInputError, ":1: rod: a rod's section needs diameter_mm (round)"),
        ("rod = 3", InvalidInputError, "must be one section [rod]"),
        ("tea", FormatError, "not a TOML file"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(write, text, kind, says):
    path = write(text)
    with pytest.raises(BattenError) as caught:
        load_rod(path, 700.0)
    message = str(caught.value)
    assert type(caught.value) is kind
    assert says in message
    assert message.startswith(str(path))
    assert "\n" not in message


def test_a_rod_file_that_is_not_there(tmp_path):
    with pytest.raises(InvalidInputError, match="no such file; give the path of a rod file"):
        load_rod(tmp_path / "absent.toml")
