"""The study of boundary value problems: its problems, its numbers against others, its parts and files."""

import csv
import dataclasses
import io as text_io

import numpy as np
import pytest

from batten.curves.elastica import Elastica
from batten.errors import InvalidInputError
from batten.io import boundary_study_files, study_parts
from batten.studies import boundary
from batten.studies.boundary import METHODS, random_elastica, run
from batten.studies.boundary_lines import PAPER_ENERGIES, PAPER_TABLE, lines, statistics


@pytest.fixture(scope="module")
def study():
    return run(12, seed=5)


def test_random_elastica_are_of_all_kinds():
    curves = [random_elastica(2, i) for i in range(300)]
    moduli = np.array([c.to_modulus().k for c in curves])
    assert 100 < (moduli < 1.0).sum() < 200
    counts = np.bincount([len(c.inflections()) for c in curves])
    assert np.all(counts[:3] > 20)
    assert len(counts) == 3  # one period has two inflections, exactly at most three
    turns = np.array([np.ptp(c.angle_at(np.linspace(0, 1, 200))) for c in curves]) / (2 * np.pi)
    assert turns.max() < 1.5
    assert turns.min() < 0.1
    assert (turns > 0.8).sum() > 10
    assert {c.length for c in curves} == {1.0}
    assert np.abs([c.start_angle for c in curves]).max() <= np.pi + 1e-12
    senses = np.sign([c.start_curvature for c in curves])
    assert 100 < (senses > 0).sum() < 200


def test_a_problem_is_the_same_whatever_the_size(study):
    assert np.array_equal(boundary.run_part(5, 7, 1, 8).l2[0], study.results.l2[7])
    assert not np.array_equal(random_elastica(6, 0).parameters, random_elastica(5, 0).parameters)


def test_a_seed_gives_the_same_numbers_but_for_the_run_times(study):
    again = run(12, seed=5)
    for field in dataclasses.fields(study.results):
        if field.name != "runtime":
            here, there = getattr(study.results, field.name), getattr(again.results, field.name)
            assert np.array_equal(here, there, equal_nan=here.dtype.kind == "f"), field.name
    assert np.array_equal(study.energies.energies, again.energies.energies)


def test_ours_holds_every_elastica_asked_for(study):
    results = study.results
    assert not results.missing.any()
    assert np.nanmax(results.l2[:, METHODS.index("ours, all")]) < 1e-9
    assert not results.another[:, METHODS.index("ours, all")].any()
    assert np.all(results.end_error[:, -2:] < 1e-9)


def test_the_methods_keep_what_they_build_in(study):
    results = study.results
    assert results.converged.all()
    assert np.all(results.length_error[:, :2] < 1e-12)  # Method 1 has the length
    assert np.all(results.end_error[:, 2:5] < 1e-12)  # Method 2 has the end
    assert np.all(results.end_error[:, :2] < 1e-11)


def test_a_method_that_found_the_elastica_is_near_it(study):
    """Medians as the paper's; what is far from the elastica asked for is near another one."""
    results = study.results
    assert np.array_equal(results.l2[~results.another], results.l2_nearest[~results.another])
    assert np.all(results.l2_nearest <= results.l2 + 1e-12)
    assert np.all(results.l2_nearest[:, [0, 1, 4]] < 0.02)
    median = statistics(results)["median"]
    paper = np.array(PAPER_TABLE["median"][3])
    assert np.all(median[3, :5] < 5.0 * paper)  # Table 2.1 is of other problems: no order of magnitude beside it


def test_distances_by_another_sum(study):
    number, method = 0, 4
    elastica = random_elastica(5, number)
    curve = boundary.answers(elastica)[0][method]
    t = (np.arange(20_000) + 0.5) / 20_000
    dense = curve.point(np.linspace(0, 1, 40_001))
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(dense, axis=0).T))])
    points = np.stack([np.interp(t * s[-1], s, dense[:, i]) for i in (0, 1)], axis=1)
    expected = np.sqrt(((points - elastica.point(t)) ** 2).sum(axis=1).mean())
    assert study.results.l2[number, method] == pytest.approx(expected, rel=1e-4, abs=1e-9)


def test_another_elastica_is_told_from_a_bad_curve(monkeypatch):
    """A method that answers with a different solution of the same problem: far from the one asked for, near that one."""
    elastica = next(
        e
        for e in (random_elastica(0, i) for i in range(200))
        if len(boundary.solve_boundary(*boundary.clamps_of(e))) > 1
    )
    row = boundary._problem(elastica)
    solutions = [s.elastica for s in boundary.solve_boundary(*boundary.clamps_of(elastica))]
    gaps = boundary._gaps(elastica, solutions)
    other = solutions[int(np.argmax(gaps.max(axis=1)))]
    assert row.solutions[0, 0] == len(solutions)
    original = boundary.answers

    def swapped(asked):
        curves, runtime, converged, ours = original(asked)
        return [other, *curves[1:]], runtime, converged, ours

    monkeypatch.setattr(boundary, "answers", swapped)
    row = boundary._problem(elastica)
    assert row.another[0, 0]
    assert row.l2[0, 0] > 1e-3
    assert row.l2_nearest[0, 0] < 1e-12


