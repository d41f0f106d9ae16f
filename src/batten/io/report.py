"""report.html: one self-contained page on a cut, for an engineer to read and sign. It holds no date: sign and date it."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path

import numpy as np

from batten.fabrication.job import CutJob
from batten.fabrication.plan import CheckResult, CutPlan
from batten.io.report_maps import ABSENT, BROKEN, RAMP, check_map
from batten.io.report_numbers import (
    RodNumbers,
    critical_rod,
    leaf_ranges,
    rod_numbers,
    use_of_limit,
    wall_order,
    worst_rod,
)
from batten.io.report_tables import (
    amount,
    force_rows,
    halves,
    job_tables,
    quantity,
    refused_rows,
    repaired_rows,
    repairs,
    spaced,
    table,
)
from batten.io.simulation_page import files_section, report_section
from batten.io.software import software_name

_PICTURES = (  # key, heading, what is seen
    (
        "wall",
        "The wall",
        "All leaves within their blocks, coloured by the distance of the planned cut from the given surface. "
        "Numbers are those of the blocks.",
    ),
    ("block", "One block", ""),
    (
        "strain",
        "Curvature and strain",
        "Every rod from gripper to gripper, one line each. The limit holds on the whole rod, not only inside the block.",
    ),
    ("forces", "Forces at the grippers", "From EI and the elastica: the force is the same at both ends of a rod."),
)


def write_report(
    path: str | Path, plan: CutPlan, job: CutJob, *, pictures: bool = True, files: Mapping[str, str] | None = None
) -> None:
    """Write the report.

    Parameters:
        path: the HTML file to write, overwritten if it exists.
        plan: the plan; refused leaves included.
        job: the job that it answers.
        pictures: whether to draw the four large pictures; the maps of the checks are always there.
        files: SHA-256 of the other files of the cut by their names, to be listed at the end.
    """
    Path(path).write_text(report_html(plan, job, pictures=pictures, files=files or {}), encoding="utf-8", newline="\n")


def report_html(plan: CutPlan, job: CutJob, *, pictures: bool, files: Mapping[str, str]) -> str:
    """The report's text: well-formed XML after its first line, nothing in it refers to anything outside of it."""
    style = resources.files("batten.io").joinpath("report.css").read_text(encoding="utf-8")
    title = html.escape(plan.name)
    body = [_header(plan, job), _verdict(plan)]
    if plan.rods:
        numbers = rod_numbers(plan, job)
        drawn = _picture_sections(plan, job, numbers) if pictures else ("",) * len(_PICTURES)
        wall, *others = drawn
        body += [_figures(plan, job, numbers), wall, _checks(plan), _maps(plan), _leaves(plan), *others]
        body += [_forces(plan, numbers)]
    body += [
        report_section(None),
        _direction(plan),
        _job(job),
        *([files_section(files)] if files else []),
        _signature(),
    ]
    return (
        f'<!DOCTYPE html>\n<html lang="en" xmlns="http://www.w3.org/1999/xhtml">\n<head>\n<meta charset="utf-8" />\n'
        f'<meta name="viewport" content="width=device-width" />\n<title>{title} – cut report</title>\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n" + "\n".join(body) + "\n</body>\n</html>\n"
    )


def _header(plan: CutPlan, job: CutJob) -> str:
    source = html.escape(job.surface.source.name) if job.surface.file or job.surface.curves else "no file"
    return (
        f'<header><div><p class="kind">Cut report</p><h1>{html.escape(plan.name)}</h1></div>'
        f'<p class="meta">{html.escape(software_name())}<br />surface: {source}</p></header>'
    )


def verdict(plan: CutPlan) -> tuple[bool, str, str]:
    """Whether the plan is whole, its headline, and one sentence more."""
    if not plan.rods:
        return False, "There is nothing to cut", "The plan holds no rod."
    leaves = len({r.leaf for r in plan.rods})
    refused = plan.refused_leaves
    is_cut = np.array([r.status == "ok" for r in plan.rods], dtype=np.bool_)
    beyond = [(check, int((is_cut & ~check.passed).sum())) for check in plan.checks]
    hard = [(check, count) for check, count in beyond if count and check.hard]
    remarks = [(check, count) for check, count in beyond if count and not check.hard]
    soft = f" Worth a look: {_titles(remarks)}." if remarks else ""
    if hard:
        return False, "A limit is broken", f"Cut beyond their limit: {_titles(hard)}." + soft
    if refused:
        which = f"{'leaf' if len(refused) == 1 else 'leaves'} {leaf_ranges(refused)}"
        more = f"Not cut: {which}. The robot program leaves them out."
        return False, f"{len(refused)} of {leaves} leaves refused", more + soft
    return True, "Can be cut", f"All {leaves} leaves ({len(plan.rods)} rods) keep every hard limit.{soft}"


