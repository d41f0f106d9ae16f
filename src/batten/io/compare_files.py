"""A scan compared with its cut: lines for the terminal, compare.json, and a page with the map and the histogram.

DIR/report.html     for people: verdict, figures, map, histogram, blocks
DIR/compare.json    the numbers: pose, percentiles, blocks
DIR/distances.png   the map: signed distance by plan position
"""

from __future__ import annotations

import base64
import html
import json
import math
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from batten.errors import InvalidInputError
from batten.fabrication.scan_comparison import PERCENTILES, BlockDistances, ScanComparison
from batten.io.report_tables import amount, table
from batten.io.software import software_name
from batten.io.whole_or_nothing import written_whole

FORMAT, SCHEMA = "batten comparison", 1
REPORT, NUMBERS, MAP = "report.html", "compare.json", "distances.png"

AMBIGUOUS = 1.25
"""A rival pose whose misfit is less than this multiple of the taken one's is told."""


def comparison_record(comparison: ScanComparison, *, cut: str, scan: str) -> dict[str, Any]:
    """The numbers of a comparison as plain JSON values: None for what does not exist.

    Parameters:
        comparison: the comparison.
        cut: name of the cut.
        scan: name of the scan's file.
    """
    found, distances = comparison.registration, comparison.distances
    return {
        "format": FORMAT,
        "schema": SCHEMA,
        "software": software_name(),
        "cut": cut,
        "scan": scan,
        "good": comparison.is_good,
        "failing_blocks": list(comparison.failing),
        "tolerance_mm": comparison.tolerance_mm,
        "share_wanted": comparison.share,
        "reach_mm": comparison.reach_mm,
        "pose": found.pose.tolist(),
        "noise_mm": _number(found.noise_mm),
        "pose_error_mm": _number(found.pose_error_mm),
        "rival": _number(found.rival),
        "points": len(distances.signed_mm),
        "far": distances.far,
        "beyond_the_border": distances.beyond,
        "not_finite": distances.not_finite,
        "whole": _block_record(comparison.whole),
        "blocks": [_block_record(b) for b in comparison.blocks],
    }


def comparison_lines(comparison: ScanComparison, *, cut: str) -> list[str]:
    """The comparison for the terminal: a verdict, what was found, and a line for each block."""
    whole, distances = comparison.whole, comparison.distances
    lines = [f"{cut}: {verdict(comparison)}"]
    lines += [f"  {text}" for text in remarks(comparison)]
    lines.append(
        f"  {len(distances.signed_mm)} points: {whole.points} measured, {distances.far} farther than "
        f"{comparison.reach_mm:g} mm, {distances.beyond} beyond the border, {distances.not_finite} no points"
    )
    lines.append("  block   points  covered     mean      50 %      95 %   greatest  within   (mm)")
    for block in (whole, *comparison.blocks):
        name = "all" if block.block == 0 else str(block.block)
        values = (block.mean_mm, block.percentiles_mm[0], block.percentiles_mm[2], block.percentiles_mm[4])
        figures = "".join(f"{value:>10.3f}" for value in values)
        mark = "  FAIL" if block.block in comparison.failing else ""
        lines.append(f"  {name:>5} {block.points:>8} {block.covered:>7.1%}{figures}{block.within:>8.1%}{mark}")
    return lines


def verdict(comparison: ScanComparison) -> str:
    """Whether the part keeps the tolerance, in one sentence."""
    wanted = f"{comparison.share:.0%} of the points within {comparison.tolerance_mm:g} mm"
    if not comparison.whole.points:
        return f"nothing was measured: no point of the scan lies within {comparison.reach_mm:g} mm of the design"
    if comparison.failing:
        many = len(comparison.failing) > 1
        which = ", ".join(map(str, comparison.failing))
        return f"block{'s' if many else ''} {which} {'do' if many else 'does'} not have {wanted}"
    return f"every scanned block has {wanted}"


def remarks(comparison: ScanComparison) -> list[str]:
    """What a reader must know before trusting the numbers."""
    found, texts = comparison.registration, []
    if found.rival < AMBIGUOUS:
        texts.append(
            f"The scan also fits in another pose (misfit {found.rival:.2f} times this one's): the least turn was taken. "
            "Say which block it is, or bring the scan close by hand and register near."
        )
    if math.isnan(found.pose_error_mm):
        texts.append("The scan was measured where it lay, without registration.")
    elif math.isinf(found.pose_error_mm):
        texts.append("The surface leaves a direction free: the scan can slide along it.")
    elif found.pose_error_mm > 0.1 * comparison.tolerance_mm:
        texts.append(f"The pose is known to {amount(found.pose_error_mm)} mm only: the scan is small, or nearly flat.")
    return texts


