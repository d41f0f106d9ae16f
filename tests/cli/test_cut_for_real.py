"""`batten cut` and `batten check` on the example's own job, and its files read back by other means than wrote them."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import rhino3dm

from batten.cli.main import main
from batten.io.cut_json import read_cut_json
from batten.io.rods_table import read_rods_csv

WALL = Path(__file__).parents[2] / "examples/freeform-wall"
ROD_MM = 1100.0  # from the job file: the one length that the program itself does not hold
STATIONS = 200
SCALE = np.array([1e-3, 1e-6, 1e-6])  # of (κ(0), λ₁, λ₂)


@pytest.fixture(scope="module")
def stored(real_cut):
    return read_cut_json(real_cut.out / "cut.json").plan


@pytest.fixture(scope="module")
def programs(real_cut, rapid_reader):
    """For every block: both modules as they are read, and the leaves that their comments name."""
    found = {}
    for left in sorted((real_cut.out / "rapid").glob("*_L.mod")):
        modules = [
            rapid_reader.read_module(path.read_text(encoding="ascii"))
            for path in (left, left.with_name(left.name.replace("_L.mod", "_R.mod")))
        ]
        leaves = [[int(x) for x in re.findall(r"leaf (\d+)", "\n".join(m.comments))] for m in modules]
        assert leaves[0] == leaves[1]
        found[int(re.search(r"_B(\d+)_L", left.name).group(1))] = (*modules, leaves[0])
    return found


@pytest.fixture(scope="module")
def from_modules(programs, rapid_reader, stored):
    """Every rod's ends and tangents as the modules tell them, in the order of the plan's rods that are cut."""
    ends = {}
    for block, (left, right, leaves) in programs.items():
        for leaf, *rod in zip(leaves, *rapid_reader.rods(left, right), strict=True):
            ends[block, leaf] = np.array(rod)
    kept = [r for r in stored.rods if r.status == "ok"]
    assert set(ends) == {(r.block, r.leaf) for r in kept}
    return np.array([ends[r.block, r.leaf] for r in kept])


@pytest.fixture(scope="module")
def planned(stored):
    """The same rods from cut.json: points at 201 stations, in the work frames; (n, 201, 3)."""
    inverse = {b.number: np.linalg.inv(b.work_frame(stored.blade_axis)) for b in stored.blocks}
    points = []
    for rod in (r for r in stored.rods if r.status == "ok"):
        world = rod.plane.to_world(rod.rod.point_at(np.linspace(0.0, rod.rod.length, STATIONS + 1)))
        points.append(world @ inverse[rod.block][:3, :3].T + inverse[rod.block][:3, 3])
    return np.array(points)


def bent(unknowns, angle0):
    """Rods from θ(0), κ(0), λ₁, λ₂ by classical Runge–Kutta in their planes: x, y, θ at all stations, (n, 201, 3).

    Two steps from station to station: with one, the strongest bent rods are off by 4e-5 mm.
    """
    kappa0, force_x, force_y = unknowns.T
    h = 0.5 * ROD_MM / STATIONS

    def rate(state):
        x, y, theta = state.T
        return np.stack([np.cos(theta), np.sin(theta), kappa0 + x * force_y - y * force_x], axis=1)

    state = np.stack([0.0 * kappa0, 0.0 * kappa0, angle0], axis=1)
    path = [state]
    for _ in range(2 * STATIONS):
        k1 = rate(state)
        k2 = rate(state + 0.5 * h * k1)
        k3 = rate(state + 0.5 * h * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        path.append(state)
    return np.stack(path[::2], axis=1)


def solved(ends, first):
    """Rods of the known length through given ends and tangents, by Newton's method on (κ(0), λ₁, λ₂); points in space."""
    start, end, tangent0, tangent1 = np.swapaxes(ends, 0, 1)
    chord = end - start
    along = chord * np.array([1.0, 1.0, 0.0])
    x_axis = along / np.linalg.norm(along, axis=1, keepdims=True)
    wanted_x, wanted_y = (chord * x_axis).sum(axis=1), chord[:, 2]
    angle0, angle1 = (np.arctan2(t[:, 2], (t * x_axis).sum(axis=1)) for t in (tangent0, tangent1))

    def miss(unknowns, rows):
        last = bent(unknowns, angle0[rows])[:, -1]
        turn = (last[:, 2] - angle1[rows] + np.pi) % (2.0 * np.pi) - np.pi
        return np.stack([last[:, 0] - wanted_x[rows], last[:, 1] - wanted_y[rows], 300.0 * turn], axis=1)

    unknowns = first.copy()
    rows = np.arange(len(first))
    for _ in range(40):
        here = miss(unknowns[rows], rows)
        size = np.linalg.norm(here, axis=1)
        rows, here, size = rows[size > 1e-8], here[size > 1e-8], size[size > 1e-8]
        if not len(rows):
            break
        at = unknowns[rows]
        columns = [(miss(at + 1e-5 * step, rows) - here) / 1e-5 for step in np.diag(SCALE)]
        move = -SCALE * np.linalg.solve(np.stack(columns, axis=2), here[..., None])[..., 0]
        for share in (1.0, 0.3, 0.05):
            good = np.linalg.norm(miss(at + share * move, rows), axis=1) < size
            unknowns[rows[good]] = (at + share * move)[good]
            rows, at, move, size = rows[~good], at[~good], move[~good], size[~good]
            if not len(rows):
                break
        rows = np.arange(len(first))
    else:
        pytest.fail(f"rods {rows} could not be solved")
    path = bent(unknowns, angle0)
    return start[:, None] + path[..., :1] * x_axis[:, None] + path[..., 1:2] * np.array([0.0, 0.0, 1.0])


