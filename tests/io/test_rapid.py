"""RAPID modules: what the reader finds in them is what was planned, and they keep the rules of the language."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from batten.errors import InvalidInputError, LimitError
from batten.fabrication.robot.cell import cell_preset, pose_from_xyz
from batten.fabrication.robot.motion import plan_block_motion
from batten.io.rapid import rapid_modules, rapid_program, rapid_string, rounded_quaternions

CELL = cell_preset("two-irb6620")
DEPTH_MM = 600.0


def frames(n=31, seed=1):
    """A rod that sweeps the block: left and right (positions, tangents, normals) in the work frame."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0.0, 1.0, n)
    yaw = rng.uniform(-0.2, 0.2)
    along, normal = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    out = []
    for side in (-1.0, 1.0):
        slope = rng.uniform(-0.9, 0.9) + rng.uniform(-0.3, 0.3) * u
        tangents = np.cos(slope)[:, None] * along + np.sin(slope)[:, None] * [0.0, 0.0, 1.0]
        x, z = side * (440.0 + 50.0 * np.sin(3.0 * u + seed)), rng.uniform(250.0, 900.0) + 100.0 * np.sin(2.0 * u)
        positions = np.stack([x, (u - 0.5) * DEPTH_MM + 0.0 * x, z], axis=1)
        out.append((positions, tangents, np.tile(normal, (n, 1))))
    return tuple(out)


def plan(left, right, block=7, speed=20.0):
    n = len(left[0])
    return plan_block_motion(CELL, left, right, speed, 100.0, 110.0, block=block, rods=range(n))


@pytest.fixture(scope="module")
def given():
    return frames()


@pytest.fixture(scope="module")
def motion(given):
    return plan(*given)


@pytest.fixture(scope="module")
def files(motion):
    return rapid_modules(motion, CELL, leaves=range(101, 132), name="freeform wall")


@pytest.fixture(scope="module")
def modules(files, rapid_reader):
    return [rapid_reader.read_module(text) for text in files.values()]


@pytest.mark.parametrize("seed", range(3))
def test_every_rod_is_found_again_from_the_modules_alone(seed, rapid_reader):
    given = frames(seed=seed)
    texts = rapid_modules(plan(*given), CELL, leaves=range(31)).values()
    start, end, start_tangent, end_tangent = rapid_reader.rods(*(rapid_reader.read_module(t) for t in texts))
    for found, wanted in ((start, given[0][0]), (end, given[1][0])):
        assert np.linalg.norm(found - wanted, axis=1).max() < 0.01
    for found, wanted in ((start_tangent, given[0][1]), (end_tangent, given[1][1])):
        assert np.linalg.norm(np.cross(found, wanted), axis=1).max() < 1e-5
        assert (found * wanted).sum(axis=1).min() > 0.0


def test_planned_times_stand_in_both_modules_and_open_ones_in_neither(motion, modules, rapid_reader):
    seconds = np.linspace(0.4, 1.9, 30)
    seconds[[3, 17]] = np.nan
    texts = rapid_modules(replace(motion, planned_s=seconds), CELL, leaves=range(31)).values()
    for module, plain in zip(map(rapid_reader.read_module, texts), modules):
        moves = module.synchronous
        assert [m.seconds for m in moves[:2] + moves[-1:]] == [None] * 3, "the ways in and out keep the speed"
        found = np.array([np.nan if m.seconds is None else m.seconds for m in moves[2:-1]])
        assert found == pytest.approx(seconds, abs=5.1e-4, nan_ok=True)
        for a, b in zip(moves, plain.synchronous, strict=True):
            assert a.pose == pytest.approx(b.pose, abs=0)
            assert (a.identity, a.speed, a.zone, b.seconds) == (b.identity, b.speed, b.zone, None)