def write_comparison(comparison: ScanComparison, out: str | Path, *, cut: str, scan: str) -> None:
    """Write the page, the picture and the numbers into a folder, whole or not at all.

    Parameters:
        comparison: the comparison.
        out: the folder. An earlier one is replaced if it holds a comparison and nothing else.
        cut: name of the cut.
        scan: name of the scan's file.

    Raises:
        InvalidInputError: `out` exists and is no comparison, or nothing was measured.
        OSError: the drive is full or not writable. In all these cases nothing is left behind.
    """
    from batten.io.compare_pictures import distance_histogram, distance_map, picture_bytes

    if not comparison.whole.points:
        raise InvalidInputError(
            f"{verdict(comparison)}; there is nothing to draw: try a greater reach, or register first"
        )
    with written_whole(out, _files_of_comparison) as folder:
        drawn = picture_bytes(distance_map(comparison)), picture_bytes(distance_histogram(comparison))
        (folder / MAP).write_bytes(drawn[0])
        record = comparison_record(comparison, cut=cut, scan=scan)
        text = json.dumps(record, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
        (folder / NUMBERS).write_text(text, encoding="utf-8", newline="\n")
        page = comparison_html(comparison, drawn, cut=cut, scan=scan)
        (folder / REPORT).write_text(page, encoding="utf-8", newline="\n")


def comparison_html(comparison: ScanComparison, pictures: tuple[bytes, bytes], *, cut: str, scan: str) -> str:
    """The page's text: well-formed XML after its first line; the pictures, PNG, are in it."""
    style = resources.files("batten.io").joinpath("report.css").read_text(encoding="utf-8")
    title, good = html.escape(cut), comparison.is_good
    sentence = verdict(comparison)
    body = [
        f'<header><div><p class="kind">Comparison with a scan</p><h1>{title}</h1></div>'
        f'<p class="meta">{html.escape(software_name())}<br />scan: {html.escape(scan)}</p></header>',
        f'<section class="verdict {"good" if good else "bad"}">'
        f"<strong>{'✓ Within' if good else '✗ Beyond'} tolerance</strong>"
        f"<p>{html.escape(sentence[0].upper() + sentence[1:])}.</p></section>",
        *(f"<p>{html.escape(text)}</p>" for text in remarks(comparison)),
        _figures(comparison),
    ]
    sections = (
        (
            "Where",
            "Median of the signed distances by plan position, x to the right and y up, numbers those of the blocks; no "
            "point, no colour.",
            0,
        ),
        ("How much", "Signed distances of all points that count.", 1),
    )
    for heading, about, i in sections:
        address = "data:image/png;base64," + base64.b64encode(pictures[i]).decode("ascii")
        body.append(
            f'<section class="picture"><h2>{heading}</h2><p>{about}</p>'
            f'<figure class="wide"><img alt="{heading}" src="{address}" /></figure></section>'
        )
    body += [_blocks(comparison), _pose(comparison)]
    return (
        f'<!DOCTYPE html>\n<html lang="en" xmlns="http://www.w3.org/1999/xhtml">\n<head>\n<meta charset="utf-8" />\n'
        f'<meta name="viewport" content="width=device-width" />\n<title>{title} – comparison with a scan</title>\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n" + "\n".join(body) + "\n</body>\n</html>\n"
    )


def _figures(comparison: ScanComparison) -> str:
    whole, distances = comparison.whole, comparison.distances
    entries = [
        ("points measured", str(whole.points), f"of {len(distances.signed_mm)}"),
        ("design covered", f"{whole.covered:.1%}", ""),
        ("mean, signed", amount(whole.mean_mm), "mm"),
        ("within tolerance", f"{whole.within:.1%}", f"of {comparison.tolerance_mm:g} mm"),
        *((_percent(p), amount(float(v)), "mm") for p, v in zip(PERCENTILES[:3], whole.percentiles_mm)),
        ("too little … too much", f"{amount(whole.lowest_mm)} … {amount(whole.highest_mm)}", "mm"),
        (f"farther than {comparison.reach_mm:g} mm", str(distances.far), "points, not counted"),
        ("beyond the border", str(distances.beyond), "points, not counted"),
        ("no points", str(distances.not_finite), "not counted"),
        ("pose known to", amount(comparison.registration.pose_error_mm), "mm"),
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value} <small>{unit}</small></dd></div>" for name, value, unit in entries
    )
    return f'<dl class="figures">{cells}</dl>'


def _blocks(comparison: ScanComparison) -> str:
    head = ["block", "", "points", "covered", "mean", *map(_percent, PERCENTILES), "within"]
    rows: list[Sequence[str]] = []
    for block in (comparison.whole, *comparison.blocks):
        fails = block.block in comparison.failing
        mark = '<span class="mark bad">✗ fail</span>' if fails else '<span class="mark">✓ pass</span>'
        rows.append(
            [
                str(block.block) if block.block else "all",
                mark if block.block else "",
                str(block.points),
                f"{block.covered:.1%}",
                *(amount(float(v)) for v in (block.mean_mm, *block.percentiles_mm)),
                f"{block.within:.1%}",
            ]
        )
    about = (
        "mm; the mean has its sign (positive: too much foam), percentiles are of the distance without sign. Covered: "
        "cells of the plan with a point of the scan; a fault deeper than the reach shows as a hole."
    )
    return f"<section><h2>Blocks</h2><p>{about}</p>{table(head, rows, numbers=tuple(range(2, len(head))))}</section>"


def _pose(comparison: ScanComparison) -> str:
    rows = [[f"{value:.9f}" for value in row] for row in comparison.registration.pose.tolist()[:3]]
    body = table(("x", "y", "z", "shift, mm"), rows, numbers=(0, 1, 2, 3))
    about = "Takes points of the scan, in mm, to the wall frame."
    return f"<section><h2>The scan's pose</h2><p>{about}</p>{body}</section>"


def _percent(percentile: float) -> str:
    return "greatest" if percentile == 100.0 else f"{percentile:g} %"


def _block_record(block: BlockDistances) -> dict[str, Any]:
    return {
        "block": block.block,
        "points": block.points,
        "mean_mm": _number(block.mean_mm),
        "lowest_mm": _number(block.lowest_mm),
        "highest_mm": _number(block.highest_mm),
        "percentiles_mm": {f"{p:g}": _number(float(v)) for p, v in zip(PERCENTILES, block.percentiles_mm)},
        "within": _number(block.within),
        "covered": _number(block.covered),
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _files_of_comparison(folder: Path) -> frozenset[str] | None:
    try:
        data = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    ours = isinstance(data, dict) and data.get("format") == FORMAT
    return frozenset((REPORT, NUMBERS, MAP)) if ours else None
