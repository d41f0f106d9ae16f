"""The foliations of examples/foliations: what they are drawn to be, how close to elastica, and every one of them cut."""

import importlib.util
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from batten.cli.main import main
from batten.io.job import load_job
from batten.io.rhino import read_design_curves
from batten.splines.elastic_spline_design import ElasticSplineDesign
from batten.studies.foliations import PAPER_5_1, PAPER_5_2
from batten.surfaces.isocurves import isocurve_pieces, isocurve_residuals
from batten.surfaces.loft import loft

ROOT = Path(__file__).parents[2]
FOLDER, PAGE = ROOT / "examples/foliations", ROOT / "docs/design-a-surface.md"
JOBS = sorted(path.stem for path in FOLDER.glob("*.toml"))
TWELVE = JOBS[:12]


def example(name, folder=FOLDER):
    spec = importlib.util.spec_from_file_location(f"foliations_{name}", folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def designs():
    return example("designs")


def surface(name):
    job = load_job(FOLDER / f"{name}.toml").surface
    read = read_design_curves(job.source, layer=job.layer)
    return loft(read.curves, read.positions, blade_axis=read.blade_axis)


def test_the_file_holds_what_was_drawn(designs):
    assert [*designs.DESIGNS] == JOBS
    for name in JOBS:
        drawn = designs.design(name)
        assert drawn.blade_axis == "x"
        assert np.array_equal(surface(name).control_points, drawn.surface.control_points)
        assert len({s.control_points.tobytes() for s in drawn.splines}) == len(drawn.splines)
        assert all(ElasticSplineDesign(s).broken == () for s in drawn.splines)  # all in their good regions


def test_the_file_can_be_written_again(designs, tmp_path, monkeypatch):
    monkeypatch.setattr(designs, "FOLDER", tmp_path)
    designs.main()
    for name in ("01-arch-to-valley", "six-blocks"):
        new, kept = (read_design_curves(folder / "designs.3dm", layer=name) for folder in (tmp_path, FOLDER))
        assert all(
            np.array_equal(a.control_points, b.control_points) for a, b in zip(new.curves, kept.curves, strict=True)
        )
    monkeypatch.setitem(designs.DESIGNS, "six-blocks", ((designs.SIX, 0, 900, -900, 900, 0, 0),) * 4)
    with pytest.raises(SystemExit, match="six-blocks: piece 0"):
        designs.main()


def bends(name):
    """Areas between the leaves' pieces and their chords over the chord squared, (49, 2): positive if convex downwards."""
    pieces = isocurve_pieces(surface(name), np.linspace(0.0, 600.0, 49))
    a, d = pieces[..., 0, :], pieces[..., 3, :]
    t = np.linspace(0.0, 1.0, 201)[:, None]
    points = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]) @ pieces
    chord = (d - a)[..., None, :]
    off = points - a[..., None, :]
    return -(chord[..., 0] * off[..., 1] - chord[..., 1] * off[..., 0]).mean(axis=-1) / (chord**2).sum(axis=-1)[..., 0]


def ends(name):
    points = surface(name).point(np.array([[0.0], [1.0]]), np.linspace(0.0, 600.0, 49))
    return points[..., 2]


@pytest.mark.parametrize("name", TWELVE[:3])
def test_from_concave_to_convex(name):
    bend = bends(name)
    assert bend[0, 0] < -0.03 < 0.03 < bend[-1, 0]  # the left block at least


@pytest.mark.parametrize(("name", "right"), [*zip(TWELVE[3:6], (True, False, True))])
def test_fixed_ends(name, right):
    assert (np.ptp(ends(name), axis=1) < 1e-9).tolist() == [True, right]


@pytest.mark.parametrize("name", TWELVE[6:9])
def test_one_end_up_the_other_down(name):
    left, right = ends(name)
    assert left[-1] > left[0] + 200.0
    assert right[-1] < right[0] - 200.0
    assert (np.diff(left) > 0.0).all()
    assert (np.diff(right) < 0.0).all()


def test_the_same_two_boundary_curves():
    first, *others = (surface(name) for name in TWELVE[9:])
    u = np.linspace(0.0, 1.0, 101)
    for other in others:
        for v in (0.0, 600.0):
            assert np.abs(first.point(u, v) - other.point(u, v)).max() < 1e-9
        assert np.abs(first.point(u, 300.0) - other.point(u, 300.0)).max() > 100.0