def test_both_arms_move_with_the_same_numbers_through_every_leaf(modules):
    left, right = modules
    identities = [m.identity for m in left.synchronous]
    assert identities == [m.identity for m in right.synchronous]
    assert len(identities) == len(set(identities)) == 31 + 2
    assert identities == sorted(identities)
    for module in modules:
        assert {m.wobj for m in module.synchronous} == {"block_frame"}
        assert len({m.tool for m in module.synchronous}) == 1
    assert left.leaves[0].tool != right.leaves[0].tool  # persistent data of one name would be shared by the tasks


def test_arms_meet_before_they_move_together(modules):
    left, right = modules
    sync = ["WaitSyncTask:sync1", "SyncMoveOn:sync2", "SyncMoveOff:sync3", "WaitSyncTask:sync4"]
    for module in modules:
        assert module.steps[:3] == ["ConfL", "MoveAbsJ", "MoveAbsJ"]
        assert [s for s in module.steps if s in sync] == sync
        assert module.steps[-2:] == [sync[-1], "MoveAbsJ"]
        assert module.tasks == {"all_tasks": ["T_ROB1", "T_ROB2"]}
        assert module.steps.count("MoveL") == 33
    assert "Stop" in left.steps[: left.steps.index(sync[1])], "the rod is fixed before they move together"
    assert "Stop" in left.steps[left.steps.index(sync[2]) : left.steps.index(sync[3])], "and taken out before they part"
    assert left.steps.count("Stop") == 2
    assert "Stop" not in right.steps


def test_approach_and_leave_lie_outside_the_block(modules, motion):
    for module, arm in zip(modules, (motion.left, motion.right)):
        approach, leave = module.synchronous[0], module.synchronous[-1]
        assert approach.pose[1, 3] < -0.5 * DEPTH_MM - 99.0
        assert leave.pose[1, 3] > 0.5 * DEPTH_MM + 109.0
        assert approach.zone == leave.zone == "fine"
        assert {m.zone for m in module.leaves} == {"z5"}
        np.testing.assert_allclose(approach.pose, arm.approach, rtol=0, atol=1e-3)
        np.testing.assert_allclose(leave.pose, arm.leave, rtol=0, atol=1e-3)


def test_the_way_to_the_approach_ends_at_the_approach(modules):
    for module, robot in zip(modules, (CELL.left, CELL.right)):
        assert [m.kind for m in module.alone] == ["MoveAbsJ"] * 3
        alone = module.alone[1]
        at = np.linalg.inv(CELL.work_object) @ robot.forward(np.radians(alone.joints_deg))
        np.testing.assert_allclose(at[:3, 3], module.synchronous[0].pose[:3, 3], rtol=0, atol=0.01)
        np.testing.assert_allclose(at[:3, :3], module.synchronous[0].pose[:3, :3], rtol=0, atol=1e-5)


def test_arms_come_and_go_over_postures_pulled_back(modules, motion):
    for module, arm in zip(modules, (motion.left, motion.right)):
        for alone, joints in ((module.alone[0], arm.approach_joints_rad), (module.alone[2], arm.leave_joints_rad)):
            back = np.degrees(joints) + np.array([0.0, -40.0, 20.0, 0.0, 0.0, 0.0])
            np.testing.assert_allclose(alone.joints_deg, back, rtol=0, atol=1e-5)


def test_tools_work_object_and_speeds_are_the_cells_and_the_jobs(modules):
    for module, robot in zip(modules, (CELL.left, CELL.right)):
        np.testing.assert_allclose(module.tools[module.leaves[0].tool], robot.tool, rtol=0, atol=1e-3)
        np.testing.assert_allclose(module.wobjs["block_frame"], CELL.work_object, rtol=0, atol=1e-3)
        assert {module.speeds[m.speed][0] for m in module.synchronous} == {20.0}
        assert module.speeds[module.alone[0].speed][0] == 100.0
        assert module.loads[module.leaves[0].tool][0] == CELL.tool_mass_kg