def test_energies_fall_as_in_table_b1(study):
    table = study.energies
    assert table.energies.shape == (10, 8)
    assert np.all(np.diff(table.energies, axis=1) <= 1e-9 * table.energies[:, :-1])
    same = ~table.another
    assert same.sum() >= 7
    assert table.energies[same, -1] == pytest.approx(table.exact[same], rel=1e-5)


def test_the_papers_tables_are_whole():
    assert np.array(PAPER_ENERGIES).shape == (10, 8)
    assert np.all(np.diff(np.array(PAPER_ENERGIES), axis=1) <= 0.0)
    assert {np.array(v).shape for v in PAPER_TABLE.values()} == {(5, 5)}


def test_lines_hold_the_numbers(study):
    text = lines(study)
    assert max(map(len, text)) <= 120
    average = text.index("average")
    assert float(text[average + 7].split()[2]) == pytest.approx(study.results.l2[:, 0].mean(), rel=5e-3)
    assert "1.88e-02" in text[average + 8]
    assert any("missing in 0 of 12" in line for line in text)


def test_bad_sizes_are_refused():
    for size, seed in ((0, 0), (2.5, 0), (1, -1)):
        with pytest.raises(InvalidInputError):
            run(size, seed)
    with pytest.raises(InvalidInputError):
        random_elastica(0, -1)


# --- files ---


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr(boundary, "PART", 2)
    monkeypatch.setattr(boundary, "_TABLE_B1_UPDATES", 1)


def test_a_run_that_was_stopped_goes_on_where_it_was(small_parts, tmp_path, monkeypatch):
    whole = run(5, seed=1)
    done = []
    original = boundary_study_files.run_part

    def counted(seed, first, count, size, progress=None):
        if first == 4 and not done.count(4):
            done.append(4)
            raise KeyboardInterrupt
        done.append(first)
        return original(seed, first, count, size, progress)

    monkeypatch.setattr(boundary_study_files, "run_part", counted)
    with pytest.raises(KeyboardInterrupt):
        boundary_study_files.run_in(tmp_path, 5, seed=1)
    assert sorted(p.name for p in (tmp_path / "parts").iterdir()) == [
        "seed-1-problems-0-to-1.npz",
        "seed-1-problems-2-to-3.npz",
    ]
    calls = []
    study = boundary_study_files.run_in(tmp_path, 5, seed=1, progress=lambda *c: calls.append(c))
    assert done == [0, 2, 4, 4]
    assert ("boundary value problems", 2, 5) in calls
    assert ("boundary value problems", 5, 5) in calls
    assert np.array_equal(study.results.l2, whole.results.l2)
    before = study.results.runtime
    again = boundary_study_files.run_in(tmp_path, 5, seed=1)
    assert done == [0, 2, 4, 4]
    assert np.array_equal(again.results.runtime, before)


def test_broken_and_foreign_parts_are_done_again(small_parts, tmp_path, monkeypatch):
    study = boundary_study_files.run_in(tmp_path, 2, seed=1)
    path = tmp_path / "parts" / "seed-1-problems-0-to-1.npz"
    path.write_bytes(path.read_bytes()[:200])
    assert np.array_equal(boundary_study_files.run_in(tmp_path, 2, seed=1).results.l2, study.results.l2)
    runtime = boundary_study_files.run_in(tmp_path, 2, seed=1).results.runtime
    monkeypatch.setattr(study_parts.batten, "__version__", "another")
    assert not np.array_equal(boundary_study_files.run_in(tmp_path, 2, seed=1).results.runtime, runtime)


def test_files_of_a_study(study, tmp_path):
    paths = boundary_study_files.write(study, tmp_path / "deep" / "er")
    assert sorted(p.name for p in (tmp_path / "deep" / "er").iterdir()) == sorted(p.name for p in paths)
    folder = tmp_path / "deep" / "er"
    assert (folder / "study.txt").read_text("utf-8").splitlines() == lines(study)
    rows = list(csv.DictReader(text_io.StringIO((folder / "problems.csv").read_text("utf-8"))))
    assert len(rows) == 12 * len(METHODS)
    assert float(rows[3]["l2"]) == study.results.l2[0, 3]
    asked = ("start_x", "start_y", "start_angle", "start_curvature", "force_x", "force_y", "length")
    assert Elastica.from_parameters([float(rows[-1][name]) for name in asked]) == random_elastica(5, 11)
    table = list(csv.reader(text_io.StringIO((folder / "table-2.1.csv").read_text("utf-8"))))
    assert table[0][3:] == list(METHODS)
    assert table[2] == ["average", "2nd end point", "paper", "0.000527", "0.000494", "0.0", "0.0", "0.0"]
    energies = list(csv.reader(text_io.StringIO((folder / "table-b1.csv").read_text("utf-8"))))
    assert len(energies) == 21
    assert (folder / "figure-2.13.png").read_bytes().startswith(b"\x89PNG")
    assert boundary_study_files.write(study, folder) == paths
