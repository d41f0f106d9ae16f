"""The pictures of a simulation: colours by the limit, the map over the blocks, the histogram by area."""

from types import SimpleNamespace

import numpy as np
import pytest

from batten.fabrication.plan import Block
from batten.fabrication.swept_mesh import Mesh
from batten.io.simulation_pictures import deviation_colours, deviation_histogram, deviation_map


@pytest.fixture
def simulation():
    """Two blocks side by side, 0.5 mm above the design and 2 mm below it: the right one fails at a limit of 1 mm."""
    blocks = []
    for number, value in ((1, 0.5), (2, -2.0)):
        corner = np.array([100.0 * (number - 1), 0.0, 0.0])
        x, y = np.meshgrid([0.0, 50.0, 100.0], [0.0, 60.0], indexing="ij")
        points = np.stack([x.ravel() + corner[0], y.ravel(), 0.0 * x.ravel()], axis=1)
        triangles = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
        signed = np.full(6, value)
        blocks.append(
            SimpleNamespace(
                block=Block(number, 0, number - 1, corner, np.array([100.0, 60.0, 50.0])),
                mesh=Mesh(points, signed, triangles),
                signed=signed,
                areas=np.full(6, float(number)),
                is_at_leaf=np.array([True, True, False, False, False, False]),
                worst=(abs(value), points[3], "at leaf 1"),
            )
        )
    return SimpleNamespace(blocks=tuple(blocks), failing=(2,), limit_mm=1.0)


def test_colours_end_at_the_limit():
    low, under, middle, over, high = deviation_colours(np.array([-1.001, -1.0, 0.0, 1.0, 1.001]), 1.0).tolist()
    assert low == high == [195, 0, 122]
    assert under == [11, 51, 94]
    assert over == [168, 50, 10]
    assert min(middle) > 230
    assert deviation_colours(np.array([0.3, -0.3]), 1.0).shape == (2, 3)


def test_the_map_shows_every_block_where_it_lies(simulation):
    drawing = deviation_map(simulation)
    axes, bar = drawing.axes
    meshes = [c for c in axes.collections if c.get_array() is not None]
    assert [float(m.get_array()[0]) for m in meshes] == [0.5, -2.0]
    assert all(m.get_clim() == (-1.0, 1.0) for m in meshes)
    assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 200.0), (0.0, 60.0))
    assert [t.get_text() for t in axes.texts] == ["1", "2"]
    (cross,) = axes.lines
    assert (cross.get_xdata()[0], cross.get_ydata()[0]) == (150.0, 60.0)
    assert "limit" in bar.get_ylabel()


def test_the_histogram_counts_areas_and_holds_everything(simulation):
    axes = deviation_histogram(simulation).axes[0]
    heights = np.array([p.get_height() for p in axes.patches if hasattr(p, "get_height")])
    edges = np.array([p.get_x() for p in axes.patches if hasattr(p, "get_height")])
    assert heights.sum() == pytest.approx(100.0)
    assert sorted(heights[heights > 0.0]) == pytest.approx([100.0 / 3.0, 200.0 / 3.0])  # by area 1 : 2
    assert edges.min() <= -2.0
    assert [line.get_xdata()[0] for line in axes.lines] == [-1.0, 1.0]
