"""A cut simulated from its robot modules: run, told in lines, and written beside the cut, whole or not at all.

OUT/simulation/simulation.html   for people: verdict, figures, map, histogram, blocks
OUT/simulation/simulation.json   the numbers
OUT/simulation/deviation.png     the map
OUT/simulation/swept.ply         the face as a mesh in the wall frame, mm, coloured by its distance from the design
OUT/report.html                  gets the main figures; OUT/cut.json the sums of these files
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from batten.errors import InvalidInputError
from batten.fabrication.swept_surface import PERCENTILES, Distances, HalfKerf, Simulation, SweptBlock, simulate_cut
from batten.io.cut_files import RAPID_FOLDER, REPORT, file_sums
from batten.io.cut_json import FILE_NAME, StoredCut, read_cut_json, write_cut_json
from batten.io.simulation_page import simulation_page, verdict, with_simulation
from batten.io.software import software_name
from batten.io.whole_or_nothing import written_whole

FORMAT, SCHEMA = "batten simulation", 1
FOLDER, PAGE, NUMBERS, MAP, MESH = "simulation", "simulation.html", "simulation.json", "deviation.png", "swept.ply"
ALLOWANCE_MM = 0.05
"""How much farther than the job's tolerance the face may lie from the design, if nothing else is said."""


def simulate_folder(out: str | Path, *, allowance_mm: float = ALLOWANCE_MM) -> tuple[StoredCut, Simulation]:
    """Simulate a cut from its robot modules alone.

    From cut.json come what the robots do not know: the blocks, the rod's length, the cell, the design and the kerf.

    Parameters:
        out: a folder that `batten cut` made.
        allowance_mm: see `Simulation`.

    Returns:
        The cut as stored, and the simulation.

    Raises:
        FormatError: no cut.json, or one that cannot be read; modules that cannot be read (file and line).
        InvalidInputError: an allowance that is negative, no design, a module of a block that is not there.
        LimitError: the rod cannot be held somewhere (block and leaf).
    """
    from batten.fabrication.robot.cell import cell_from_job
    from batten.io.job_surface import read_job_surface
    from batten.io.simulation_paths import read_rod_paths

    folder = Path(out)
    stored = read_cut_json(folder / FILE_NAME)
    plan, job = stored.plan, stored.job
    simulation = simulate_cut(
        read_rod_paths(folder / RAPID_FOLDER, cell_from_job(job.cell)),
        plan.blocks,
        plan.blade_axis,
        read_job_surface(job.surface),
        job.rod.length_mm,
        tolerance_mm=job.leaves.tolerance_mm,
        allowance_mm=allowance_mm,
        half_kerf_mm=_half_kerf(stored),
        kept=job.kerf.side,
    )
    return stored, simulation


def _half_kerf(stored: StoredCut) -> HalfKerf | None:
    """Half the kerf by local speed, where the job has the blade run beside the design; None where it follows the design."""
    from batten.fabrication.kerf import kerf_width_mm

    job = stored.job
    return (lambda speed: 0.5 * kerf_width_mm(job, speed)) if job.kerf.offset else None


def simulation_record(simulation: Simulation, *, cut: str) -> dict[str, Any]:
    """The numbers of a simulation as plain JSON values: None for what does not exist.

    Parameters:
        simulation: the simulation.
        cut: name of the cut.
    """
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "software": software_name(),
        "cut": cut,
        "good": simulation.is_good,
        "failing_blocks": list(simulation.failing),
        "blocks_without_program": list(simulation.without_program),
        "tolerance_mm": simulation.tolerance_mm,
        "allowance_mm": simulation.allowance_mm,
        "half_kerf": simulation.half_kerf,
        "face": _distances(simulation.face),
        "at_leaves": _distances(simulation.at_leaves),
        "between_leaves": _distances(simulation.between_leaves),
        "design": _distances(simulation.design),
        "blocks": [_block(b) for b in simulation.blocks],
    }


def _block(block: SweptBlock) -> dict[str, Any]:
    sweep = block.sweep
    worst, place, where = block.worst
    return {
        "block": block.block.number,
        "face": _distances(block.face),
        "at_leaves": _distances(block.at_leaves),
        "between_leaves": _distances(block.between_leaves),
        "design": _distances(block.design),
        "worst": {"distance_mm": _number(worst), "point_mm": [_number(float(v)) for v in place], "where": where},
        "points_without_kerf": block.unknown,
        "stations": len(sweep.move),
        "shapes_at_first_target": sweep.choices,
        "least_stability_margin": _number(float(sweep.margin.min())),
        "out_of_plane_deg": float(np.degrees(sweep.out_of_plane_rad.max())),
        "out_of_plane_mm": float(sweep.out_of_plane_mm.max()),
        "twist_deg": float(np.degrees(np.ptp(sweep.twist_rad))),
    }


