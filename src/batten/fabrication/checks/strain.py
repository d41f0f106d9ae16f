"""Strain of the rod's outermost fibre, on the whole rod and not only in the block."""

from __future__ import annotations

import numpy as np

from batten.fabrication.checks.context import CheckContext, greatest
from batten.fabrication.plan import CheckResult


def strain_check(context: CheckContext) -> CheckResult:
    """max |κ|·d/2 over the whole rod against `rod.max_strain`: beyond it steel stays bent (Fisker2018 §1.2).

    Accuracy: 1e-6 relative for rods of less than a full wave.
    """
    values = context.rod.strain(greatest(np.abs(context.curvature)))
    return CheckResult(
        "strain",
        "Strain on the whole rod",
        "",
        context.rod.max_strain,
        "max",
        values,
        "Of the outermost fibre, κ·d/2, from gripper to gripper.",
    )
