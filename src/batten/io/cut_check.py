"""Read a cut back and do it again: files against their sums, tables, programs and checks against the stored numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from batten.errors import BattenError
from batten.fabrication.plan import CheckResult, CutPlan, gripper_frames
from batten.io.cut_files import MODEL, RAPID_FOLDER, RODS
from batten.io.cut_json import FILE_NAME, StoredCut, read_cut_json
from batten.io.rods_table import write_rods_csv

RELATIVE, ABSOLUTE = 1e-6, 1e-9
"""How far a recomputed check may lie from the stored one: another machine's mathematics library differs in last bits."""

POSE = 1e-6
"""How far a gripper's place (mm) and direction (rad) may lie from the end of its rod."""


@dataclass(frozen=True)
class Finding:
    """One thing that was compared.

    Attributes:
        what: what was compared, for example "rods.csv".
        agrees: whether it agrees.
        detail: what differs, or how much was compared.
    """

    what: str
    agrees: bool
    detail: str


def check_cut(folder: str | Path) -> tuple[StoredCut, tuple[Finding, ...]]:
    """Compare a folder that `batten cut` made with what its own cut.json says and with what batten computes from it.

    Parameters:
        folder: the folder.

    Returns:
        The stored cut, and the findings: files and their sums, the table of rods, the RAPID modules, the Rhino file, each
        check recomputed from the stored elastica and poses.

    Raises:
        FormatError: no cut.json in it, or one that cannot be read.
    """
    folder = Path(folder)
    stored = read_cut_json(folder / FILE_NAME)
    steps: tuple[Callable[[Path, StoredCut], Iterator[Finding]], ...] = (_files, _rods, _poses, _rapid, _model, _checks)
    findings: list[Finding] = []
    for step in steps:
        try:
            findings += step(folder, stored)
        except (BattenError, OSError) as error:
            findings.append(Finding(step.__name__.strip("_"), False, " ".join(str(error).split())))
    return stored, tuple(findings)


def _files(folder: Path, stored: StoredCut) -> Iterator[Finding]:
    good = 0
    for name, wanted in sorted(stored.files.items()):
        path = folder / name
        if not path.is_file():
            yield Finding(name, False, "is missing")
        elif hashlib.sha256(path.read_bytes()).hexdigest() != wanted:
            yield Finding(name, False, "was changed after it was written")
        else:
            good += 1
    yield Finding("files", good == len(stored.files), f"{good} of {len(stored.files)} are as they were written")


def _rods(folder: Path, stored: StoredCut) -> Iterator[Finding]:
    with TemporaryDirectory() as place:
        again = Path(place) / RODS
        write_rods_csv(again, stored.plan)
        same = again.read_bytes() == (folder / RODS).read_bytes()
    count = sum(r.status == "ok" for r in stored.plan.rods)
    yield Finding(RODS, same, f"{count} rods as stored" if same else "differs from the stored rods")


def _poses(folder: Path, stored: StoredCut) -> Iterator[Finding]:
    """The motions hold every rod that is cut, once, at its ends and along its end tangents."""
    plan = stored.plan
    moved = [index for motion in plan.motions for index in motion.rods]
    missing = {i for i, rod in enumerate(plan.rods) if rod.status == "ok"} ^ set(moved)
    frames = gripper_frames(plan.rods)
    off = [np.zeros((0, 3))]
    for motion in plan.motions:
        frame = plan.block(motion.block).work_frame(plan.blade_axis)
        for side, (arm, sense) in enumerate(((motion.left, 1.0), (motion.right, -1.0))):
            places = arm.poses[:, :3, 3] @ frame[:3, :3].T + frame[:3, 3]
            axes = arm.poses[:, :3, 2] @ frame[:3, :3].T
            rods = list(motion.rods)
            off += [places - frames.positions_mm[rods, side], axes - sense * frames.tangents[rods, side]]
    worst = float(np.abs(np.concatenate(off)).max(initial=0.0))
    if missing or len(moved) != len(set(moved)):
        leaves = sorted({plan.rods[i].leaf for i in missing})
        yield Finding("motions", False, f"do not hold each rod that is cut once; leaves {leaves}")
    yield Finding(
        "poses", worst < POSE, f"{2 * len(moved)} grippers, at most {worst:.1e} mm or rad from the rods' ends"
    )