def test_configurations_are_those_of_the_motion(modules, motion):
    for module, arm, robot in zip(modules, (motion.left, motion.right), (CELL.left, CELL.right)):
        np.testing.assert_array_equal([m.configuration for m in module.leaves], arm.configuration)
        assert module.synchronous[0].configuration == tuple(robot.configuration(arm.approach_joints_rad))


def test_numbers_have_three_and_six_decimals_and_lines_can_be_read(files, modules):
    for text, module in zip(files.values(), modules):
        for move in module.synchronous:
            numbers = r"-?\d+\.\d{%d}"
            position, quaternion = (",".join([numbers % d] * c) for d, c in ((3, 3), (6, 4)))
            assert re.match(rf"MoveL \[\[{position}\],\[{quaternion}\],\[(-?\d+,){{3}}\d\],", move.text)
            assert abs(np.linalg.norm(move.quaternion) - 1.0) <= 5e-7
        assert not re.search(r"-0\.0*[\],]", text)
        assert max(map(len, text.splitlines())) <= 200


def test_comments_name_block_and_leaves(files, modules):
    assert list(files) == ["freeform_wall_B007_L.mod", "freeform_wall_B007_R.mod"]
    assert [m.name for m in modules] == ["freeform_wall_B007_L", "freeform_wall_B007_R"]
    for module in modules:
        assert [c for c in module.comments if "leaf" in c] == [f"! block 7, leaf {k}" for k in range(101, 132)]
        assert "block 7" in module.comments[0]
        assert "101 to 131" in module.comments[1]
    assert "T_ROB1" in modules[0].comments[0]
    assert "T_ROB2" in modules[1].comments[0]


@pytest.mark.parametrize(
    "name", ["Wände & Höhlen\nPROC evil()", "3x3", "", "é", "x" * 60, "a_" * 14, "WHILE", 'say "hi" \\ there']
)
def test_any_name_makes_a_valid_module(name, motion, rapid_reader):
    files = rapid_modules(motion, CELL, leaves=range(31), name=name)
    assert len(files) == 2
    for file, text in files.items():
        module = rapid_reader.read_module(text)
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,31}", module.name)
        assert file == f"{module.name}.mod"
        assert text.count("PROC main()") == 1


def test_a_tilted_cell_is_written_as_it_stands(motion, rapid_reader):
    tilted = replace(CELL, work_object=pose_from_xyz((12.3456, -7.0, 801.25), (1.0, -2.0, 33.0)))
    text = next(iter(rapid_modules(motion, tilted, leaves=range(31)).values()))
    found = rapid_reader.read_module(text).wobjs["block_frame"]
    np.testing.assert_allclose(found[:3, :3], tilted.work_object[:3, :3], rtol=0, atol=5e-6)
    np.testing.assert_allclose(found[:3, 3], tilted.work_object[:3, 3], rtol=0, atol=6e-4)


def test_a_plan_gives_two_modules_a_block(motion, given):
    class Rod:
        def __init__(self, leaf):
            self.leaf = leaf

    class Plan:
        name = "wall"
        motions = (motion, plan(*given, block=8))
        rods = tuple(Rod(k + 50) for k in range(31))

    files = rapid_program(Plan(), CELL)
    assert sorted(files) == [f"wall_B00{b}_{s}.mod" for b in (7, 8) for s in "LR"]
    assert "! block 8, leaf 80\n" in files["wall_B008_R.mod"]


def test_a_leaf_out_of_reach_is_not_written(given):
    left, right = given
    far = right[0].copy()
    far[4, 0] += 5000.0
    with pytest.raises(LimitError, match=r"block 7: the right arm cannot reach leaf 14;"):
        rapid_modules(plan(left, (far, *right[1:])), CELL, leaves=range(10, 41))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"zone": "z7"}, "zone 'z7' is not one of"),
        ({"travel_mm_s": 0.0}, "travel_mm_s"),
        ({"travel_mm_s": float("nan")}, "travel_mm_s"),
        ({"leaves": range(30)}, "30 leaf numbers for 31 rods"),
    ],
)
def test_bad_values(change, words, motion):
    with pytest.raises(InvalidInputError, match=words):
        rapid_modules(motion, CELL, **({"leaves": range(31)} | change))


