"""The sample of the annuli: how it is drawn, its types, and Tables 3.1 and 3.2 of Fisker2018 within sampling error."""

import numpy as np
import pytest

from batten.cli.main import main
from batten.curves.bezier import CubicBezier
from batten.measures.distance import h1_distance, l2_distance
from batten.solvers.bezier_criteria import bezier_criteria
from batten.solvers.curve_samples import samples_of
from batten.solvers.elastica_fit import fit_elastica, fit_samples
from batten.studies import annulus
from batten.studies.annulus import (
    B1_BETWEEN,
    B2_FIRST,
    PAPER,
    PAPER_ERRORS,
    STUDY,
    TYPES,
    AnnulusPart,
    edge_angles,
    least_distances,
    lines,
    paper_row,
    random_inner_points,
    rows_of_tables,
    standard_position,
    types_of,
)
from batten.studies.study import run


@pytest.fixture(scope="module")
def outcome():
    return run(STUDY, 300, seed=11)


def made_up(inner, l2):
    """Results with distances as given."""
    some = np.zeros(len(inner))
    control = standard_position(inner)
    return AnnulusPart(inner, types_of(inner), bezier_criteria(control).simple, some, some, l2, l2, some > 0)


def test_points_are_uniform_by_area_in_their_annuli():
    inner = random_inner_points(40_000, 1, 0)
    first, second = inner[:, 0], inner[:, 1] - [1.0, 0.0]
    assert (second[:, 1] >= 0.0).all()
    limit = 1.95 / np.sqrt(40_000)  # of Kolmogorov and Smirnov, 1 in 1000
    for points, turn in ((first, 2.0 * np.pi), (second, np.pi)):
        square = (points**2).sum(axis=1)
        assert square.min() >= 0.0625 - 1e-12
        assert square.max() <= 2.25 + 1e-12
        angle = np.arctan2(points[:, 1], points[:, 0]) % (2.0 * np.pi)
        for uniform in ((square - 0.0625) / 2.1875, angle / turn):
            assert np.abs(np.sort(uniform) - np.arange(0.5, 40_000) / 40_000).max() < limit
    assert abs(np.corrcoef(first[:, 0], second[:, 0])[0, 1]) < 4.0 / np.sqrt(40_000)


@pytest.mark.parametrize(
    ("first", "second", "name"),
    [
        ((0.5, -0.5), (0.5, 0.5), "A1"),
        ((0.3, 0.5), (0.7, 0.5), "A2"),
        ((-0.5, 0.5), (1.5, 0.5), "B1"),
        ((-0.5, 0.5), (0.5, 0.5), "B2"),
        ((0.5, 0.5), (1.5, 0.5), "B2"),
        ((0.5, -0.5), (1.5, 0.5), "C1"),
        ((-0.5, -0.5), (0.5, 0.5), "C1"),
        ((-0.5, -0.5), (1.5, 0.5), "C2"),
    ],
)
def test_types_also_of_mirror_images_and_reversed(first, second, name):
    inner = np.array([first, second])
    backwards = np.array([1.0, 0.0]) + inner[::-1] * [-1.0, 1.0]
    for points in (inner, inner * [1.0, -1.0], backwards):
        assert TYPES[types_of(points)] == name


def test_the_types_that_the_counts_rest_on_never_meet_themselves():
    inner = random_inner_points(20_000, 2, 0)
    simple, kind = bezier_criteria(standard_position(inner)).simple, types_of(inner)
    share = [simple[kind == i].mean() for i in range(6)]
    assert [TYPES[i] for i in range(6) if share[i] == 1.0] == ["A1", "B1", "C1", "C2"]
    assert share[1] == pytest.approx(0.495, abs=0.04)
    assert share[3] == pytest.approx(0.921, abs=0.02)


def test_the_papers_counts_are_those_of_all_pairs_of_400_and_200_points():
    out_up, out_down, in_down, in_up, out, inwards = 91, 98, 101, 110, 95, 105
    assert (out_up + out_down + in_down + in_up, out + inwards) == (400, 200)
    counts = {name: sum(PAPER[name][0]) for name in TYPES}
    assert counts["B1"] == out_up * out
    assert counts["C2"] == out_down * out
    assert counts["C1"] == out_down * inwards + in_down * out
    assert counts["A1"] == in_down * inwards
    assert counts["A2"] <= in_up * inwards
    assert counts["B2"] <= in_up * out + out_up * inwards
    assert sum(counts.values()) == sum(PAPER["all"][0]) == 73_036


def test_standard_errors_of_such_samples():
    """Shares of 24 samples of all pairs spread as the jackknife says; shares need no distances."""
    shares = []
    for part in range(24):
        inner = random_inner_points(400, 5, part)
        pairs = np.stack([np.repeat(inner[:, 0], 200, axis=0), np.tile(inner[:200, 1], (400, 1))], axis=1)
        rows = rows_of_tables(made_up(pairs, np.zeros(80_000)))
        shares.append([rows[name].figures[0] for name in PAPER])
    spread = np.std(shares, axis=0, ddof=1)
    ratio = spread / [PAPER_ERRORS[name][0] for name in PAPER]
    assert (ratio > 0.6).all()
    assert (ratio < 1.6).all()


