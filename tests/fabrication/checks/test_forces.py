"""Forces of Euler's strut, moments of circles."""

import dataclasses
import math

import pytest
from scipy.special import ellipk

from batten.curves.elastica import Elastica
from batten.fabrication.checks.forces import forces_checks
from batten.fabrication.job import CutJob, GripperJob, SurfaceJob

STIFFNESS = 200000.0 * math.pi * 3.0**4 / 64.0


def test_a_nearly_straight_strut_bears_eulers_load(hand):
    quarter = float(ellipk(1e-6))
    strut = Elastica.from_modulus(1e-3, -quarter, 2.0 * quarter, 1000.0 / (2.0 * quarter))
    force, moment = forces_checks(hand.context([hand.place(strut.extended(-200.0, -200.0))]))
    assert force.values == pytest.approx([math.pi**2 * STIFFNESS / 1000.0**2], rel=1e-6)
    assert moment.values == pytest.approx([0.0], abs=1e-6)


def test_circles_bear_a_moment_alone(hand):
    force, moment = forces_checks(hand.context([hand.place(hand.arc(r, 600.0)) for r in (300.0, -500.0)]))
    assert force.values == pytest.approx([0.0, 0.0])
    assert moment.values == pytest.approx([STIFFNESS / 300.0, STIFFNESS / 500.0])


def test_limits_bind_where_the_job_sets_them(hand):
    rods = [hand.place(hand.arc(r, 600.0)) for r in (300.0, 500.0)]
    force, moment = forces_checks(hand.context(rods))
    assert (force.limit, moment.limit, force.hard, moment.hard) == (math.inf, math.inf, False, False)
    assert moment.passed.all()
    job = dataclasses.replace(CutJob(SurfaceJob()), gripper=GripperJob(max_force_n=50.0, max_moment_nmm=2000.0))
    force, moment = forces_checks(hand.context(rods, job=job))
    assert (force.limit, moment.limit, force.hard, moment.hard) == (50.0, 2000.0, True, True)
    assert moment.passed.tolist() == [False, True]