def _titles(checks: Iterable[tuple[CheckResult, int]]) -> str:
    return ", ".join(f"{check.title} ({count} rod{'' if count == 1 else 's'})" for check, count in checks)


def _verdict(plan: CutPlan) -> str:
    good, head, more = verdict(plan)
    return (
        f'<section class="verdict {"good" if good else "bad"}"><strong>{"✓" if good else "✗"} {html.escape(head)}</strong>'
        f"<p>{html.escape(more)}</p></section>"
    )


def _figures(plan: CutPlan, job: CutJob, numbers: RodNumbers) -> str:
    corners = np.array([b.corner_mm for b in plan.blocks])
    size = (np.array([b.corner_mm + b.size_mm for b in plan.blocks]).max(axis=0) - corners.min(axis=0)) / 1000.0
    cut = np.flatnonzero(~numbers.refused)
    of = " of what is cut" if 0 < len(cut) < len(plan.rods) else ""
    cut = cut if len(cut) else np.arange(len(plan.rods))
    deviation = float(numbers.greatest_deviation_mm[cut].max())
    strain = 100.0 * float(np.abs(numbers.strain[cut]).max())
    moment = 1e-3 * max(float(np.abs(m[cut]).max()) for m in (numbers.moment_left_nmm, numbers.moment_right_nmm))
    entries = [
        ("wall", f"{size[0]:.3g} × {size[1]:.3g}", "m"),
        ("blocks", str(len(plan.blocks)), ""),
        ("leaves", str(len({r.leaf for r in plan.rods})), f"{len(plan.refused_leaves)} refused"),
        ("rods", str(len(plan.rods)), f"{len(repairs(plan)[1])} leaves repaired"),
        (f"greatest deviation{of}", amount(deviation), f"mm of {job.leaves.tolerance_mm:g}"),
        (f"greatest strain{of}", amount(strain), f"% of {100 * job.rod.max_strain:g}"),
        (f"greatest force{of}", amount(float(numbers.force_n[cut].max())), "N"),
        (f"greatest moment{of}", amount(moment), "N·m"),
    ]
    cells = "".join(
        f"<div><dt>{name}</dt><dd>{value} <small>{unit}</small></dd></div>" for name, value, unit in entries
    )
    return f'<dl class="figures">{cells}</dl>'


def _checks(plan: CutPlan) -> str:
    rows = [_check_row(plan, check) for check in plan.checks]
    head = ("check", "", "limit", "worst", "margin", "limit used", "where", "rods beyond")
    return '<section class="checks"><h2>Checks</h2>' + table(head, rows, numbers=(2, 3, 4, 7)) + "</section>"


def _check_row(plan: CutPlan, check: CheckResult) -> list[str]:
    note = f'<span class="note">{html.escape(check.note)}</span>' if check.note else ""
    title = html.escape(check.title) + note
    sign = "≤" if check.sense == "max" else "≥"
    limited = math.isfinite(check.limit)
    limit = html.escape(f"{sign} {check.limit:.6g}{spaced(check.unit)}") if limited else "none"
    worst = worst_rod(check)
    if worst < 0:
        return [title, '<span class="mark mild">– none</span>', limit, "–", "–", "", "applies to no rod", "0"]
    broken = int((~check.passed).sum())
    good, mild = '<span class="mark">✓ pass</span>', '<span class="mark mild">! remark</span>'
    mark = (
        '<span class="mark mild">reported</span>'
        if not limited
        else good
        if not broken
        else '<span class="mark bad">✗ fail</span>'
        if check.hard
        else mild
    )
    rod = plan.rods[worst]
    use = float(use_of_limit(check)[worst])
    width = min(100.0, 100.0 * use) if math.isfinite(use) else 100.0
    colour = ' class="bad"' if use > 1.0 else ""
    bar = f'<span class="bar"><i{colour} style="width:{width:.0f}%"></i></span>'
    where = f'<span class="whole">leaf {rod.leaf}, block {rod.block}</span>'
    worst_text, margin = (html.escape(quantity(float(v[worst]), check.unit)) for v in (check.values, check.margins))
    if not limited:
        margin, bar = "–", ""
    return [title, mark, limit, worst_text, margin, bar, where, str(broken)]