def test_shares_are_the_papers_within_sampling_error():
    inner = random_inner_points(100_000, 6, 0)
    rows = rows_of_tables(made_up(inner, np.zeros(len(inner))))
    for name, row in rows.items():
        paper = paper_row(name)
        assert abs(row.figures[0] - paper.figures[0]) < 3.0 * np.hypot(row.errors[0], paper.errors[0]), name


def test_good_curves_are_as_many_as_in_the_paper(outcome):
    rows = rows_of_tables(outcome.results)
    for name in (*TYPES, "all", B2_FIRST):
        ours, paper = rows[name], paper_row(name)
        assert abs(ours.figures[5] - paper.figures[5]) < 3.5 * np.hypot(ours.errors[5], paper.errors[5]), name
    assert rows["all"].maximum < 0.06  # 0.11 in the paper


def test_one_initial_guess_alone_stays_far_away_as_in_the_paper():
    """39 % of B1 beyond 0.02, here 10 %: what the module says of the paper's local minima."""
    inner = random_inner_points(4000, 12, 0)
    inner = inner[types_of(inner) == TYPES.index("B1")][:200]
    samples = samples_of(standard_position(inner))[0]
    alone, best = (rows_of_tables(made_up(inner, fit_samples(samples, starts=n).distance))["B1"] for n in (1, 4))
    paper = paper_row("B1")
    assert (np.abs(alone.figures - paper.figures)[1:6] < 3.0 * np.hypot(alone.errors, paper.errors)[1:6]).all()
    assert best.figures[4] < 0.2


def test_distances_are_those_of_the_nearest_elastica_found(outcome):
    control = standard_position(outcome.results.inner)
    chosen = np.flatnonzero(outcome.results.residual < 0.6)[:6]
    for i in chosen:
        curve = CubicBezier(control[i])
        for metric, distance, stored in (
            ("L2", l2_distance, outcome.results.l2),
            ("H1", h1_distance, outcome.results.h1),
        ):
            fit = fit_elastica(curve, metric, starts=13)
            assert stored[i] == pytest.approx(distance(curve, fit.elastica), rel=1e-4, abs=1e-7)
    assert (outcome.results.l2 <= outcome.results.h1 + 1e-12).all()


def test_the_second_round_never_makes_it_worse():
    samples = samples_of(standard_position(random_inner_points(40, 3, 0)))[0]
    l2, h1 = least_distances(samples)
    assert (l2 <= fit_samples(samples).distance).all()
    assert (h1 <= fit_samples(samples, metric="H1").distance).all()


def test_rows_hold_what_they_say():
    inner = np.array(
        [[(-0.1, 0.5), (1.1, 0.5)], [(-0.5, 0.1), (1.1, 0.5)], [(0.3, 0.5), (1.1, 0.5)], [(0.5, 0.1), (1.1, 0.5)]]
    )
    rows = rows_of_tables(made_up(inner, np.array([0.001, 0.005, 0.015, 0.03])))
    assert rows["B1"].curves == 2
    assert rows["B1"].figures[1:6].tolist() == [0.5, 0.5, 0.0, 0.0, 1.0]
    assert rows[B1_BETWEEN].curves == 1
    assert rows[B2_FIRST].figures[1:5].tolist() == [0.0, 0.0, 1.0, 0.0]  # α₁ is that of the edge that points inwards
    assert rows["all"].maximum == 0.03
    assert rows["C1"].curves == 0
    assert edge_angles(inner[0]) == pytest.approx(np.arctan([0.2, 0.2]))


def test_lines_show_the_papers_numbers_and_mark_what_differs(outcome):
    text = "\n".join(lines(outcome))
    for counts, _, maximum in PAPER.values():
        assert f"{sum(counts):,}" in text
        assert f"{maximum:.3f}" in text
    b1 = lines(outcome).index(next(line for line in lines(outcome) if line.startswith("B1 ")))
    assert "39.0%*" in lines(outcome)[b1 + 1]
    assert "36.8%*" not in lines(outcome)[b1 + 1]
    assert "nan" not in text


def test_few_curves_make_a_study(capsys):
    assert main(["study", "annulus", "--size", "1"]) == 0
    printed = capsys.readouterr().out
    assert "nan" not in printed
    assert printed.rstrip("\n").splitlines() == lines(run(STUDY, 1))


def test_columns_name_the_type(outcome):
    table = annulus.columns(outcome.results)
    assert table["type"].tolist() == [TYPES[i] for i in outcome.results.type]
    assert np.array_equal(table["p2_y"], outcome.results.inner[:, 1, 1])
    assert len({len(column) for column in table.values()}) == 1