@pytest.mark.parametrize("name", JOBS)
def test_no_isocurve_comes_near_to_the_threshold_of_the_thesis(name):
    """Table 5.1, and between the 49 curves of it: < 0.21."""
    for count in (49, 961):
        assert isocurve_residuals(surface(name), count).worst < 0.21


def page_rows(head):
    """The rows of a table of the page, by their first cell; the thesis's under the name of the row before with a star."""
    table = PAGE.read_text("utf-8").split(f"| {head} |")[1].split("\n\n")[0].split("\n")[2:]
    return [
        (cells[0].strip(), [float(v) for v in cells[1:]]) for cells in (row.strip("| ").split("|") for row in table)
    ]


def test_the_page_shows_table_5_1_as_it_is():
    tables = example("tables")
    rows = dict(page_rows("greatest λ-residual (Table 5.1)"))
    for i, name in enumerate(TWELVE):
        curves = tables.design_curves(name)
        found = loft(curves.curves, curves.positions)
        assert rows["design curves"][i] == pytest.approx(isocurve_residuals(found, curves.positions).worst, abs=0.00501)
        assert rows["all curves"][i] == pytest.approx(isocurve_residuals(found, 49).worst, abs=0.00501)
        assert [rows["thesis, design curves"][i], rows["thesis, all curves"][i]] == [v[i] for v in PAPER_5_1]


def test_the_page_shows_table_5_2_as_it_is():
    numbers = example("tables").numbers("six-blocks")
    assert (len(numbers.positions), int(numbers.design.sum())) == (55, 7)
    assert set(numbers.status) == {"converged"}
    rows = page_rows("Table 5.2")
    shown = np.array([values for _, values in rows])
    assert shown[0::2] == pytest.approx(numbers.statistics().reshape(3, 8), rel=0.02)
    assert shown[1::2] == pytest.approx(np.array(PAPER_5_2))


def test_the_script_prints_both_tables(monkeypatch, capsys):
    tables = example("tables")
    monkeypatch.setattr(tables, "COUNT", 4)
    monkeypatch.setattr(tables, "COUNT_OF_SIX", 7)
    tables.main()
    printed = capsys.readouterr().out
    assert len(re.findall(r"^(design|all) curves( +0\.\d\d){12}$", printed, re.MULTILINE)) == 2
    numbers = r"^(λ-residual|L² distance|Hausdorff distance \(mm\))( +\d\.\d\de-\d\d){8}$"
    assert len(re.findall(numbers, printed, re.MULTILINE)) == 3
    assert len(re.findall(r"^(\d\d|six)-\S+ .* 0, 0$", printed, re.MULTILINE)) == 13


@pytest.mark.parametrize(
    ("picture", "name"),
    [
        ("rectification", "design-surface"),
        pytest.param("foliations", "foliations", marks=pytest.mark.slow),
        pytest.param("six_blocks", "six-blocks", marks=pytest.mark.slow),
    ],
)
def test_pictures_can_be_drawn_again(picture, name, tmp_path):
    getattr(example("design_a_surface", ROOT / "examples"), picture)(tmp_path / "new.png")
    kept = ROOT / f"docs/pictures/{name}.png"
    assert kept.stat().st_size < 200_000
    with Image.open(kept) as old, Image.open(tmp_path / "new.png") as new:
        assert old.size == new.size
        assert len(set(new.convert("L").tobytes())) > 20


@pytest.mark.parametrize("name", JOBS)
def test_every_job_is_cut(name, tmp_path, capsys):
    """With leaves a little farther apart than the jobs have them, to save time."""
    shutil.copy(FOLDER / "designs.3dm", tmp_path)
    text = (FOLDER / f"{name}.toml").read_text("utf-8")
    assert text.count("spacing_mm = 20.0") == 1
    job = tmp_path / "job.toml"
    job.write_text(text.replace("spacing_mm = 20.0", "spacing_mm = 30.0"), "utf-8")
    assert main(["cut", str(job), "-o", str(tmp_path / "out")]) == 0, capsys.readouterr().out
    assert (tmp_path / "out/report.html").is_file()
    assert "FAIL" not in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", JOBS)
def test_every_job_is_cut_as_it_stands(name, tmp_path):
    assert main(["cut", str(FOLDER / f"{name}.toml"), "-o", str(tmp_path / "out")]) == 0
    assert main(["check", str(tmp_path / "out")]) == 0
