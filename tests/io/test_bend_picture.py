"""The picture of a bent rod: 1200 pixels wide, every curve in its colour, grippers at both ends."""

import matplotlib.image
import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.io.bend_numbers import BendProblem
from batten.io.bend_picture import write_bend_png
from batten.io.drawn_curve import PALETTE


def pixels(path):
    return (255.0 * matplotlib.image.imread(path)[..., :3]).round().astype(int)


def count(image, colour):
    return int((np.abs(image - np.array(colour)).max(axis=2) <= 3).sum())


def test_every_curve_is_there_and_the_stable_ones_are_full(bent, tmp_path):
    write_bend_png(bent.problem, bent.solutions, tmp_path / "all.png", bent.rod)
    image = pixels(tmp_path / "all.png")
    assert image.shape[1] == 1200
    assert 700 < image.shape[0] < 1600
    assert (image[:3] == 255).all()
    assert (image[:, :3] == 255).all()
    full, dashed = ([count(image, PALETTE[i]) for i in some] for some in ((0, 1), (2, 3)))
    assert min(full) > 3500
    assert min(dashed) > 300
    assert max(dashed) < 0.5 * min(full)
    assert count(image, PALETTE[6]) == 0
    assert count(image, (0x1C, 0x27, 0x33)) > 2000, "grippers and text"


@pytest.mark.parametrize(("end", "length"), [((1000.0, 0.0), 1000.2), ((0.0, -1e-3), 1e-2)])
def test_flat_and_tiny_and_upright_ones_fit_in(bent, tmp_path, end, length):
    problem = BendProblem((0.0, 0.0), 0.0, end, 0.0, length)
    write_bend_png(problem, bent.solutions[:1], tmp_path / "one.png")
    height, width, _ = pixels(tmp_path / "one.png").shape
    assert width == 1200
    assert height < 1600


def test_nothing_to_draw(bent, tmp_path):
    with pytest.raises(InvalidInputError, match="nothing to draw"):
        write_bend_png(bent.problem, [], tmp_path / "none.png")
