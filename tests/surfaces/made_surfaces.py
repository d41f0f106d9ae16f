"""Surfaces made for tests: graphs of functions, an elastica's heights by integration, parts of the example's wall."""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from batten.surfaces.bspline_surface import BSplineSurface

EXAMPLE = Path(__file__).parents[2] / "examples/freeform-wall"


def graph(f, x_range, y_range, n=(40, 40), degree=5):
    """z = f(x, y) over a rectangle, interpolated at n points; u = x and v = y."""
    sites = [np.linspace(*ends, count) for ends, count in zip((x_range, y_range), n)]
    knots = [make_interp_spline(s, s, k=degree).t for s in sites]
    return _through(f, sites, knots, degree)


def patch(surface, x_range, y_range):
    """The part over a rectangle of a cubic surface whose u and v are proportional to x and y, exactly."""
    (u0, u1), (v0, v1) = surface.domain
    corner = surface.point([u0, u1], [v0, v1])
    knots, sites = [], []
    for k, (ends, own) in enumerate(zip((x_range, y_range), (surface.knots_u, surface.knots_v))):
        scale = (corner[1, k] - corner[0, k]) / (own[-1] - own[0])
        inner = corner[0, k] + scale * (np.unique(own) - own[0])
        inner = inner[(inner > ends[0] + 1e-6) & (inner < ends[1] - 1e-6)]
        knots.append(np.concatenate([[ends[0]] * 4, inner, [ends[1]] * 4]))
        sites.append(np.clip(_greville(knots[-1], 3), *ends))

    def height(x, y):
        u = u0 + (u1 - u0) * (x - corner[0, 0]) / (corner[1, 0] - corner[0, 0])
        v = v0 + (v1 - v0) * (y - corner[0, 1]) / (corner[1, 1] - corner[0, 1])
        return surface.point(u, v)[..., 2]

    return _through(height, sites, knots, 3)


def elastica_heights(x, start_height, start_angle, start_curvature, force):
    """Heights y(x) of an elastica, by integrating dy/dx = tan θ, dθ/dx = κ/cos θ with κ affine in position."""

    def rates(t, state):
        kappa = start_curvature + (t - x[0]) * force[1] - (state[0] - start_height) * force[0]
        return np.tan(state[1]), kappa / np.cos(state[1])

    done = solve_ivp(rates, (x[0], x[-1]), (start_height, start_angle), "DOP853", x, rtol=1e-13, atol=1e-13)
    assert done.success
    return done.y[0]


def cylinder(radius, length):
    """60° to either side of the top of a cylinder about the y axis, exact and rational, 0 ≤ y ≤ `length`."""
    s, c = np.sin(np.pi / 3), np.cos(np.pi / 3)
    net = [(-s * radius, c * radius), (0.0, radius / c), (s * radius, c * radius)]
    points = [[(x, y, z) for y in (0.0, length)] for x, z in net]
    return BSplineSurface([0, 0, 0, 1, 1, 1], [0, 0, 1, 1], 2, 1, points, [[w, w] for w in (1.0, c, 1.0)])


def example_wall():
    """The example's surface in mm (10 × 10 units of 300 mm) and its job, every leaf chosen for itself."""
    from dataclasses import replace

    from batten.io.job import load_job
    from batten.io.job_surface import read_job_surface

    job = load_job(EXAMPLE / "wall.toml")
    job = replace(job, leaves=replace(job.leaves, hold_between=False))
    return read_job_surface(job.surface), job


def _greville(knots, degree):
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree).mean(axis=-1)


def _through(f, sites, knots, degree):
    z = f(*np.meshgrid(*sites, indexing="ij"))
    z = make_interp_spline(sites[0], z, k=degree, t=knots[0]).c
    z = make_interp_spline(sites[1], z.T, k=degree, t=knots[1]).c.T
    x, y = np.meshgrid(*(_greville(t, degree) for t in knots), indexing="ij")
    return BSplineSurface(*knots, degree, degree, np.stack([x, y, z], axis=-1))
