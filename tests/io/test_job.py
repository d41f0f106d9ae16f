"""Job files: what the issue's own example gives, and one line with a way out for everything that is wrong."""

import dataclasses
import shutil
from pathlib import Path
from typing import Annotated

import pytest
from pydantic import ConfigDict, TypeAdapter

from batten.errors import BattenError, FormatError, InvalidInputError
from batten.fabrication import job as plain
from batten.fabrication.section import FlatSection, RoundSection, TubeSection
from batten.io import cell_fields, job_fields
from batten.io.job import load_job
from batten.io.job_reference import job_reference

STRICT = ConfigDict(strict=True, allow_inf_nan=False)
ROOT = Path(__file__).parents[2]
JOB = """\
[surface]
file = "freeform-surface.3dm"      # or: curves = "design.3dm" (planar design splines on a layer), lofted
scale_mm_per_unit = 300.0
[blocks]
size_mm = [600.0, 600.0]           # plan size; height follows from the relief and the clearances
direction = "u"                    # which way the blade lies; "auto" picks the better one and says why
[leaves]
spacing_mm = 20.0
tolerance_mm = 0.5
[rod]
length_mm = 1000.0
diameter_mm = 3.0
youngs_modulus_mpa = 200000.0
max_strain = 0.008
[blade]
kerf_mm = 1.0
speed_mm_s = 20.0
[cell]
preset = "two-irb6620"             # base frames, tools, limits of both robots; own values possible
"""


@pytest.fixture
def write(tmp_path):
    shutil.copy(ROOT / "examples/freeform-wall/freeform-surface.3dm", tmp_path)

    def write_job(old: str = "", new: str = "") -> Path:
        assert old in JOB
        path = tmp_path / "wall.toml"
        path.write_text(JOB.replace(old, new, 1) if old else JOB, encoding="utf-8")
        return path

    return write_job


def test_the_documented_job_loads(write):
    job = load_job(write())
    assert job.surface.source.is_absolute()
    assert job.surface.source.is_file()
    assert dataclasses.replace(job, path=None, surface=dataclasses.replace(job.surface, file=None)) == plain.CutJob(
        name="wall",
        surface=plain.SurfaceJob(scale_mm_per_unit=300.0),
        blocks=plain.BlocksJob(size_mm=(600.0, 600.0), direction="u"),
        leaves=plain.LeavesJob(spacing_mm=20.0, tolerance_mm=0.5),
        rod=plain.RodJob(length_mm=1000.0, diameter_mm=3.0, youngs_modulus_mpa=200000.0, max_strain=0.008),
        blade=plain.BladeJob(kerf_mm=1.0, speed_mm_s=20.0),
        cell=plain.CellJob(preset="two-irb6620"),
    )


@pytest.mark.parametrize(
    ("fields", "section"),
    [
        ("diameter_mm = 3.0", RoundSection(3.0)),
        ("diameter_mm = 8\nwall_mm = 0.5", TubeSection(8.0, 0.5)),
        ("width_mm = 20.0\nthickness_mm = 0.5", FlatSection(20.0, 0.5)),
    ],
)
def test_a_rod_is_round_or_a_tube_or_flat(write, fields, section):
    job = load_job(write("diameter_mm = 3.0", fields))
    assert job.rod.section == section


@pytest.mark.parametrize(
    ("fields", "wanted"),
    [
        ("offset = false", plain.KerfJob(offset=False)),
        (
            "speeds_mm_s = [5, 20, 40]\nwidths_mm = [2.8, 1.0, 0.7]\nside = 'upper'",
            plain.KerfJob(side="upper", speeds_mm_s=(5.0, 20.0, 40.0), widths_mm=(2.8, 1.0, 0.7)),
        ),
        (
            "formula = 'a + b / v'\na = 0.4\nb = 12\nmax_speed_mm_s = 40",
            plain.KerfJob(formula="a + b / v", a=0.4, b=12.0, max_speed_mm_s=40.0),
        ),
    ],
)
def test_the_kerf_is_a_number_a_table_or_a_formula(write, fields, wanted):
    assert load_job(write("[cell]\n", f"[kerf]\n{fields}\n[cell]\n")).kerf == wanted


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ("offset = 1", ":19: kerf.offset = 1: must be true or false; try true"),
        ("speeds_mm_s = [5.0]", "kerf.speeds_mm_s = [5.0]: must be 2 to 100 values, each a number > 0"),
        ("speeds_mm_s = [5.0, 9.0]", ":18: kerf: the kerf as a function of speed needs speeds_mm_s and widths_mm, or"),
        ("speeds_mm_s = [9.0, 5.0]\nwidths_mm = [2.0, 1.0]", "above 0, ascending"),
        ("formula = 'a + b'", 'must be "a + b / v" or "a * v^-b"'),
        ("min_speed_mm_s = 50\nmax_speed_mm_s = 20", "min_speed_mm_s = 50 must be below max_speed_mm_s = 20"),
        ("formula = 'a + b / v'\na = 0.4\nb = 30", ":18: kerf: blade.kerf_mm = 1, but [kerf] gives 1.9 mm"),
        ("formula = 'a + b / v'\na = 0.4\nb = 30", "try kerf_mm = 1.9, or speed_mm_s = 50"),
    ],
)
def test_a_kerf_that_is_none(write, fields, says):
    with pytest.raises(InvalidInputError) as caught:
        load_job(write("[cell]\n", f"[kerf]\n{fields}\n[cell]\n"))
    assert says in str(caught.value)


