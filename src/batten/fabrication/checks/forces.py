"""What the grippers have to hold."""

from __future__ import annotations

import math

import numpy as np

from batten.fabrication.checks.context import CheckContext
from batten.fabrication.plan import CheckResult


def forces_checks(context: CheckContext) -> tuple[CheckResult, CheckResult]:
    """Force EI·|(λ₁, λ₂)| (N) and the greater of the two bending moments EI·|κ| (N·mm) at the grippers.

    From the shape alone (Brander2016 §2.1): weight, melting and the way the rod was brought there do not count. Without a
    limit in the job the limit is infinite and the check soft.

    Accuracy: that of the elastica, 1e-12. Near a straight line the force is what the fit chose.
    """
    gripper = context.job.gripper
    force = context.rod.force_n(context.rod_parameters[:, 4:6])
    moment = np.abs(context.rod.moment_nmm(context.curvature[:, [0, -1]])).max(axis=1)
    note = "From the rod's shape and stiffness EI; its weight is left out."
    return (
        CheckResult(
            "gripper_force",
            "Force at the grippers",
            "N",
            math.inf if gripper.max_force_n is None else gripper.max_force_n,
            "max",
            force,
            note,
            hard=gripper.max_force_n is not None,
        ),
        CheckResult(
            "gripper_moment",
            "Bending moment at the grippers",
            "N·mm",
            math.inf if gripper.max_moment_nmm is None else gripper.max_moment_nmm,
            "max",
            moment,
            note,
            hard=gripper.max_moment_nmm is not None,
        ),
    )