def test_the_examples_wall_can_be_made_whole(real_cut):
    assert real_cut.status == 0
    summary = real_cut.summary
    assert summary["whole"] is True
    assert summary["refused_leaves"] == []
    assert summary["blocks"] == 25
    assert summary["rods"] >= 25 * 31
    assert len(list((real_cut.out / "rapid").iterdir())) == 2 * 25
    page = (real_cut.out / "report.html").read_text(encoding="utf-8")
    for check in summary["checks"]:
        assert check["title"] in page
        assert check["rods_beyond"] == 0 or not check["hard"]


def test_it_agrees_with_itself_when_it_is_computed_again(real_cut, capsys):
    assert main(["check", str(real_cut.out), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert [f for f in again["findings"] if not f["agrees"]] == []
    assert again["whole"] is True


def test_every_rod_ends_in_the_modules_where_it_was_planned(from_modules, planned, stored):
    assert len(from_modules) == len([r for r in stored.rods if r.status == "ok"]) >= 25 * 31
    for side in range(2):
        gap = np.linalg.norm(from_modules[:, side] - planned[:, -side], axis=1)
        assert gap.max() < 0.01
        assert gap.max() < 0.5e-3 * np.sqrt(3.0) * (1.0 + 1e-6), "rounding to 0.001 mm and nothing else"
    kept = [r for r in stored.rods if r.status == "ok"]
    frames = {b.number: b.work_frame(stored.blade_axis)[:3, :3] for b in stored.blocks}
    for ends, rod in zip(from_modules, kept):
        for told, gripper in zip(ends[2:], rod.grippers()):
            assert told == pytest.approx(frames[rod.block].T @ gripper.tangent, abs=4e-6)


def test_rods_are_rebuilt_from_their_modules_alone(from_modules, planned, stored):
    kept = [r.rod for r in stored.rods if r.status == "ok"]
    own = np.array([[r.start_curvature, *r.force] for r in kept])
    chord = planned[:, -1] - planned[:, 0]
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    bow = np.linalg.norm(np.cross(planned - planned[:, :1], chord[:, None]), axis=2).max(axis=1)
    # Every tenth; the straightest, whose bow hangs on the third decimal; those near to buckling.
    some = np.r_[0 : len(kept) : 10, np.argsort(bow)[:10], np.argsort(-np.linalg.norm(own[:, 1:], axis=1))[:10]]
    # More than one elastica has these ends: a start that is 0.2 % off tells which is meant.
    off = 1.0 + 0.002 * np.random.default_rng(0).choice([-1.0, 1.0], own.shape)
    rebuilt = solved(from_modules[some], (own * off)[some])
    away = np.linalg.norm(rebuilt - planned[some], axis=2).max(axis=1)
    assert away.max() < 0.05
    assert np.median(away) < 0.003
    # Positions are rounded to 0.0005 mm; a chord wrong by δ changes a flat arc's bow h by 3 L δ / 16 h.
    assert (away < 0.005 + 0.25 * ROD_MM * 0.001 / bow[some]).all()


def test_the_rods_are_elastica_and_the_oracle_knows_them(planned, stored):
    # The oracle itself: from the stored numbers it runs through the stored points.
    kept = [r.rod for r in stored.rods if r.status == "ok"][::40]
    path = bent(np.array([[r.start_curvature, *r.force] for r in kept]), np.array([r.start_angle for r in kept]))
    for rod, points in zip(kept, path[..., :2]):
        own = rod.point_at(np.linspace(0.0, ROD_MM, STATIONS + 1)) - rod.start
        assert points == pytest.approx(own, abs=1e-5)


def test_rods_csv_holds_the_same_rods(real_cut, stored):
    rows = read_rods_csv(real_cut.out / "rods.csv")
    kept = [r for r in stored.rods if r.status == "ok"]
    assert [(r.block, r.leaf) for r in rows] == [(r.block, r.leaf) for r in kept]
    for row, rod in zip(rows, kept):
        left, right = rod.grippers()
        assert row.length_mm == ROD_MM
        for got, wanted in ((row.start_mm, left.position_mm), (row.end_mm, right.position_mm)):
            assert got == pytest.approx(wanted, abs=5.1e-7)
        for got, wanted in ((row.start_tangent, left.tangent), (row.end_tangent, right.tangent)):
            assert got == pytest.approx(wanted, abs=5.1e-10)
            assert got @ row.plane_normal == pytest.approx(0.0, abs=2e-9)


def test_every_geometry_of_the_rhino_file_is_valid(real_cut, stored):
    model = rhino3dm.File3dm.Read(str(real_cut.out / "cut.3dm"))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    names = {layer.Index: layer.FullPath for layer in model.Layers}
    kinds = {}
    for item in model.Objects:
        assert item.Geometry.IsValid, names[item.Attributes.LayerIndex]
        kinds.setdefault(names[item.Attributes.LayerIndex], []).append(item)
    rods = next(v for k, v in kinds.items() if k.split("::")[-1].lower() == "rods")
    by_name = {(int(i.Attributes.GetUserString("block")), int(i.Attributes.GetUserString("leaf"))): i for i in rods}
    for rod in [r for r in stored.rods if r.status == "ok"][::97]:
        curve = by_name[rod.block, rod.leaf].Geometry
        for point, gripper in zip((curve.PointAtStart, curve.PointAtEnd), rod.grippers()):
            assert np.linalg.norm(gripper.position_mm - [point.X, point.Y, point.Z]) < 1e-6


def test_the_examples_refusal_is_refused_for_what_it_says(tmp_path, capsys):
    shutil.copy(WALL / "freeform-surface.3dm", tmp_path)
    text = (WALL / "refused.toml").read_text(encoding="utf-8")
    (tmp_path / "refused.toml").write_text(text.replace("spacing_mm = 20.0", "spacing_mm = 60.0"), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["cut", str(tmp_path / "refused.toml"), "-o", str(out), "--json", "--no-pictures"]) == 1
    summary = json.loads(capsys.readouterr().out)
    assert summary["whole"] is False
    plan = read_cut_json(out / "cut.json").plan
    reasons = {r.leaf: " ".join(r.reasons) for r in plan.rods if r.status == "refused"}
    leaves = {r.leaf for r in plan.rods}
    assert {1, max(leaves)} <= set(reasons), "the straight borders"
    assert "bow of the rod over its chord" in reasons[1]
    assert "bow of the rod over its chord" in reasons[max(leaves)]
    assert sum("greatest deviation from the surface" in text for text in reasons.values()) > 5
    assert len(reasons) < 0.5 * len(leaves)
    assert summary["refused_leaves"] == sorted(reasons)
    told = {
        int(leaf)
        for path in (out / "rapid").iterdir()
        for leaf in re.findall(r"! block \d+, leaf (\d+)", path.read_text(encoding="ascii"))
    }
    assert told == leaves - set(reasons)
    assert {row.leaf for row in read_rods_csv(out / "rods.csv")} == told


def test_a_rod_shorter_than_a_leaf_is_one_line_and_status_2(tmp_path, capsys):
    shutil.copy(WALL / "freeform-surface.3dm", tmp_path)
    text = (WALL / "wall.toml").read_text(encoding="utf-8")
    text = re.sub(r"\nlength_mm = [\d.]+", "\nlength_mm = 700.0", text)
    text = re.sub(r"spacing_mm = [\d.]+", "spacing_mm = 200.0", text)
    (tmp_path / "short.toml").write_text(text, encoding="utf-8")
    assert main(["cut", str(tmp_path / "short.toml"), "-o", str(tmp_path / "short")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(r"batten: .*rod of 700 mm is shorter than a leaf.*\n", said.err)
    assert not (tmp_path / "short").exists()


def test_the_reports_head_says_what_the_check_found(real_cut, stored):
    """Rods that only pass beside their block, so that no corner stays uncut, count for no deviation."""
    page = (real_cut.out / "report.html").read_text(encoding="utf-8")
    check = next(c for c in stored.checks if c.name == "deviation")
    assert np.isnan(check.values).any(), "the example has such rods"
    shown = re.search(r"greatest deviation</\w+>\s*<\w+[^>]*>\s*([\d.]+)", page)
    assert shown is not None
    assert float(shown[1]) == pytest.approx(np.nanmax(check.values), abs=0.006)
