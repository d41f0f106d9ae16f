"""The command `batten compare`: the scan of a cut part against the design."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from batten.errors import InvalidInputError

# Whatever is needed for the work itself is imported in `compare`: `batten --help` answers at once.


def compare(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A folder that `batten cut` made.")],
    scan: Annotated[Path, typer.Argument(metavar="SCAN", help="The scan: .ply, .stl or .xyz.")],
    folder: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="Folder for report.html, compare.json and the map."),
    ] = None,
    units: Annotated[Literal["mm", "cm", "m", "inch"], typer.Option(help="The scan's unit.")] = "mm",
    block: Annotated[
        int | None,
        typer.Option(metavar="N", help="The scan shows this block alone: faster, and it fits in fewer ways."),
    ] = None,
    register: Annotated[
        Literal["search", "near", "none"],
        typer.Option(help="Search the scan's place, start from where it is, or leave it there."),
    ] = "search",
    tolerance: Annotated[
        float | None, typer.Option(metavar="MM", help="Allowed distance from the design; without it, that of the job.")
    ] = None,
    share: Annotated[
        float, typer.Option(metavar="S", help="Share of each block's points that must be within it, in (0, 1].")
    ] = 0.95,
    reach: Annotated[float, typer.Option(metavar="MM", help="Points farther from the design do not count.")] = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the numbers as JSON on stdout.")] = False,
) -> None:
    """Lay a scan of the cut part on the design and measure how far they lie apart: percentiles, blocks, a coloured map.

    Exit status: 0 every scanned block keeps the tolerance; 1 one does not, or the scan fits nowhere; 2 bad input.
    """
    import numpy as np

    from batten.fabrication.scan import Registration, ScanDesign, register_scan
    from batten.fabrication.scan_comparison import compare_scan
    from batten.io.compare_files import comparison_lines, comparison_record, write_comparison
    from batten.io.cut_json import FILE_NAME, read_cut_json
    from batten.io.job_surface import read_job_surface
    from batten.io.scan_reading import read_scan

    stored = read_cut_json(out / FILE_NAME)
    blocks = [b for b in stored.plan.blocks if block in (None, b.number)]
    if not blocks:
        raise InvalidInputError(f"--block {block}: the cut has blocks 1 to {len(stored.plan.blocks)}")
    window = None
    if block is not None:
        (x0, y0), (x1, y1) = blocks[0].corner_mm[:2], blocks[0].corner_mm[:2] + blocks[0].size_mm[:2]
        window = ((float(x0), float(y0)), (float(x1), float(y1)))
    limit = stored.job.leaves.tolerance_mm if tolerance is None else tolerance
    if not (0.0 < limit < float("inf") and 0.0 < share <= 1.0 and 0.0 < reach < float("inf")):
        raise InvalidInputError(
            f"--tolerance {limit:g}, --share {share:g}, --reach {reach:g}: allowed are above 0, in (0, 1], above 0"
        )
    design = ScanDesign(read_job_surface(stored.job.surface), window)
    points = read_scan(scan, units=units)
    if register == "none":
        nothing = float("nan")
        found = Registration(np.eye(4), nothing, nothing, nothing, nothing)
    else:
        found = register_scan(design, points, start=np.eye(4) if register == "near" else None)
    comparison = compare_scan(design, blocks, points, found, tolerance_mm=limit, reach_mm=reach, share=share)
    names = {"cut": stored.plan.name, "scan": scan.name}
    if folder is not None:
        write_comparison(comparison, folder, **names)
    if as_json:
        record = comparison_record(comparison, **names)
        typer.echo(json.dumps(record, ensure_ascii=False, indent=2, allow_nan=False))
    else:
        written = [f"report: {folder / 'report.html'}"] if folder is not None else []
        typer.echo("\n".join([*comparison_lines(comparison, cut=stored.plan.name), *written]))
    raise typer.Exit(0 if comparison.is_good else 1)
