"""A made-up cut: a wavy wall, every piece an elastica near it, with all that a plan holds. No robot, no CAD file."""

import math

import numpy as np

from batten.curves.elastica import Elastica
from batten.fabrication.job import BlocksJob, CutJob, LeavesJob, SurfaceJob
from batten.fabrication.plan import ArmMotion, Block, BlockMotion, CheckResult, CutPlan, RodPlacement
from batten.surfaces.plane import Plane

SIZE = 600.0


def height(x, y):
    return 330.0 + 160.0 * np.sin(x / 560.0 + 0.4) * np.cos(y / 700.0) + 90.0 * np.cos(x / 333.0 - y / 450.0)


def piece_near(x0, y, wobble):
    """An elastica over one block that starts on the wall with its slope and its curvatures at both ends."""
    h = 1.0
    slope = (height(x0 + h, y) - height(x0 - h, y)) / (2.0 * h)
    end = x0 + SIZE

    def bend(x):
        return (height(x + h, y) - 2.0 * height(x, y) + height(x - h, y)) / h**2

    angle = math.atan(slope)
    bend0, bend1 = bend(x0) * math.cos(angle) ** 3, bend(end) * math.cos(angle) ** 3
    draft = Elastica((x0, height(x0, y)), angle, bend0, (0.0, (bend1 - bend0) / SIZE), 2.0 * SIZE)
    s = np.linspace(0.0, 2.0 * SIZE, 4001)
    length = float(np.interp(end, draft.point_at(s)[:, 0], s))
    piece = Elastica(draft.start, draft.start_angle, draft.start_curvature, draft.force, length)
    t = np.linspace(0.0, 1.0, 41)
    design = piece.point_at(t * length)
    design[:, 1] += wobble * np.sin(math.pi * t) ** 2 * np.cos(5.0 * t + y / 100.0)
    return piece, design


def build_plan(rows=2, columns=2, leaves=4, refused=(), blade_axis="x", name="made-up wall", job=None):
    job = job or CutJob(SurfaceJob(), name=name, blocks=BlocksJob((SIZE, SIZE)), leaves=LeavesJob(SIZE / leaves))
    rng = np.random.default_rng(7)
    blocks, rods = [], []
    for row in range(rows):
        for column in range(columns):
            across, along = (row, column) if blade_axis == "x" else (-1 - row, column)
            corner = (along * SIZE, across * SIZE, 0.0) if blade_axis == "x" else (across * SIZE, along * SIZE, 0.0)
            blocks.append(
                Block(row * columns + column + 1, row, column, np.array(corner), np.array([SIZE, SIZE, 640.0]))
            )
        for i in range(leaves):
            leaf = row * leaves + i + 1
            y = (row + (i + 0.5) / leaves) * SIZE
            for column in range(columns):
                piece, design = piece_near(column * SIZE, y, 0.3 * rng.uniform(0.1, 1.0))
                if blade_axis == "x":
                    plane = Plane((0.0, y, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
                else:
                    plane = Plane((-y, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
                before = after = 0.5 * (1000.0 - piece.length)
                bad = leaf in refused
                rods.append(
                    RodPlacement(
                        block=row * columns + column + 1,
                        leaf=leaf,
                        plane=plane,
                        design=design,
                        piece=piece,
                        rod=piece.extended(before, after),
                        before_mm=before,
                        repair=("refitted with free ends within the tolerance",) if leaf % 9 == 4 else (),
                        status="refused" if bad else "ok",
                        reasons=("strain 0.0093 is above 0.008",) if bad and column == 0 else (),
                    )
                )
    return make_whole(name, blade_axis, blocks, rods, refused, rng), job


def make_whole(name, blade_axis, blocks, rods, refused, rng):
    s = np.linspace(0.0, 1.0, 33)
    strain = np.array([1.5 * np.abs(r.rod.curvature_at(s * r.rod.length)).max() for r in rods])
    n = len(rods)
    bad = np.array([r.leaf in refused for r in rods])
    one_piece = np.where([r.block == 1 for r in rods], np.nan, 1e-6 * rng.uniform(size=n))
    checks = (
        CheckResult("strain", "Strain on the whole rod", "", 0.008, "max", np.where(bad, 0.0093, strain)),
        CheckResult("deviation", "Greatest deviation from the surface", "mm", 0.5, "max", 0.4 * rng.uniform(size=n)),
        CheckResult("jump", "Jump of position at block borders", "mm", 0.01, "max", one_piece),
        CheckResult("grippers", "Free distance of the grippers", "mm", 20.0, "min", rng.uniform(40.0, 120.0, n)),
        CheckResult(
            "speed", "Speed ratio along the rod", "", 3.0, "max", rng.uniform(1.0, 3.2, n), "Soft.", hard=False
        ),
    )
    motions = tuple(make_motion(b.number, b.work_frame(blade_axis), rods, rng) for b in blocks)
    facts = {"wall_width_mm": 1200.0, "rods": n, "leaves": len({r.leaf for r in rods}), "made_by": "a test"}
    return CutPlan(
        name, blade_axis, "u: 5 leaves are nearly straight, v: 17", tuple(blocks), tuple(rods), checks, motions, facts
    )


def make_motion(block, frame, rods, rng):
    chosen = tuple(i for i, r in enumerate(rods) if r.block == block and r.status == "ok")
    inverse = np.linalg.inv(frame)
    arms = []
    for side in (0, 1):
        poses = np.tile(np.eye(4), (len(chosen), 1, 1))
        for pose, i in zip(poses, chosen):
            gripper = rods[i].grippers()[side]
            z = gripper.tangent if side == 0 else -gripper.tangent  # out of the gripper, into the rod
            world = np.eye(4)
            world[:3, :3] = np.stack([gripper.normal, np.cross(z, gripper.normal), z], axis=1)
            world[:3, 3] = gripper.position_mm
            pose[:] = inverse @ world
        n = len(chosen)
        margins = rng.uniform(0.1, 1.0, n)
        margins[:1] = np.nan
        edge = np.eye(4)
        arms.append(
            ArmMotion(
                poses, rng.uniform(-1.0, 1.0, (n, 6)), rng.uniform(-1.0, 1.0, n), rng.uniform(10.0, 300.0, n), margins,
                rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n), edge, edge.copy(), rng.uniform(size=6),
                rng.uniform(size=6), rng.integers(-1, 2, (n, 4)),
            )
        )  # fmt: skip
    return BlockMotion(block, chosen, arms[0], arms[1], 20.0)
