"""The page of `batten rationalise`: verdict, pictures, what each patch needs, how patches meet, what a wire would need."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Mapping, Sequence
from importlib import resources

from batten.fabrication.patch_pieces import PERCENTILES
from batten.fabrication.rationalisation import Rationalisation
from batten.fabrication.rationalise_job import RationaliseJob
from batten.io.rationalise_files import JOBS, MAPS, VIEW, verdict
from batten.io.rationalise_jobs import JOB, CutFolder
from batten.io.report_tables import amount, table
from batten.io.software import software_name

_PICTURES = (
    (VIEW, "The patches", "As planned, coloured by their distance from the faces; dark lines are borders of blocks."),
    (
        MAPS,
        "Where the cut lies off",
        "Distance of the cut from the face in each patch's plan, the blade from left to right, numbers those of the blocks; "
        "below 0 the cut lies below the face.",
    ),
)


def rationalise_html(
    rationalisation: Rationalisation, job: RationaliseJob, jobs: Sequence[CutFolder], pictures: Mapping[str, bytes]
) -> str:
    """The page's text: well-formed XML after its first line; the pictures, PNG, are in it.

    Parameters:
        rationalisation: what was planned. job: from what. jobs: that were written. pictures: bytes by their names.
    """
    style = resources.files("batten.io").joinpath("report.css").read_text(encoding="utf-8")
    title, good = html.escape(rationalisation.name), rationalisation.is_good
    sentence = html.escape(verdict(rationalisation, job))
    body = [
        f'<header><div><p class="kind">A design in pieces of elastica</p><h1>{title}</h1></div>'
        f'<p class="meta">{html.escape(software_name())}<br />{html.escape(job.faces.file.name)}</p></header>',
        f'<section class="verdict {"good" if good else "bad"}">'
        f"<strong>{'✓ Can be made' if good else '✗ Not as asked'}</strong>"
        f"<p>{sentence[0].upper() + sentence[1:]}.</p></section>",
        _figures(rationalisation, job),
        _problems(rationalisation),
    ]
    for name, heading, about in _PICTURES:
        if name in pictures:
            address = "data:image/png;base64," + base64.b64encode(pictures[name]).decode("ascii")
            body.append(
                f'<section class="picture"><h2>{heading}</h2><p>{about}</p>'
                f'<figure class="wide"><img alt="{heading}" src="{address}" /></figure></section>'
            )
    body += [_patches(rationalisation), _wires(rationalisation), _seams(rationalisation), _jobs(jobs)]
    return (
        f'<!DOCTYPE html>\n<html lang="en" xmlns="http://www.w3.org/1999/xhtml">\n<head>\n<meta charset="utf-8" />\n'
        f'<meta name="viewport" content="width=device-width" />\n<title>{title} – in pieces of elastica</title>\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def _figures(rationalisation: Rationalisation, job: RationaliseJob) -> str:
    plans = rationalisation.patches
    points = sum(len(p.deviation.signed_mm) for p in plans)
    mean = sum(p.deviation.mean_mm * len(p.deviation.signed_mm) for p in plans) / max(points, 1)
    entries = [
        ("blocks", str(rationalisation.blocks), f"in {len(plans)} patch{'es' if len(plans) != 1 else ''}"),
        ("blocks for a straight wire", str(rationalisation.wire_blocks), ""),
        ("greatest distance", amount(rationalisation.greatest_mm), f"of {job.leaves.tolerance_mm:g} mm"),
        ("mean distance", amount(mean), "mm"),
        ("pieces of elastica", str(sum(p.pieces for p in plans)), ""),
        ("greatest jump within a leaf", amount(max(p.jump_mm for p in plans)), "mm"),
        ("greatest turn there", amount(max(math.degrees(p.jump_rad) for p in plans)), "°"),
        ("greatest strain", f"{max(p.strain for p in plans):.2%}", f"of {job.rod.max_strain:.2%}"),
    ]
    cells = "".join(f"<div><dt>{n}</dt><dd>{v} <small>{u}</small></dd></div>" for n, v, u in entries)
    return f'<dl class="figures">{cells}</dl>'


def _problems(rationalisation: Rationalisation) -> str:
    rows = [[str(p.number), html.escape(text)] for p in rationalisation.patches for text in p.problems]
    if not rows:
        return ""
    return f"<section><h2>What keeps it from being made</h2>{table(['patch', ''], rows, numbers=(0,))}</section>"


def _patches(rationalisation: Rationalisation) -> str:
    head = ["patch", "face", "blocks", "rows × columns", "direction", "turn", "pieces", "mean",
            *(f"{p:g} %" if p < 100.0 else "greatest" for p in PERCENTILES), "strain", "least bow"]  # fmt: skip
    rows = [
        [
            str(p.number),
            html.escape(p.patch.face.name or "–"),
            str(len(p.blocks)),
            f"{len(p.family.rows) - 1} × {len(p.columns.borders) - 1}",
            f"{math.degrees(p.family.angle):.1f}°",
            f"{math.degrees(p.family.turn):.2f}°",
            str(p.pieces),
            amount(p.deviation.mean_mm),
            *(amount(float(v)) for v in p.deviation.percentiles_mm),
            f"{p.strain:.2%}",
            amount(p.least_bow_mm),
        ]
        for p in rationalisation.patches
    ]
    about = (
        "mm. Direction of the blocks against the way the face's u runs, turn of the planes against the blocks. Distances "
        "are measured on the face itself, at 33 points of every piece and half-way between leaves; strain and bow are "
        "those of rods with their piece in the middle."
    )
    return f"<section><h2>Patches</h2><p>{about}</p>{table(head, rows, numbers=(0, *range(2, len(head))))}</section>"


def _wires(rationalisation: Rationalisation) -> str:
    head = ["patch", "blocks, blade", "blocks, wire", "no more blocks", "the blade's blocks", "step", "kink"]
    rows = [
        [
            str(p.number),
            str(len(p.blocks)),
            str(p.wires.blocks),
            amount(p.wires.same_count_mm),
            amount(p.wires.same_blocks_mm),
            amount(p.wires.step_mm),
            f"{math.degrees(p.wires.kink_rad):.2f}°",
        ]
        for p in rationalisation.patches
    ]
    about = (
        "The same patches by a straight hot wire, in blocks no greater, in the direction that suits the wire best: how "
        "many it needs for the same tolerance; its greatest distance in mm with no more blocks than the blade has, and in "
        "the blade's own blocks; the greatest step and kink from wire to wire. The blade has neither."
    )
    return f"<section><h2>Against a straight wire</h2><p>{about}</p>{table(head, rows, numbers=range(7))}</section>"


def _seams(rationalisation: Rationalisation) -> str:
    if not rationalisation.seams:
        return ""
    rows = [
        [
            f"{s.first} – {s.second}",
            amount(s.length_mm),
            amount(s.gap_mm),
            f"{math.degrees(s.turn_rad):.2f}°",
            f"{math.degrees(s.crease_rad):.2f}°",
        ]
        for s in rationalisation.seams
    ]
    about = (
        "Where two patches meet, their cuts come from different blocks and planes: the greatest step and turn from one to "
        "the other, and the crease that the faces themselves have there. Within a patch the pieces of a leaf join without."
    )
    head = ["patches", "length, mm", "step, mm", "turn", "crease of the faces"]
    return f"<section><h2>Seams</h2><p>{about}</p>{table(head, rows, numbers=range(1, 5))}</section>"


def _jobs(jobs: Sequence[CutFolder]) -> str:
    rows = [
        [f"<code>batten cut {JOBS}/{html.escape(j.name)}/{JOB} -o OUT</code>", str(j.blocks), amount(j.tolerance_mm)]
        for j in jobs
    ]
    about = (
        "The planned surface of each patch in its block frame, as a job of its own; the tolerance is what the plan leaves "
        "of the whole one."
    )
    head = ["job", "blocks", "tolerance, mm"]
    return f"<section><h2>How to go on</h2><p>{about}</p>{table(head, rows, numbers=(1, 2))}</section>"