def _maps(plan: CutPlan) -> str:
    order = wall_order(plan)
    figures = "".join(
        f"<figure><figcaption>{html.escape(_map_title(check))}</figcaption>"
        f'<img alt="{html.escape(check.title)}, over the wall" src="{check_map(plan, order, check)}" /></figure>'
        for check in plan.checks
    )
    ramp = ", ".join("rgb({},{},{})".format(*colour) for colour in RAMP)
    red, grey = ("rgb({},{},{})".format(*c) for c in (BROKEN, ABSENT))
    legend = (
        f'<p class="legend">none of the limit used <b style="background:linear-gradient(90deg, {ramp})"></b> all of it '
        f'<u style="background:{red}"></u> beyond it <u style="background:{grey}"></u> does not apply</p>'
    )
    about = "The wall in plan, x to the right and y up, one cell for each leaf in each block."
    return f'<section><h2>Where</h2><p>{about}</p>{legend}<div class="maps">{figures}</div></section>'


def _map_title(check: CheckResult) -> str:
    worst = worst_rod(check)
    if math.isfinite(check.limit) or worst < 0:
        return check.title
    return f"{check.title} (darkest: {quantity(float(check.values[worst]), check.unit)})"


def _leaves(plan: CutPlan) -> str:
    parts = []
    rows = refused_rows(plan)
    if rows:
        body = table(("leaves", "why"), rows, numbers=())
        parts.append(f'<section class="leaves"><h2>Refused leaves</h2>{body}</section>')
    common, own = repairs(plan)
    lines, hidden = repaired_rows(own)
    every = f"<p>All leaves: {html.escape('; '.join(common))}.</p>" if common else ""
    some = halves(("leaves", "what was done"), lines, numbers=()) if lines else ""
    none = "<p>None: every leaf was taken as it was given.</p>" if not (common or own) else ""
    more = f'<p class="soft">{hidden} lines more: in cut.json.</p>' if hidden else ""
    parts.append(f'<section class="leaves"><h2>Repaired leaves</h2>{every}{none}{some}{more}</section>')
    return "".join(parts)


def _picture_sections(plan: CutPlan, job: CutJob, numbers: RodNumbers) -> Sequence[str]:
    from batten.io.report_pictures import draw_pictures  # matplotlib takes half a second to load

    featured, check = critical_rod(plan)
    rod = plan.rods[featured]
    least = f" It has the least margin of all: {check.title.lower()}." if check is not None else ""
    about = f"Block {rod.block} with leaf {rod.leaf}.{least} Pictured in the block's work frame: blade to the right."
    drawn = draw_pictures(plan, job, numbers, featured)
    sections = []
    for key, heading, text in _PICTURES:
        address = drawn[key]
        caption = html.escape(text or about)
        sections.append(
            f'<section class="picture"><h2>{heading}</h2><p>{caption}</p>'
            f'<figure class="wide"><img alt="{heading}" src="{address}" /></figure></section>'
        )
    return sections


def _forces(plan: CutPlan, numbers: RodNumbers) -> str:
    head = ("block", "rods cut", "force, N", "at leaf", "left moment, N·m", "at leaf", "right moment, N·m", "at leaf")
    rows = force_rows(plan, numbers)
    body = table(head, rows, numbers=tuple(range(1, 8)))
    about = "The greatest of each block; moments are positive counter-clockwise in the plane of the leaf."
    return f"<section><h2>Gripper forces and moments by block</h2><p>{about}</p>{body}</section>"


def _direction(plan: CutPlan) -> str:
    rows = [[html.escape(fact_title(key)), _fact(value)] for key, value in plan.facts.items()]
    reason = html.escape(plan.direction_reason)
    shown = halves(("fact", "value"), rows, numbers=(1,)) if rows else ""
    text = f"<p>The blade lies along wall {plan.blade_axis}: {reason}.</p>"
    return f"<section><h2>Direction and plan</h2>{text}{shown}</section>"


_UNITS = {"mm": "mm", "s": "s", "deg": "°"}


def fact_title(key: str) -> str:
    """The name of a fact for people: its words, and its unit behind a comma."""
    words = key.split("_")
    unit = _UNITS.get(words[-1])
    text = " ".join(words[:-1] if unit else words).replace("lambda residual", "λ-residual")
    return f"{text}, {unit}" if unit else text


def _fact(value: float | int | str) -> str:
    return html.escape(amount(value) if isinstance(value, float) else str(value))


def _job(job: CutJob) -> str:
    return f'<section><h2>The job as read</h2><div class="two">{job_tables(job)}</div></section>'


def _signature() -> str:
    fields = "".join(f"<div>{name}</div>" for name in ("checked by", "date", "signature"))
    return f'<div class="sign">{fields}</div>'
