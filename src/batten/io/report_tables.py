"""Tables of the report as HTML, and how it writes numbers."""

from __future__ import annotations

import dataclasses
import html
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batten.fabrication.job import CutJob
from batten.fabrication.plan import CutPlan
from batten.io.report_numbers import RodNumbers, leaf_ranges

MOST_REPAIRED = 60
"""Lines of repaired leaves that are listed; refused ones are all listed."""


def amount(value: float) -> str:
    """Three significant digits without exponents where a person would not write one: 0.0123, 1.23, 123, 12300."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "∞" if value > 0.0 else "−∞"
    size = abs(value)
    if size != 0.0 and (size < 1e-4 or size >= 1e7):
        digits, exponent = f"{value:.2e}".split("e")
        return f"{digits.replace('-', '−')}·10{_raised(int(exponent))}"
    decimals = 0 if size >= 99.95 else 1 if size >= 9.995 else 2 if size >= 0.9995 else 3 if size >= 0.09995 else 4
    return f"{value:.{decimals}f}".replace("-", "−")


def quantity(value: float, unit: str) -> str:
    """A number and its unit, as plain text."""
    return (amount(value) + spaced(unit)) if math.isfinite(value) else amount(value)


def spaced(unit: str) -> str:
    """A unit as it follows a number."""
    return unit if unit in ("°", "") else f" {unit}"


def _raised(number: int) -> str:
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: Sequence[int]) -> str:
    """A table; cells are HTML already. Columns in `numbers` are set flush right."""
    classes = [' class="n"' if i in numbers else "" for i in range(len(head))]
    top = "".join(f"<th{c}>{text}</th>" for c, text in zip(classes, head))
    body = "\n".join("<tr>" + "".join(f"<td{c}>{t}</td>" for c, t in zip(classes, row)) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody></table>"


def leaf_rows(plan: CutPlan) -> tuple[list[list[str]], int]:
    """The refused leaves, then the repaired ones, leaves of which the same is said in one line; how many are not listed."""
    rows: dict[bool, list[list[str]]] = {True: [], False: []}
    refused = set(plan.refused_leaves)
    texts: dict[int, dict[str, None]] = {}  # a dict for a set that keeps its order
    blocks: dict[int, list[int]] = {}
    for rod in plan.rods:
        said = rod.reasons if rod.leaf in refused else rod.repair
        texts.setdefault(rod.leaf, {}).update(dict.fromkeys(said))
        if said or rod.status == "refused":
            blocks.setdefault(rod.leaf, []).append(rod.block)
    alike: dict[tuple[bool, tuple[str, ...]], list[int]] = {}
    for leaf in sorted(texts):
        if leaf in refused or texts[leaf]:
            alike.setdefault((leaf in refused, tuple(texts[leaf])), []).append(leaf)
    for (is_refused, said), leaves in alike.items():
        mark = '<span class="mark bad">✗ refused</span>' if is_refused else '<span class="mark mild">repaired</span>'
        what = "<br />".join(map(html.escape, said)) or "no reason given"
        inside = leaf_ranges([block for leaf in leaves for block in blocks.get(leaf, [])])
        rows[is_refused].append([leaf_ranges(leaves), inside, mark, what])
    return rows[True] + rows[False][:MOST_REPAIRED], max(0, len(rows[False]) - MOST_REPAIRED)


def force_rows(plan: CutPlan, numbers: RodNumbers) -> list[list[str]]:
    """For every block: its greatest force and moments of the rods that are cut, and at which leaves."""
    rows = []
    for block in plan.blocks:
        inside = [i for i, r in enumerate(plan.rods) if r.block == block.number and r.status == "ok"]
        row = [str(block.number), str(len(inside))]
        for values in (numbers.force_n, 1e-3 * numbers.moment_left_nmm, 1e-3 * numbers.moment_right_nmm):
            if inside:
                worst = inside[int(np.argmax(np.abs(values[inside])))]
                row += [amount(float(values[worst])), str(plan.rods[worst].leaf)]
            else:
                row += ["–", "–"]
        rows.append(row)
    return rows


def job_tables(job: CutJob) -> str:
    """One small table for every section of the job; values that are not set are not shown."""
    tables = []
    for part in dataclasses.fields(job):
        section = getattr(job, part.name)
        if dataclasses.is_dataclass(section) and not isinstance(section, type):
            rows = [[html.escape(key), html.escape(text)] for key, text in _entries(section, "")]
            tables.append(table((part.name, ""), rows, numbers=(1,)))
    return "".join(tables)


def _entries(section: Any, prefix: str) -> Iterable[tuple[str, str]]:
    for field in dataclasses.fields(section):
        value = getattr(section, field.name)
        if dataclasses.is_dataclass(value):
            yield from _entries(value, f"{prefix}{field.name}.")
        elif value is not None:
            yield prefix + field.name, _plain(value)


def _plain(value: Any) -> str:
    if isinstance(value, Path):
        return value.name
    if isinstance(value, tuple):
        return ", ".join(map(_plain, value))
    return f"{value:.10g}" if isinstance(value, float) else str(value)
