"""Tables of the report as HTML, and how it writes numbers."""

from __future__ import annotations

import dataclasses
import html
import math
from collections.abc import Iterable, Mapping, Sequence
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


def repairs(plan: CutPlan) -> tuple[tuple[str, ...], dict[int, tuple[str, ...]]]:
    """What was done to all leaves alike, and what to some: leaf → texts, of the leaves that are cut."""
    refused = set(plan.refused_leaves)
    said: dict[int, dict[str, None]] = {}  # a dict for a set that keeps its order
    for rod in plan.rods:
        if rod.leaf not in refused:
            said.setdefault(rod.leaf, {}).update(dict.fromkeys(rod.repair))
    first = next(iter(said.values()), {})
    common = tuple(text for text in first if len(said) > 1 and all(text in texts for texts in said.values()))
    own = {leaf: tuple(text for text in texts if text not in common) for leaf, texts in sorted(said.items())}
    return common, {leaf: texts for leaf, texts in own.items() if texts}


def repaired_rows(own: Mapping[int, tuple[str, ...]]) -> tuple[list[list[str]], int]:
    """A line for the leaves to which the same was done, up to `MOST_REPAIRED`; and how many lines are left out."""
    rows = _alike(own)
    return rows[:MOST_REPAIRED], max(0, len(rows) - MOST_REPAIRED)


def refused_rows(plan: CutPlan) -> list[list[str]]:
    """A line for the refused leaves with the same reasons, all of them."""
    reasons: dict[int, dict[str, None]] = {leaf: {} for leaf in plan.refused_leaves}
    for rod in plan.rods:
        if rod.leaf in reasons:
            reasons[rod.leaf].update(dict.fromkeys(rod.reasons))
    return _alike({leaf: tuple(texts) or ("no reason given",) for leaf, texts in reasons.items()})


def _alike(said: Mapping[int, tuple[str, ...]]) -> list[list[str]]:
    leaves: dict[tuple[str, ...], list[int]] = {}
    for leaf, texts in said.items():
        leaves.setdefault(texts, []).append(leaf)
    return [[leaf_ranges(alike), "<br />".join(map(html.escape, texts))] for texts, alike in leaves.items()]


def halves(head: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: Sequence[int]) -> str:
    """A long table of narrow rows as two tables side by side."""
    half = (len(rows) + 1) // 2
    parts = (part for part in (rows[:half], rows[half:]) if part)
    return f'<div class="halves">{"".join(table(head, part, numbers=numbers) for part in parts)}</div>'


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
