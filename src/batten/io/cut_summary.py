"""A cut in a few lines: for people, and as plain data for programs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from batten.fabrication.plan import CheckResult, CutPlan
from batten.io.report import verdict
from batten.io.report_numbers import worst_rod
from batten.io.report_tables import amount, spaced


def is_whole(plan: CutPlan) -> bool:
    """Whether no leaf is refused and no hard limit broken."""
    return verdict(plan)[0]


def cut_summary(plan: CutPlan, out: Path) -> dict[str, Any]:
    """What `batten cut --json` prints: plain JSON values, None where a number does not exist.

    Parameters:
        plan: the plan.
        out: where its files lie.
    """
    whole, head, more = verdict(plan)
    return {
        "name": plan.name,
        "out": str(out),
        "whole": whole,
        "verdict": f"{head}. {more}",
        "blade_axis": plan.blade_axis,
        "direction_reason": plan.direction_reason,
        "blocks": len(plan.blocks),
        "leaves": len({r.leaf for r in plan.rods}),
        "rods": len(plan.rods),
        "refused_leaves": list(plan.refused_leaves),
        "repaired_leaves": sorted({r.leaf for r in plan.rods if r.repair and r.status == "ok"}),
        "checks": [_check_summary(plan, check) for check in plan.checks],
        "facts": {key: _finite(value) for key, value in plan.facts.items()},
    }


def _check_summary(plan: CutPlan, check: CheckResult) -> dict[str, Any]:
    worst = worst_rod(check)
    rod = plan.rods[worst] if worst >= 0 else None
    return {
        "name": check.name,
        "title": check.title,
        "unit": check.unit,
        "sense": check.sense,
        "limit": _finite(float(check.limit)),
        "worst": _finite(float(check.values[worst])) if rod else None,
        "margin": _finite(float(check.margins[worst])) if rod else None,
        "leaf": rod.leaf if rod else None,
        "block": rod.block if rod else None,
        "rods_beyond": int((~check.passed).sum()),
        "hard": check.hard,
    }


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def cut_lines(plan: CutPlan, out: Path) -> list[str]:
    """What `batten cut` prints: the verdict, a line for each check, where the report lies."""
    _, head, more = verdict(plan)
    lines = [f"{plan.name}: {head}. {more}"]
    width = max((len(check.title) for check in plan.checks), default=0)
    for check in plan.checks:
        worst = worst_rod(check)
        if worst < 0:
            lines.append(f"  none  {check.title:<{width}}  applies to no rod")
            continue
        rod = plan.rods[worst]
        mark = "pass" if check.passed.all() else "FAIL" if check.hard else "look"
        mark = mark if math.isfinite(check.limit) else "info"
        sign = "≤" if check.sense == "max" else "≥"
        limit = f"{sign} {check.limit:.6g}{spaced(check.unit)}" if math.isfinite(check.limit) else check.unit
        lines.append(
            f"  {mark}  {check.title:<{width}}  worst {amount(float(check.values[worst])):>9}  {limit:<12}  "
            f"leaf {rod.leaf}, block {rod.block}"
        )
    return [*lines, f"report: {out / 'report.html'}"]
