"""Rods made by hand, of which everything is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.fabrication.checks.context import CheckContext
from batten.fabrication.job import CutJob, KerfJob, SurfaceJob
from batten.fabrication.plan import Block, RodPlacement
from batten.surfaces.bspline_surface import BSplineSurface
from batten.surfaces.plane import Plane


def vertical(y=0.0, turn=0.0, through=(0.0, 0.0)):
    """The vertical plane through (through[0], through[1] + y), turned counter-clockwise in plan."""
    return Plane((through[0], through[1] + y, 0.0), (np.cos(turn), np.sin(turn), 0.0), (0.0, 0.0, 1.0))


def line(length=600.0, start=(0.0, 200.0), angle=0.0):
    return Elastica(start, angle, 0.0, (0.0, 0.0), length)


def arc(radius, length, start=(0.0, 200.0), angle=0.0):
    """A circle's arc; a negative radius bends to the right."""
    return Elastica(start, angle, 1.0 / radius, (0.0, 0.0), length)


def place(piece, before=200.0, after=200.0, *, block=1, leaf=1, plane=None, design=None):
    points = piece.point_at(np.linspace(0.0, piece.length, 41)) if design is None else design
    plane = vertical(300.0) if plane is None else plane
    return RodPlacement(block, leaf, plane, np.asarray(points, float), piece, piece.extended(before, after), before)


def block(number=1, row=0, column=0, size=(600.0, 600.0, 400.0)):
    return Block(number, row, column, np.array([column * size[0], row * size[1], 0.0]), np.array(size))


def flat(height=200.0, slope=0.0):
    """The plane z = height + slope·x over [−2000, 2000]²."""
    corners = [[(x, y, height + slope * x) for y in (-2000.0, 2000.0)] for x in (-2000.0, 2000.0)]
    return BSplineSurface([0, 0, 1, 1], [0, 0, 1, 1], 1, 1, corners)


def cylinder(radius, centre):
    """The upper quarter, 45° to either side, of the cylinder about the axis x = centre[0], z = centre[1]; |y| < 2000."""
    a = radius * np.sqrt(0.5)
    net = [(-a, a), (0.0, 2.0 * a), (a, a)]
    points = [[(centre[0] + x, y, centre[1] + z) for y in (-2000.0, 2000.0)] for x, z in net]
    weights = [[w, w] for w in (1.0, np.sqrt(0.5), 1.0)]
    return BSplineSurface([0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1, points, weights)


def context(rods, blocks=None, surface=None, job=None):
    job = CutJob(SurfaceJob(), kerf=KerfJob(offset=False)) if job is None else job
    return CheckContext.of(job, surface or flat(), [block()] if blocks is None else blocks, rods)


@pytest.fixture
def hand():
    """Makers of planes, pieces, placements, blocks, surfaces and contexts."""
    return SimpleNamespace(
        vertical=vertical,
        line=line,
        arc=arc,
        place=place,
        block=block,
        flat=flat,
        cylinder=cylinder,
        context=context,
    )
