"""A simulation beside its cut: whole, with sums that are true, in a report that shows it."""

import json
import re
import shutil
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from batten.errors import FormatError, InvalidInputError
from batten.io import simulation_files
from batten.io.cut_check import check_cut
from batten.io.cut_json import files_of_cut, read_cut_json
from batten.io.scan_reading import read_scan
from batten.io.simulation_files import simulate_folder, simulation_lines, simulation_record, write_simulation

NEW = {f"simulation/{name}" for name in ("simulation.html", "simulation.json", "deviation.png", "swept.ply")}


@pytest.fixture(scope="module")
def block(real_cut, tmp_path_factory):
    """A copy of the cut with the program of block 13 alone, and its simulation."""
    folder = tmp_path_factory.mktemp("block") / "out"
    shutil.copytree(real_cut.out, folder)
    for path in (folder / "rapid").glob("*.mod"):
        if "_B013_" not in path.name:
            path.unlink()
    return folder, *simulate_folder(folder)


@pytest.fixture
def out(real_cut, tmp_path):
    shutil.copytree(real_cut.out, tmp_path / "out")
    return tmp_path / "out"


def test_the_simulation_joins_the_cut(block, out):
    _, stored, simulation = block
    before = (out / "cut.json").read_text(encoding="utf-8").split("\n")
    write_simulation(simulation, stored, out)
    after = (out / "cut.json").read_text(encoding="utf-8").split("\n")
    changed = [line[:8] for a, line in zip(before, after) if a != line]
    assert changed == ['"files":']
    assert len(before) == len(after)
    again, findings = check_cut(out)
    assert [f.what for f in findings if not f.agrees] == []
    assert set(again.files) - set(stored.files) == NEW
    assert files_of_cut(out) == {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert not [p for p in out.parent.iterdir() if p != out]
    text = {name: (out / name).read_bytes() for name in (*NEW, "report.html", "cut.json")}
    write_simulation(simulation, again, out)  # once more: the same files
    assert {name: (out / name).read_bytes() for name in text} == text


def test_report_and_page_show_the_figures(block, out):
    _, stored, simulation = block
    assert "Not simulated yet" in (out / "report.html").read_text(encoding="utf-8")
    write_simulation(simulation, stored, out)
    figures = simulation_record(simulation, cut="x")["face"]
    for name in ("report.html", "simulation/simulation.html"):
        text = (out / name).read_text(encoding="utf-8")
        page = ET.fromstring(text.split("\n", 1)[1])
        words = " ".join("".join(page.itertext()).split())
        assert f"{figures['max_mm']:.3f}" in words
        assert "between leaves" in words
        images = [e.get("src") for e in page.iter() if e.tag.endswith("img")]
        assert all(i.startswith("data:image/") for i in images)
        assert "Not simulated yet" not in text
    report = (out / "report.html").read_text(encoding="utf-8")
    listed = dict(re.findall(r"<code>([^<]+)</code></td><td class=\"n\"><code>(\w{12})</code>", report))
    sums = read_cut_json(out / "cut.json").files
    assert listed == {name: total[:12] for name, total in sums.items() if name != "report.html"}


def test_the_mesh_lies_on_the_design(block, out, real_cut):
    _, stored, simulation = block
    write_simulation(simulation, stored, out)
    points = read_scan(out / "simulation" / "swept.ply")
    box = stored.plan.block(13)
    assert (points >= box.corner_mm - 0.01).all()
    assert (points <= box.corner_mm + box.size_mm + 0.01).all()
    from batten.io.job_surface import read_job_surface
    from batten.surfaces.deviation import surface_deviation

    assert surface_deviation(read_job_surface(stored.job.surface), points).max < simulation.face.max + 1e-3


def test_what_was_changed_stays_told(block, out):
    """A module and a report that somebody changed are taken as they are, and `batten check` tells of them as before."""
    _, stored, simulation = block
    module = sorted((out / "rapid").glob("*.mod"))[0]
    module.write_text(module.read_text(encoding="ascii").replace("z5", "z1"), encoding="ascii")
    (out / "report.html").write_text("<p>signed</p>", encoding="utf-8")
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    write_simulation(simulation, stored, out)
    assert (out / "report.html").read_text(encoding="utf-8") == "<p>signed</p>"
    assert (out / "notes.txt").read_text(encoding="utf-8") == "mine"
    told = {f.what for f in check_cut(out)[1] if not f.agrees}
    assert {f"rapid/{module.name}", "report.html"} <= told
    assert not NEW & told


def test_an_error_leaves_the_folder_as_it_was(block, out, monkeypatch):
    _, stored, simulation = block
    before = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}

    def full(*words):
        raise OSError(28, "no space left")

    monkeypatch.setattr(simulation_files, "write_cut_json", full)
    with pytest.raises(OSError, match="no space"):
        write_simulation(simulation, stored, out)
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == before
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_the_numbers_are_those_of_the_simulation(block):
    _, stored, simulation = block
    record = json.loads(json.dumps(simulation_record(simulation, cut="wall"), allow_nan=False))
    (only,) = record["blocks"]
    swept = simulation.blocks[0]
    assert record["blocks_without_program"] == [n for n in range(1, 26) if n != 13]
    assert record["failing_blocks"] == record["blocks_without_program"]
    assert only["face"]["max_mm"] == np.abs(swept.signed).max() == record["face"]["max_mm"]
    assert only["at_leaves"]["max_mm"] == np.abs(swept.signed[swept.is_at_leaf]).max()
    assert only["face"]["points"] == only["at_leaves"]["points"] + only["between_leaves"]["points"]
    size, area = np.abs(swept.signed), swept.areas
    order = np.argsort(size)
    share = np.cumsum(area[order]) / area.sum()
    assert only["face"]["percentiles_mm"]["95"] == size[order][np.searchsorted(share, 0.95)]
    assert record["half_kerf"] is stored.job.kerf.offset
    lines = simulation_lines(simulation, cut="wall")
    assert "no robot program" in lines[0]
    assert f"{record['face']['max_mm']:.3f}" in lines[2]


def test_a_folder_that_is_no_cut(tmp_path, block):
    with pytest.raises(FormatError, match=r"cut\.json: no such file"):
        simulate_folder(tmp_path)
    with pytest.raises(InvalidInputError, match="allowance_mm = -1"):
        simulate_folder(block[0], allowance_mm=-1.0)