def test_planes_are_parallel_unless_a_fan_is_asked_for(write):
    old = load_job(write()).leaves
    assert (old.planes, old.turn_deg, old.border_turn_deg) == ("parallel", 0.0, "auto")
    text = 'tolerance_mm = 0.5\nplanes = "fan"\nturn_deg = "auto"\nborder_turn_deg = 1.5'
    new = load_job(write("tolerance_mm = 0.5", text)).leaves
    assert (new.planes, new.turn_deg, new.border_turn_deg) == ("fan", "auto", 1.5)
    with pytest.raises(InvalidInputError, match=r'leaves.planes = "cone": must be "parallel" or "fan"'):
        load_job(write("tolerance_mm = 0.5", 'tolerance_mm = 0.5\nplanes = "cone"'))
    with pytest.raises(InvalidInputError, match=r"leaves.border_turn_deg = -1"):
        load_job(write("tolerance_mm = 0.5", "tolerance_mm = 0.5\nborder_turn_deg = -1.0"))


def test_own_values_of_an_arm_reach_the_cell(write):
    own = """[cell]
left.base_mm = [-1800, 0, 0]
left.kinematics = { a1_mm = 320, a2_mm = -200, b_mm = 0, c1_mm = 680, c2_mm = 975, c3_mm = 887, c4_mm = 200 }
right.joint_min_deg = [-170, -65, -180, -300, -130, -300]
"""
    cell = load_job(write("[cell]\n", own)).cell
    assert cell.left.base_mm == (-1800.0, 0.0, 0.0)
    assert cell.left.kinematics is not None
    assert cell.left.kinematics.c2_mm == 975.0
    assert cell.right.joint_min_deg == (-170.0, -65.0, -180.0, -300.0, -130.0, -300.0)
    assert cell.right.base_mm is None


