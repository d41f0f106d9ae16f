"""What is said of a simulation: verdicts, remarks, and its place in the cut's report."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from batten.errors import FormatError
from batten.fabrication.plan import Block
from batten.fabrication.swept_surface import Distances
from batten.io.simulation_page import files_section, remarks, report_section, simulation_page, verdict, with_simulation


def made_up(worst=(0.4, 0.9), limit=1.0, absent=(), unknown=0, plane_mm=0.01, twist=0.0, choices=1):
    d = Distances(100, 0.9, 0.25, (0.2, 0.5, 0.7))
    blocks = tuple(
        SimpleNamespace(
            block=Block(n, 0, n - 1, np.zeros(3), np.ones(3)),
            worst_mm=w,
            worst=(w, np.zeros(3), "between leaf 3 and leaf <4>"),
            unknown=unknown if n == 2 else 0,
            face=d, at_leaves=d, between_leaves=d, design=d,
            sweep=SimpleNamespace(
                out_of_plane_rad=np.array([0.0, 0.01]), out_of_plane_mm=np.array([0.0, plane_mm if n == 2 else 0.0]),
                twist_rad=np.array([0.0, twist]), choices=choices if n == 1 else 1, move=np.zeros(7),
                margin=np.array([2.0, 1.5]),
            ),
        )
        for n, w in enumerate(worst, start=1)
    )  # fmt: skip
    failing = tuple(sorted({b.block.number for b in blocks if b.worst_mm > limit or b.unknown} | set(absent)))
    return SimpleNamespace(
        blocks=blocks, failing=failing, without_program=absent, is_good=not failing, limit_mm=limit, tolerance_mm=0.95,
        half_kerf=True, face=d, at_leaves=d, between_leaves=d, design=d,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({}, "every point of the simulated face lies within 1 mm of the design, the farthest 0.900 mm"),
        ({"worst": (1.2, 3.0)}, "blocks 1, 2 have points farther than 1 mm from the design, the farthest 3.00 mm"),
        ({"worst": (0.2, 3.0)}, "block 2 has points farther than 1 mm"),
        ({"absent": (5,)}, "block 5 has no robot program"),
        ({"unknown": 3}, "block 2 has points at which the kerf is not known"),
    ],
)
def test_the_verdict_says_what_is_wrong(changed, sentence):
    assert sentence in verdict(made_up(**changed))


def test_remarks_are_made_where_they_matter():
    assert remarks(made_up()) == []
    assert "0.573° out of one plane (block 2)" in remarks(made_up(plane_mm=0.2))[0]
    assert "by up to 30.0°" in remarks(made_up(twist=math.pi / 6.0))[0]
    assert "(block 1)" in remarks(made_up(choices=2))[0]
    assert "At 3 points" in remarks(made_up(unknown=3))[0]


def test_the_report_is_given_its_section_and_again():
    empty = report_section(None)
    page = f"<html><body>{empty}<section><h2>Other</h2></section>{files_section({'a.txt': '00' * 32})}</body></html>"
    once = with_simulation(page, made_up(), b"first", {"b.txt": "11" * 32})
    assert "Not simulated yet" not in once
    assert "the farthest 0.900 mm" in once
    assert "b.txt" in once
    assert "a.txt" not in once
    assert "<section><h2>Other</h2></section>" in once
    twice = with_simulation(once, made_up(worst=(0.2, 3.0)), b"second", {"b.txt": "11" * 32})
    assert "the farthest 3.00 mm" in twice
    assert "0.900 mm. More" not in twice
    with pytest.raises(FormatError, match="has 0 of"):
        with_simulation("<html></html>", made_up(), b"", {})


def test_texts_are_escaped():
    page = simulation_page(made_up(absent=(7,)), (b"x", b"y"), cut="a <b> & c")
    assert "a &lt;b&gt; &amp; c" in page
    assert "leaf &lt;4&gt;" in page
    assert "✗ Beyond" in page
    assert "no program" in page
