"""Meshes of known surfaces: distances, borders and areas that come back, and meshes that are refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from batten.errors import InvalidInputError
from batten.surfaces.deviation import surface_deviation
from batten.surfaces.mesh_region import mesh_regions


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 120 * np.sin(x / 400) + 80 * np.cos(y / 300) + 0.0002 * x * y


def grid_mesh(f=height, size=(1000.0, 600.0), counts=(41, 25), keep=None):  # type: ignore[no-untyped-def]
    """Vertices and triangles of a graph over a rectangle; `keep` chooses cells by their middles."""
    x, y = np.meshgrid(np.linspace(0, size[0], counts[0]), np.linspace(0, size[1], counts[1]), indexing="ij")
    vertices = np.stack([x, y, f(x, y)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(counts[0] - 1), np.arange(counts[1] - 1), indexing="ij")
    if keep is not None:
        middle = [(a[:-1, :-1] + a[1:, 1:]) / 2 for a in (x, y)]
        chosen = keep(*middle)
        i, j = i[chosen], j[chosen]
    a = (i * counts[1] + j).ravel()
    quads = np.stack([a, a + counts[1], a + counts[1] + 1, a + 1], axis=1)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def mesh_area(vertices: np.ndarray, triangles: np.ndarray) -> float:
    p, q, r = (vertices[triangles[:, i]] for i in range(3))
    return float(0.5 * np.linalg.norm(np.cross(q - p, r - p), axis=1).sum())


@pytest.mark.parametrize("tolerance", [10.0, 1.0, 0.1, 0.01])
def test_the_tolerance_is_kept_and_reported(tolerance: float) -> None:
    vertices, triangles = grid_mesh()
    (region,) = mesh_regions(vertices, triangles, tolerance)
    assert region.distance_max <= tolerance
    # An independent measure: the distance from very many points of the surface, a little too great by their spacing.
    surface = region.face.surface
    (u0, u1), (v0, v1) = surface.domain
    u, v = np.linspace(u0, u1, 801), np.linspace(v0, v1, 481)
    points = surface.point(u[:, None], v).reshape(-1, 3)
    from scipy.spatial import cKDTree

    found = cKDTree(points).query(vertices)[0]
    spacing = max((u1 - u0) / 800, (v1 - v0) / 480)
    assert region.distance_max <= found.max() <= region.distance_max + spacing
    assert region.distance_mean <= region.distance_max


def test_smaller_tolerances_take_more_spans() -> None:
    vertices, triangles = grid_mesh()
    spans = [mesh_regions(vertices, triangles, t)[0].spans for t in (30.0, 1.0, 0.01)]
    assert spans[0][0] < spans[1][0] < spans[2][0]
    assert all(a >= b for a, b in spans)


def test_between_the_vertices_it_is_the_surface_and_not_the_triangles() -> None:
    vertices, triangles = grid_mesh(counts=(21, 13))
    (region,) = mesh_regions(vertices, triangles, 0.05)
    x, y = np.meshgrid(np.linspace(60, 940, 57), np.linspace(60, 540, 43), indexing="ij")
    exact = np.stack([x, y, height(x, y)], axis=-1)
    smooth = surface_deviation(region.face.surface, exact).max
    middles = vertices[triangles].mean(axis=1)
    chords = np.abs(middles[:, 2] - height(middles[:, 0], middles[:, 1])).max()
    assert smooth < 0.1 < 0.2 < chords


def test_anywhere_in_space_and_the_normal_is_the_meshs() -> None:
    vertices, triangles = grid_mesh()
    turn = Rotation.from_euler("xyz", [0.7, -1.1, 2.0]).as_matrix()
    moved = vertices @ turn.T + [1e4, -2e4, 3e4]
    (region,), (still,) = mesh_regions(moved, triangles, 0.1), mesh_regions(vertices, triangles, 0.1)
    assert region.distance_max == pytest.approx(still.distance_max, rel=1e-3)
    assert region.plane.normal == pytest.approx(turn @ still.plane.normal, abs=1e-9)
    (u0, u1), (v0, v1) = region.face.surface.domain
    assert region.face.surface.normal(0.5 * (u0 + u1), 0.5 * (v0 + v1)) @ region.plane.normal > 0.9
    (turned,) = mesh_regions(vertices, triangles[:, ::-1], 0.1)
    assert turned.plane.normal == pytest.approx(-still.plane.normal, abs=1e-12)


def test_border_and_holes_become_trims() -> None:
    def keep(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = np.hypot(x - 500, y - 300)
        return (r < 280) & (np.hypot(x - 420, y - 320) > 90)

    vertices, triangles = grid_mesh(counts=(81, 49), keep=keep)
    (region,) = mesh_regions(vertices, triangles, 0.05)
    assert len(region.face.trims) == 2
    assert region.face.area() == pytest.approx(mesh_area(vertices, triangles), rel=1e-3)
    u, v = region.face.surface.closest_parameters([(500, 500, height(500, 500)), (420, 320, height(420, 320))])
    assert region.face.contains(u, v).tolist() == [True, False]
    outlines = region.face.outline(0.05)
    edge = np.concatenate(outlines)
    assert np.abs(edge[:, 2] - height(edge[:, 0], edge[:, 1])).max() < 1.0


def test_a_flat_rectangle_is_untrimmed_and_exact() -> None:
    vertices, triangles = grid_mesh(f=lambda x, y: 0.3 * x - 0.2 * y)
    (region,) = mesh_regions(vertices, triangles, 1e-6)
    assert region.spans[1] == 1
    assert region.face.area() == pytest.approx(6e5 * np.sqrt(1 + 0.09 + 0.04), rel=1e-9)


def test_pieces_become_faces_the_largest_first() -> None:
    vertices, triangles = grid_mesh(keep=lambda x, y: (x < 300) | (x > 500))
    regions = mesh_regions(vertices, triangles, 0.1, name="roof")
    assert [region.face.name for region in regions] == ["roof 1", "roof 2"]
    middles = [region.face.surface.control_points[..., 0].mean() for region in regions]
    assert middles[0] > 500 > 300 > middles[1]


def test_doubled_vertices_and_mixed_turns_are_put_right() -> None:
    vertices, triangles = grid_mesh(counts=(15, 9))
    soup = vertices[triangles].reshape(-1, 3)
    rows = np.arange(len(soup)).reshape(-1, 3)
    rows[::3] = rows[::3, ::-1]
    (region,), (wanted,) = mesh_regions(soup, rows, 0.5), mesh_regions(vertices, triangles, 0.5)
    assert region.distance_max == pytest.approx(wanted.distance_max, rel=1e-6)
    assert region.face.area() == pytest.approx(wanted.face.area(), rel=1e-9)


def test_noise_is_not_followed_farther_than_asked() -> None:
    rng = np.random.default_rng(4)
    vertices, triangles = grid_mesh()
    vertices[:, 2] += rng.uniform(-0.5, 0.5, len(vertices))
    (region,) = mesh_regions(vertices, triangles, 1.0)
    x, y = np.meshgrid(np.linspace(30, 970, 41), np.linspace(30, 570, 31), indexing="ij")
    exact = np.stack([x, y, height(x, y)], axis=-1)
    assert surface_deviation(region.face.surface, exact).mean < 0.25
    with pytest.raises(InvalidInputError, match="allowed are 1e-06"):
        mesh_regions(vertices[:200] * [1, 1, 40], _part(triangles, 200), 1e-6)


def _part(triangles: np.ndarray, count: int) -> np.ndarray:
    return triangles[(triangles < count).all(axis=1)]


def test_what_is_refused() -> None:
    vertices, triangles = grid_mesh(counts=(9, 7))
    with pytest.raises(InvalidInputError, match="tolerance"):
        mesh_regions(vertices, triangles, 0.0)
    with pytest.raises(InvalidInputError, match="0 triangles"):
        mesh_regions(vertices, np.zeros((0, 3), int), 1.0)
    with pytest.raises(InvalidInputError, match="count them from 0"):
        mesh_regions(vertices, triangles + 1, 1.0)
    with pytest.raises(InvalidInputError, match="no area"):
        mesh_regions([(0, 0, 0), (1, 1, 1), (2, 2, 2)], [(0, 1, 2)], 1.0)
    with pytest.raises(InvalidInputError, match="more than two triangles"):
        mesh_regions(np.vstack([vertices, [(500, 300, 900)]]), np.vstack([triangles, [(0, 8, len(vertices))]]), 1.0)
    tetrahedron = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
    with pytest.raises(InvalidInputError, match="closed"):
        mesh_regions([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], tetrahedron, 1.0)


def test_meshes_that_turn_over_are_refused() -> None:
    def bent(angle: float) -> tuple[np.ndarray, np.ndarray]:
        vertices, triangles = grid_mesh(f=lambda x, y: 0 * x)
        phi = vertices[:, 0] / 1000 * angle
        return np.stack([300 * np.sin(phi), vertices[:, 1], 300 * np.cos(phi)], axis=1), triangles

    assert mesh_regions(*bent(2.0), 1.0)[0].distance_max < 1.0
    with pytest.raises(InvalidInputError, match="turn less"):
        mesh_regions(*bent(4.0), 1.0)
    # A flat spiral strip that lies over itself, without steep triangles.
    t, w = np.meshgrid(np.linspace(0, 3 * np.pi, 121), np.linspace(0.5, 1.0, 9), indexing="ij")
    spiral = 500 * np.stack([w * np.cos(t), w * np.sin(t), 0.02 * t], axis=-1).reshape(-1, 3)
    _, triangles = grid_mesh(counts=(121, 9))
    with pytest.raises(InvalidInputError, match="lies over itself"):
        mesh_regions(spiral, triangles, 1.0)