def _distances(d: Distances) -> dict[str, Any]:
    shares = {f"{p:g}": _number(v) for p, v in zip(PERCENTILES, d.percentiles)}
    return {"points": d.points, "max_mm": _number(d.max), "mean_mm": _number(d.mean), "percentiles_mm": shares}


def _number(value: float) -> float | str | None:
    return value if math.isfinite(value) else None if math.isnan(value) else "Infinity"


def simulation_lines(simulation: Simulation, *, cut: str) -> list[str]:
    """The simulation for the terminal: a verdict, and a line for each block."""
    lines = [f"{cut}: {verdict(simulation)}"]
    lines += ["  block     mean      50 %      95 %      99 %  greatest  at leaves  design   (mm)"]
    rows = [("all", simulation.face, simulation.at_leaves, simulation.design, False)]
    rows += [
        (str(b.block.number), b.face, b.at_leaves, b.design, b.block.number in simulation.failing)
        for b in simulation.blocks
    ]
    for name, face, at_leaves, design, fails in rows:
        values = (*face.percentiles, face.max, at_leaves.max, design.max)
        figures = "".join(f"{value:>10.3f}" for value in values)
        lines.append(f"  {name:>5}{face.mean:>9.3f}{figures}{'  FAIL' if fails else ''}")
    return lines


def write_simulation(simulation: Simulation, stored: StoredCut, out: str | Path) -> None:
    """Write a simulation into the folder of its cut, whole or not at all.

    The folder is made anew beside the old one, with everything that lay in it, and takes its place: report.html with the
    simulation's figures, cut.json with the sums of what is new. Sums of files that were changed after the cut stay as they
    were, so that `batten check` still tells; a report that was changed is left alone.

    Parameters:
        simulation: the simulation.
        stored: the cut as it was read from the folder.
        out: the folder that `batten cut` made.

    Raises:
        InvalidInputError: no block has a robot program.
        OSError: the drive is full or not writable. Then the folder is as it was.
    """
    from batten.io.compare_pictures import picture_bytes
    from batten.io.ply import write_ply_mesh
    from batten.io.simulation_pictures import deviation_colours, deviation_histogram, deviation_map

    if not simulation.blocks:
        raise InvalidInputError(f"{out}: no block has a robot program; there is nothing to simulate")
    out, name = Path(out), stored.plan.name
    with written_whole(out, _all_files) as new:
        shutil.copytree(out, new, dirs_exist_ok=True, symlinks=True)
        place = new / FOLDER
        place.mkdir(exist_ok=True)
        drawn = picture_bytes(deviation_map(simulation)), picture_bytes(deviation_histogram(simulation))
        (place / MAP).write_bytes(drawn[0])
        text = json.dumps(simulation_record(simulation, cut=name), ensure_ascii=False, indent=1, allow_nan=False)
        (place / NUMBERS).write_text(text + "\n", encoding="utf-8", newline="\n")
        (place / PAGE).write_text(simulation_page(simulation, drawn, cut=name), encoding="utf-8", newline="\n")
        points, signed, triangles = _joined(simulation)
        write_ply_mesh(
            place / MESH,
            points,
            triangles,
            deviation_colours(signed, simulation.limit_mm),
            signed,
            comment=f"{name}: simulated face, mm; quality is the signed distance from the design",
        )
        sums = file_sums(new)
        fresh = {f"{FOLDER}/{file}": sums[f"{FOLDER}/{file}"] for file in (PAGE, NUMBERS, MAP, MESH)}
        files = dict(sorted((stored.files | fresh).items()))
        report = new / REPORT
        if sums.get(REPORT) == stored.files.get(REPORT) and report.is_file():
            listed = {file: total for file, total in files.items() if file != REPORT}
            page = with_simulation(report.read_text(encoding="utf-8"), simulation, drawn[0], listed)
            report.write_text(page, encoding="utf-8", newline="\n")
            files[REPORT] = hashlib.sha256(report.read_bytes()).hexdigest()
        write_cut_json(new / FILE_NAME, stored.plan, stored.job, files)


def _joined(simulation: Simulation) -> tuple[Any, Any, Any]:
    """The meshes of all blocks as one."""
    meshes = [b.mesh for b in simulation.blocks]
    first = np.concatenate([[0], np.cumsum([len(m.points) for m in meshes])])
    return (
        np.concatenate([m.points for m in meshes]),
        np.concatenate([m.signed for m in meshes]),
        np.concatenate([m.triangles + start for m, start in zip(meshes, first)]),
    )


def _all_files(folder: Path) -> frozenset[str]:
    """Whatever lies in the folder: all of it is taken along."""
    return frozenset(p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir() or p.is_symlink())
