"""From modules to paths: the rods' ends are those of the plan, whatever frames the modules declare."""

import shutil

import numpy as np
import pytest

from batten.errors import FormatError
from batten.fabrication.plan import gripper_frames
from batten.fabrication.robot.cell import cell_from_job
from batten.io.cut_json import read_cut_json
from batten.io.simulation_paths import read_rod_paths


@pytest.fixture(scope="module")
def stored(real_cut):
    return read_cut_json(real_cut.out / "cut.json")


@pytest.fixture(scope="module")
def cell(stored):
    return cell_from_job(stored.job.cell)


@pytest.fixture
def modules(real_cut, tmp_path):
    """A folder with the modules of block 7."""
    for path in (real_cut.out / "rapid").glob("*_B007_*.mod"):
        shutil.copyfile(path, tmp_path / path.name)
    return tmp_path


def module(folder, side):
    return next(folder.glob(f"*_{side}.mod"))


def rewrite(path, old, new, count=-1):
    text = path.read_text(encoding="ascii")
    assert old in text
    path.write_text(text.replace(old, new, count), encoding="ascii")


def test_every_block_has_the_rods_of_the_plan(real_cut, stored, cell):
    plan = stored.plan
    paths = read_rod_paths(real_cut.out / "rapid", cell)
    assert [p.block for p in paths] == [m.block for m in plan.motions]
    for path, motion in zip(paths, plan.motions):
        frames = gripper_frames([plan.rods[i] for i in motion.rods])
        pose = plan.block(motion.block).work_frame(plan.blade_axis)
        rows = [i for i, label in enumerate(path.labels) if label.startswith("leaf")]
        assert path.is_leaf.nonzero()[0].tolist() == rows
        assert [path.labels[i] for i in rows] == [f"leaf {plan.rods[i].leaf}" for i in motion.rods]
        for k, (arm, sign) in enumerate(((path.left, 1.0), (path.right, -1.0))):
            places = arm[rows, :3, 3] @ pose[:3, :3].T + pose[:3, 3]
            assert np.abs(places - frames.positions_mm[:, k]).max() < 2e-3
            assert np.abs(sign * arm[rows, :3, 2] @ pose[:3, :3].T - frames.tangents[:, k]).max() < 2e-5
        assert path.seconds[rows[0] : rows[-1]] == pytest.approx(motion.seconds[1:-1], abs=2e-3)


def test_another_tool_or_work_object_moves_the_rod(modules, cell):
    """The controller believes the module: with a tool 3 mm shorter it holds the rod 3 mm farther."""
    (before,) = read_rod_paths(modules, cell)
    rewrite(module(modules, "L"), "[TRUE,[[187.939,0.000,218.404]", "[TRUE,[[187.939,3.000,218.404]")
    (after,) = read_rod_paths(modules, cell)
    moved = after.left[:, :3, 3] - before.left[:, :3, 3]
    assert np.linalg.norm(moved, axis=1) == pytest.approx(3.0, abs=1e-6)
    assert np.array_equal(after.right, before.right)
    rewrite(module(modules, "R"), '"",[[0.000,0.000,600.000]', '"",[[0.000,2.000,600.000]')
    (last,) = read_rod_paths(modules, cell)
    assert np.abs(last.right[:, :3, 3] - before.right[:, :3, 3] - [0.0, 2.0, 0.0]).max() < 1e-9


def test_modules_must_belong_together(modules, cell, tmp_path):
    rewrite(module(modules, "R"), "\\ID:=30,", "\\ID:=35,")
    with pytest.raises(FormatError, match=r"ID:=30 is in one of them only"):
        read_rod_paths(modules, cell)
    rewrite(module(modules, "R"), "\\ID:=35,", "\\ID:=30,")
    rewrite(module(modules, "R"), "! block 7,", "! block 8,")
    with pytest.raises(FormatError, match="must name one block; got 7 and 8"):
        read_rod_paths(modules, cell)
    rewrite(module(modules, "R"), "! block 8,", "! block 7,")
    for side in "LR":
        shutil.copyfile(module(modules, side), modules / f"copy_{side}.mod")
    with pytest.raises(FormatError, match="block 7 has two programs"):
        read_rod_paths(modules, cell)
    (modules / "copy_R.mod").unlink()
    with pytest.raises(FormatError, match=r"copy_R.mod is missing"):
        read_rod_paths(modules, cell)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(FormatError, match="holds no RAPID module"):
        read_rod_paths(empty, cell)