def test_strings_are_escaped_and_cut(rapid_reader):
    for text in ('a "b" \\c', 'x"' * 60, "\\" * 90, "tab\tand\nline", "näh"):
        statement = rapid_reader.Statement(rapid_string(text) + ";")
        value = statement.value()
        statement.end()
        assert value == re.sub(r"[^ -~]", "?", " ".join(text.split()))[:80]


def test_rounded_quaternions_are_the_rotations_and_of_length_one():
    rng = np.random.default_rng(11)
    exact = Rotation.random(5000, rng=rng)
    special = Rotation.from_quat(np.array([[1, 1, 1, 1], [1, 0, 0, 0], [0, 0, 1, 1], [-1, 1, 1e-7, 0], [3, 3, 3, 1]]))
    exact = Rotation.concatenate([exact, special])
    q = rounded_quaternions(exact.as_matrix())
    np.testing.assert_allclose(q, np.round(q, 6), rtol=0, atol=1e-12)
    assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < 5.1e-7
    assert (Rotation.from_quat(q, scalar_first=True) * exact.inv()).magnitude().max() < 4e-6


def test_quaternions_do_not_change_sign_along_a_path():
    angles = np.linspace(0.0, 4.0 * np.pi, 100)
    path = Rotation.from_rotvec(angles[:, None] * [0.6, 0.0, 0.8])
    q = rounded_quaternions(path.as_matrix())
    assert q[0, 0] >= 0.0
    assert (q[1:] * q[:-1]).sum(axis=1).min() > 0.9


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("PERS tooldata", "VAR tooldata", "a tool is PERS"),
        ("\\ID:=30", "\\ID:=20", "twice"),
        ("\\ID:=30", "", "if and only if"),
        ("z5, grip_left", "z5, grip_middle", "undeclared"),
        ("SyncMoveOff sync3;", "", "wrong place"),
        ("cut_speed, z5", "v20, z5", "undeclared"),
        ("ENDMODULE\n", "\n", "no ENDMODULE"),
        ("ConfL \\Off;", "ConfL \\Off", "expected"),
        ("[9E9,9E9,9E9,9E9,9E9,9E9]]\\ID:=40", "[0,9E9,9E9,9E9,9E9,9E9]]\\ID:=40", "9E9"),
        ("! block 7, leaf 101", "! block 7, leaf 101" + 200 * " ", "line of"),
        ("    Stop;", "    Jump;", "unknown instruction"),
        ("MODULE freeform_wall_B007_L", "MODULE While", "not a name"),
        ("VAR syncident sync3;", "VAR syncident sync2;", "declared twice"),
    ],
)
def test_the_reader_itself_is_strict(old, new, words, files, rapid_reader):
    text = next(iter(files.values()))
    assert text.count(old) >= 1
    with pytest.raises(rapid_reader.RapidError, match=words):
        rapid_reader.read_module(text.replace(old, new, 1))


def test_the_reader_refuses_a_quaternion_that_is_not_normalised(files, rapid_reader):
    text = next(iter(files.values()))
    first = re.search(r"MoveL \[\[[^\]]*\],\[(-?\d\.\d{6})", text)
    longer = f"{float(first.group(1)) + 1e-4:.6f}"
    with pytest.raises(rapid_reader.RapidError, match="quaternion of length"):
        rapid_reader.read_module(text[: first.start(1)] + longer + text[first.end(1) :])


def test_the_head_tells_the_place_in_the_order_of_cutting(motion):
    modules = rapid_modules(motion, CELL, leaves=range(101, 132), name="freeform wall", turn=(3, 25))
    assert list(modules) == ["freeform_wall_B007_L.mod", "freeform_wall_B007_R.mod"]  # the block's number, not its turn
    for text in modules.values():
        assert "  ! In the order of cutting it is number 3 of 25.\n" in text
