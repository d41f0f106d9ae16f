"""Cross sections against sums over a fine grid, and against each other."""

import math

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.fabrication.section import FlatSection, RoundSection, TubeSection, section_of_sizes

INSIDE = [
    (RoundSection(3.0), lambda x, z: x**2 + z**2 <= 1.5**2),
    (TubeSection(8.0, 1.2), lambda x, z: (x**2 + z**2 <= 4.0**2) & (x**2 + z**2 >= 2.8**2)),
    (FlatSection(7.0, 0.5), lambda x, z: (abs(x) <= 3.5) & (abs(z) <= 0.25)),
]


@pytest.mark.parametrize(("section", "inside"), INSIDE, ids=lambda p: getattr(p, "description", ""))
def test_area_second_moment_and_depth_by_summing_them_up(section, inside):
    n = 4000
    x = ((np.arange(n) + 0.5) / n - 0.5)[:, None] * 10.0
    z = ((np.arange(n) + 0.5) / n - 0.5) * 2.0 * section.half_depth_mm * 1.0001
    there = inside(x, z)
    cell = (10.0 / n) * float(z[1] - z[0])
    assert section.area_mm2 == pytest.approx(float(there.sum()) * cell, rel=2e-3)
    assert section.second_moment_mm4 == pytest.approx(float((there * z**2).sum()) * cell, rel=2e-3)
    assert section.half_depth_mm == pytest.approx(float(abs(z[there.any(axis=0)]).max()), rel=1e-3)


def test_a_tube_is_a_rod_without_its_core_and_keeps_its_digits_when_thin():
    outer, inner = RoundSection(8.0), RoundSection(5.6)
    tube = TubeSection(8.0, 1.2)
    assert tube.second_moment_mm4 == pytest.approx(outer.second_moment_mm4 - inner.second_moment_mm4, rel=1e-14)
    assert tube.area_mm2 == pytest.approx(outer.area_mm2 - inner.area_mm2, rel=1e-14)
    wall = 2.0**-40
    thin = math.pi * 8.0**3 * wall / 8.0  # πd³t/8 and a relative term of 3·wall/d
    assert TubeSection(8.0, wall).second_moment_mm4 == pytest.approx(thin, rel=1e-11)


def test_only_round_ones_may_be_turned():
    assert RoundSection(3.0).is_round
    assert TubeSection(3.0, 0.5).is_round
    assert not FlatSection(3.0, 0.5).is_round


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: RoundSection(0.0), "a round section's diameter_mm = 0.0; allowed are finite numbers above 0"),
        (lambda: RoundSection("3"), "diameter_mm = '3'"),
        (lambda: TubeSection(3.0, math.nan), "a tube's wall_mm = nan"),
        (lambda: TubeSection(3.0, 1.5), "below half the diameter, 1.5; a solid rod has no wall_mm"),
        (lambda: FlatSection(math.inf, 1.0), "a flat strip's width_mm = inf"),
        (lambda: FlatSection(1.0, 2.0), "try width_mm = 2 and thickness_mm = 1"),
        (section_of_sizes, "got none of them"),
        (lambda: section_of_sizes(wall_mm=1.0), "got wall_mm;"),
        (lambda: section_of_sizes(width_mm=1.0), "got width_mm;"),
        (lambda: section_of_sizes(3.0, None, 2.0, 1.0), "got diameter_mm and width_mm and thickness_mm;"),
        (lambda: section_of_sizes(None, 0.1, 2.0, 1.0), "got wall_mm and width_mm and thickness_mm;"),
    ],
)
def test_what_is_no_section_is_refused_by_name(make, says):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert says in str(caught.value)
