"""`batten rationalise` from a job file to a folder that `batten cut` goes on with; errors in words; a run that goes on."""

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from batten.cli.main import main
from batten.io.rhino import rhino_surface
from batten.io.rhino_curves import Drawing

JOB = """
[faces]
file = "arch.3dm"
[blocks]
greatest_mm = [900.0, 600.0]
[leaves]
spacing_mm = 40.0
tolerance_mm = 1.0
direction_deg = 0.0
[rod]
length_mm = 1300.0
width_mm = 20.0
thickness_mm = 0.8
youngs_modulus_mpa = 200000.0
max_strain = 0.008
min_bow_mm = 2.0
[blade]
kerf_mm = 1.0
speed_mm_s = 20.0
[gripper]
radius_mm = 25.0
clearance_mm = 10.0
[cell]
preset = "two-irb6620"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, made_surfaces):
    """A folder with arch.3dm, 800 × 400 mm, and its job."""
    path = tmp_path_factory.mktemp("rationalise")
    surface = made_surfaces.graph(
        lambda x, y: 120.0 * np.sin(np.pi * x / 800.0) + 0.0 * y, (0, 800), (0, 400), n=(40, 8)
    )
    draw = Drawing({"design": (0, 0, 0)}, "mm")
    draw.add("design", "arch", rhino_surface(surface), {})
    draw.write(path / "arch.3dm")
    (path / "arch.toml").write_text(JOB, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def out(folder):
    assert main(["rationalise", str(folder / "arch.toml"), "-o", str(folder / "out")]) == 0
    return folder / "out"


def test_the_folder_holds_what_its_record_says(out):
    record = json.loads((out / "rationalise.json").read_text("utf-8"))
    present = {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert present == set(record["files"])
    assert record["good"]
    assert record["blocks"] == 1
    assert record["wire_blocks"] == 2
    (patch,) = record["patches"]
    assert 0.0 < patch["percentiles_mm"]["100"] <= 1.0
    assert not list(out.parent.glob(".out*"))


def test_the_report_is_whole(out):
    text = (out / "report.html").read_text("utf-8")
    page = ElementTree.fromstring(text.split("\n", 1)[1])
    words = " ".join(page.itertext())
    assert "Can be made" in words
    assert "Against a straight wire" in words
    assert len(re.findall("data:image/png", text)) == 2


def test_the_model_holds_faces_blocks_and_leaves(out):
    model = rhino3dm.File3dm.Read(str(out / "rationalise.3dm"))
    layers = [model.Layers[o.Attributes.LayerIndex].Name for o in model.Objects]
    assert {name: layers.count(name) for name in set(layers)} == {"faces": 1, "blocks": 1, "leaves": 11, "planned": 1}
    for item in model.Objects:
        box = item.Geometry.GetBoundingBox()
        if model.Layers[item.Attributes.LayerIndex].Name == "leaves":
            assert -1.0 < box.Min.X < 1.0 < 799.0 < box.Max.X < 801.0
            assert pytest.approx(120.0, abs=1.0) == box.Max.Z


def test_the_job_that_is_written_is_cut(out, tmp_path, capsys):
    assert (
        main(["cut", str(out / "jobs/patch-01/job.toml"), "-o", str(tmp_path / "cut"), "--no-pictures", "--json"]) == 0
    )
    summary = json.loads(capsys.readouterr().out)
    assert summary["whole"]
    assert summary["blocks"] == 1
    assert summary["leaves"] == 11
    worst = {c["name"]: c["worst"] for c in summary["checks"]}
    planned = json.loads((out / "rationalise.json").read_text("utf-8"))["patches"][0]
    assert worst["deviation"] + planned["percentiles_mm"]["100"] <= 1.0


def test_a_run_that_was_stopped_goes_on(folder, monkeypatch, capsys):
    """The second run finds what the first had decided, and does not search again."""
    from batten.io import rationalise_files

    def fail(*_, **__):
        raise OSError("the drive is full")

    job, target = str(folder / "arch.toml"), folder / "again"
    with monkeypatch.context() as patched:
        patched.setattr(rationalise_files, "write_cut_jobs", fail)
        assert main(["rationalise", job, "-o", str(target), "--no-pictures"]) == 2
    assert not target.exists()
    assert list((folder / ".again.patches").glob("*.npz"))
    monkeypatch.setattr("batten.fabrication.rationalisation.decide_patch", fail)
    assert main(["rationalise", job, "-o", str(target), "--no-pictures"]) == 0
    assert not (folder / ".again.patches").exists()
    capsys.readouterr()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('file = "arch.3dm"', 'file = "vault.3dm"', "no such file"),
        ("tolerance_mm = 1.0", "tolerance_mm = 0.0", "leaves.tolerance_mm = 0.0: must be a number > 0"),
        ("spacing_mm = 40.0", "spacing = 40.0", "did you mean spacing_mm?"),
        ("direction_deg = 0.0", 'direction_deg = "along"', "direction_deg"),
        ("length_mm = 1300.0", "length_mm = 60.0", "both grippers"),
        ("[cell]", "[cells]", "unknown field"),
        ("spacing_mm = 40.0", "spacing_mm = 700.0", "at most the block's"),
        ('file = "arch.3dm"', 'file = "arch.3dm"\nnames = ["roof"]', "no face 'roof'"),
    ],
)
def test_wrong_jobs_are_told_in_one_line(old, new, said, folder, capsys):
    job = folder / "wrong.toml"
    assert old in JOB
    job.write_text(JOB.replace(old, new, 1), encoding="utf-8")
    assert main(["rationalise", str(job), "-o", str(folder / "wrong")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (folder / "wrong").exists()


def test_a_foreign_folder_is_left_alone(folder, out, tmp_path, capsys):
    foreign = tmp_path / "theirs"
    foreign.mkdir()
    (foreign / "letter.txt").write_text("mine", encoding="utf-8")
    assert main(["rationalise", str(folder / "arch.toml"), "-o", str(foreign), "--no-pictures"]) == 2
    assert (foreign / "letter.txt").read_text("utf-8") == "mine"
    assert "was not made by batten" in capsys.readouterr().err


def test_what_cannot_be_made_ends_with_one(folder, capsys):
    job = folder / "thick.toml"
    job.write_text(JOB.replace("max_strain = 0.008", "max_strain = 0.0001"), encoding="utf-8")
    assert main(["rationalise", str(job), "-o", str(folder / "thick"), "--no-pictures"]) == 1
    assert "take a thinner rod" in capsys.readouterr().out
    assert Path(folder / "thick/report.html").is_file()


def test_a_mesh_is_taken_as_well(folder):
    """The same arch as a mesh: as many blocks, and hardly farther off than the mesh's own facets."""
    u, v = np.meshgrid(np.linspace(0, 800, 81), np.linspace(0, 400, 21), indexing="ij")
    points = np.stack([u, v, 120.0 * np.sin(np.pi * u / 800.0)], axis=-1).reshape(-1, 3)
    index = np.arange(81 * 21).reshape(81, 21)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4) + 1
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + [
        f"f {' '.join(map(str, q))}" for q in quads.tolist()
    ]
    (folder / "arch.obj").write_text("\n".join(rows), encoding="utf-8")
    job = JOB.replace('file = "arch.3dm"', 'file = "arch.obj"\nscale_mm_per_unit = 1.0')
    (folder / "mesh.toml").write_text(job, encoding="utf-8")
    assert main(["rationalise", str(folder / "mesh.toml"), "-o", str(folder / "mesh")]) == 0
    record = json.loads((folder / "mesh/rationalise.json").read_text("utf-8"))
    assert record["blocks"] == 1
    assert record["greatest_mm"] < 1.0