@pytest.mark.parametrize(
    ("old", "new", "kind", "says"),
    [
        ("600.0, 600.0", "-600.0, 600.0", InvalidInputError, ":5: blocks.size_mm = [-600.0, 600.0]: must be"),
        ("600.0, 600.0", "600.0", InvalidInputError, "must be 2 values"),
        ("= 0.5", "= 0", InvalidInputError, ":9: leaves.tolerance_mm = 0: must be a number > 0"),
        ("= 0.5", "= nan", InvalidInputError, "leaves.tolerance_mm = nan"),
        ("= 0.5", "= inf", InvalidInputError, "leaves.tolerance_mm = inf"),
        ("= 0.5", '= "0.5"', InvalidInputError, "try 0.5"),
        ("= 20.0", "= true", InvalidInputError, "leaves.spacing_mm = true"),
        ("spacing_mm = 20.0", "spacing_mm = 2000.0", InvalidInputError, "must be at most the block's 600 mm"),
        (
            "length_mm = 1000.0",
            "length_mm = 500.0",
            InvalidInputError,
            ":11: rod.length_mm = 500: a rod must be longer",
        ),
        (
            "tolerance_mm",
            "tolerence_mm",
            FormatError,
            ":9: leaves.tolerence_mm: unknown field; did you mean tolerance_mm?",
        ),
        (
            "max_strain = 0.008\n",
            "",
            FormatError,
            "rod.max_strain is missing; must be a number > 0 and ≤ 0.1; try 0.008",
        ),
        (
            "diameter_mm = 3.0\n",
            "",
            InvalidInputError,
            ":10: rod: a rod's section needs diameter_mm (round), diameter_mm and wall_mm (tube), or width_mm and "
            "thickness_mm (flat strip); got none of them; try diameter_mm = 3.0",
        ),
        ("diameter_mm = 3.0", "wall_mm = 1", InvalidInputError, ":10: rod: a rod's section needs"),
        ("diameter_mm = 3.0", "diameter_mm = 3.0\nwidth_mm = 20", InvalidInputError, "got diameter_mm and width_mm"),
        ("diameter_mm = 3.0", "diameter_mm = 3.0\nwall_mm = 1.5", InvalidInputError, "below half the diameter, 1.5"),
        ("diameter_mm = 3.0", "width_mm = 2\nthickness_mm = 3", InvalidInputError, "allowed is at most the width"),
        ("diameter_mm = 3.0", "diameter_mm = 0", InvalidInputError, ":12: rod.diameter_mm = 0: must be a number > 0"),
        (
            "diameter_mm = 3.0",
            "width_mm = 2\nthicknes_mm = 3",
            FormatError,
            ":13: rod.thicknes_mm: unknown field; did you mean thickness_mm?",
        ),
        ('"freeform-surface.3dm"', '"absent.3dm"', InvalidInputError, "no such file"),
        ('file = "freeform-surface.3dm"', "", InvalidInputError, "exactly one of `file` and `curves`, got neither"),
        ("scale_mm", 'curves = "a.3dm"\nscale_mm', InvalidInputError, "exactly one of `file` and `curves`, got both"),
        ('"u"', '"w"', InvalidInputError, ':6: blocks.direction = "w": must be "u" or "v" or "auto"'),
        (
            "tolerance_mm = 0.5",
            'tolerance_mm = 0.5\nturn_deg = "left"',
            InvalidInputError,
            ':10: leaves.turn_deg = "left"',
        ),
        ("[blade]", "[blaed]", FormatError, ":15: blaed: unknown field; did you mean blade? (and 1 more field)"),
        ("[blade]", "[blade", FormatError, "not a TOML file: Expected ']'"),
        ("[cell]", "[[cell]]", InvalidInputError, "must be one section [cell]"),
        (
            "[cell]\n",
            "[cell]\nleft.base_mm = [1, 2]\n",
            InvalidInputError,
            "cell.left.base_mm = [1, 2]: must be 3 values",
        ),
        (
            "[cell]\n",
            "[cell]\nleft.joint_min_deg = [9, 1, 1, 1, 1, 1]\nleft.joint_max_deg = [8, 2, 2, 2, 2, 2]\n",
            InvalidInputError,
            "joint 1 has limits 9 … 8",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(write, old, new, kind, says):
    path = write(old, new)
    with pytest.raises(BattenError) as caught:
        load_job(path)
    message = str(caught.value)
    assert type(caught.value) is kind
    assert says in message
    assert message.startswith(str(path))
    assert "\n" not in message


def test_a_job_file_that_is_not_there_or_no_text(tmp_path):
    with pytest.raises(InvalidInputError, match="no such file"):
        load_job(tmp_path / "absent.toml")
    with pytest.raises(InvalidInputError, match="cannot be read"):
        load_job(tmp_path)
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(FormatError, match="not a text file in UTF-8"):
        load_job(tmp_path / "picture.toml")


@pytest.mark.parametrize(
    ("section", "values"),
    [
        (job_fields.SurfaceSection, plain.SurfaceJob),
        (job_fields.BlocksSection, plain.BlocksJob),
        (job_fields.LeavesSection, plain.LeavesJob),
        (job_fields.RodSection, plain.RodJob),
        (job_fields.BladeSection, plain.BladeJob),
        (job_fields.GripperSection, plain.GripperJob),
        (cell_fields.ArmSection, plain.ArmJob),
        (cell_fields.KinematicsSection, plain.KinematicsJob),
        (cell_fields.CellSection, plain.CellJob),
    ],
)
def test_the_file_and_the_values_have_the_same_fields(section, values):
    plain_fields = {f.name: f for f in dataclasses.fields(values)}
    assert set(section.model_fields) == set(plain_fields)
    for name, field in section.model_fields.items():
        assert field.description, f"{section.__name__}.{name} is not described"
        if not field.is_required() and field.default_factory is None:
            assert field.default == plain_fields[name].default


def test_every_example_in_the_reference_is_allowed():
    for model in (*vars(job_fields).values(), *vars(cell_fields).values()):
        if not (isinstance(model, type) and issubclass(model, job_fields.Section)) or model is job_fields.Section:
            continue
        for field in model.model_fields.values():
            for example in field.examples or ():
                kind = Annotated[field.annotation, *(field.metadata or [None])]
                TypeAdapter(kind, config=STRICT).validate_python(example)


def test_the_reference_is_in_sync():
    page = (ROOT / "docs/job-file.md").read_text(encoding="utf-8")
    assert page == job_reference(), "renew it: python -m batten.io.job_reference > docs/job-file.md"
