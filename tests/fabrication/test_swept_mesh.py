"""The mesh of a swept face: cut exactly to the block, whole, without needless points."""

import numpy as np
import pytest

from batten.fabrication.swept_mesh import clipped, mesh_within, plan_depth

LOW, HIGH = np.array([0.0, 0.0]), np.array([1.0, 0.7])


def test_triangles_are_cut_exactly():
    """Random triangles against the shoelace area of the polygon that a general clipper leaves, and values stay linear."""
    rng = np.random.default_rng(4)
    corners = rng.uniform(-0.8, 1.8, (300, 3, 2))
    values = 2.0 * corners[..., 0] - 3.0 * corners[..., 1] + 0.5
    done = clipped(np.concatenate([corners, np.zeros((300, 3, 1)), values[..., None]], axis=2), LOW, HIGH)
    area = np.abs(np.cross(done[:, 1, :3] - done[:, 0, :3], done[:, 2, :3] - done[:, 0, :3])[:, 2]).sum() / 2.0
    assert area == pytest.approx(sum(polygon_area(clip(list(c), LOW, HIGH)) for c in corners), rel=1e-9)
    assert done[..., 3] == pytest.approx(2.0 * done[..., 0] - 3.0 * done[..., 1] + 0.5, abs=1e-9)


def clip(polygon, low, high):
    """Sutherland and Hodgman, one corner at a time."""
    for axis in (0, 1):
        for bound, sense in ((low[axis], 1.0), (high[axis], -1.0)):
            kept = []
            for p, q in zip(polygon, polygon[1:] + polygon[:1]):
                a, b = sense * (p[axis] - bound), sense * (q[axis] - bound)
                if a >= 0.0:
                    kept.append(p)
                if (a >= 0.0) != (b >= 0.0):
                    kept.append(p + a / (a - b) * (q - p))
            polygon = kept
    return polygon


def polygon_area(polygon):
    if len(polygon) < 3:
        return 0.0
    x, y = np.array(polygon).T
    return 0.5 * abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


@pytest.mark.parametrize("step", [0.05, 0.07])
def test_a_grid_is_cut_to_the_block(step):
    """With rows and columns on the border, and with none there: the same face, every edge in two triangles at most."""
    x, y = np.meshgrid(np.arange(-0.35, 1.4, step), np.arange(-0.35, 1.1, step), indexing="ij")
    x, y = x.T, y.T
    grid = np.stack([x, y, 0.5 * x], axis=-1)
    values = np.where((x >= 0.0) & (x <= 1.0), x + 2.0 * y, np.nan)
    asked = []

    def measure(points):
        asked.append(points)
        return points[:, 0] + 2.0 * points[:, 1]

    mesh = mesh_within(grid, values, LOW, HIGH, measure)
    corners = mesh.points[mesh.triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area.sum() == pytest.approx(0.7 * np.hypot(1.0, 0.5), rel=1e-9)
    assert plan_depth(mesh.points, LOW, HIGH).min() > -1e-9
    assert mesh.signed == pytest.approx(mesh.points[:, 0] + 2.0 * mesh.points[:, 1], abs=1e-9)
    assert set(np.unique(mesh.triangles)) == set(range(len(mesh.points)))
    edges = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert np.unique(edges, axis=0, return_counts=True)[1].max() <= 2
    assert plan_depth(np.concatenate(asked), LOW, HIGH).max() < 0.0 if asked else step == 0.05


def test_holes_and_nothing():
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 11), np.linspace(0.0, 0.7, 9), indexing="xy")
    grid = np.stack([x, y, 0.0 * x], axis=-1)
    grid[4, 5] = np.nan
    holed = mesh_within(grid, np.zeros(x.shape), LOW, HIGH, lambda p: np.zeros(len(p)))
    assert np.isfinite(holed.points).all()
    assert len(holed.triangles) == 2 * 4 * 10 - 6
    assert len(mesh_within(grid[:0], np.zeros((0, 11)), LOW, HIGH, lambda p: np.zeros(len(p))).triangles) == 0