def _rapid(folder: Path, stored: StoredCut) -> Iterator[Finding]:
    from batten.fabrication.robot.cell import cell_from_job
    from batten.io.rapid import rapid_program

    modules = rapid_program(stored.plan, cell_from_job(stored.job.cell))
    present = {p.name for p in (folder / RAPID_FOLDER).glob("*")}
    for name in sorted(present ^ set(modules)):
        yield Finding(f"{RAPID_FOLDER}/{name}", False, "belongs to no block" if name in present else "is missing")
    same = [n for n, text in modules.items() if n in present and (folder / RAPID_FOLDER / n).read_text("ascii") == text]
    for name in sorted((present & set(modules)) - set(same)):
        yield Finding(f"{RAPID_FOLDER}/{name}", False, "differs from the stored motion")
    yield Finding("robot program", len(same) == len(modules), f"{len(same)} of {len(modules)} modules as stored")


def _model(folder: Path, stored: StoredCut) -> Iterator[Finding]:
    import rhino3dm

    model: Any = rhino3dm.File3dm.Read(str(folder / MODEL))
    if model is None:
        yield Finding(MODEL, False, "cannot be read as a Rhino file")
        return
    valid = [bool(item.Geometry.IsValid) for item in model.Objects]
    yield Finding(MODEL, all(valid), f"{len(valid)} objects, {valid.count(False) or 'none'} of them invalid")


def _checks(folder: Path, stored: StoredCut) -> Iterator[Finding]:
    from batten.fabrication.cut import check_again
    from batten.io.job_surface import read_job_surface

    surface = read_job_surface(stored.job.surface)
    again = check_again(stored.plan, stored.job, surface)
    yield from compare_checks(stored.plan, again)
    cut_but_beyond = {
        rod.leaf
        for check in again
        if check.hard
        for rod, good in zip(stored.plan.rods, check.passed)
        if rod.status == "ok" and not good
    }
    if cut_but_beyond:
        yield Finding("limits", False, f"leaves that are cut break a hard limit: {sorted(cut_but_beyond)}")


def compare_checks(plan: CutPlan, again: tuple[CheckResult, ...]) -> Iterator[Finding]:
    """Each stored check against the one of the same name that was computed again."""
    new = {check.name: check for check in again}
    refused = np.array([rod.status == "refused" for rod in plan.rods], dtype=np.bool_)
    for check in plan.checks:
        other = new.pop(check.name, None)
        if other is None:
            yield Finding(check.title, False, "is no longer computed")
        elif (other.limit, other.sense, other.hard, other.values.shape) != (
            check.limit, check.sense, check.hard, check.values.shape,
        ):  # fmt: skip
            yield Finding(check.title, False, f"has another limit now: {other.limit:g} instead of {check.limit:g}")
        else:
            close = np.isclose(other.values, check.values, rtol=RELATIVE, atol=ABSOLUTE, equal_nan=True)
            # The robots do not move for refused leaves: what made them refuse cannot be computed again.
            gone = refused & np.isnan(other.values) & ~np.isnan(check.values)
            off = np.flatnonzero(~close & ~gone)
            detail = f"{len(close) - gone.sum()} rods as stored" + (f", {gone.sum()} refused" if gone.any() else "")
            if len(off):
                rod, i = plan.rods[off[0]], off[0]
                detail = (
                    f"differs at {len(off)} rods, first at leaf {rod.leaf} in block {rod.block}: "
                    f"{check.values[i]:.9g} stored, {other.values[i]:.9g} computed"
                )
            yield Finding(check.title, not len(off), detail)
    for check in new.values():
        yield Finding(check.title, False, "is computed now and was not stored")
