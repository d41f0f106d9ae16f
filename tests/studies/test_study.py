"""The frame of all sampled studies: same results for any number of workers, held once, stopped cleanly; refusals."""

import dataclasses
import sys
import threading
import time

import numpy as np
import pytest

from batten.errors import InvalidInputError
from batten.studies.study import Outcome, PartsJoined, Study, rows_of, run, run_parts


@dataclasses.dataclass(frozen=True, eq=False)
class Numbers:
    """A random number and a pair of small ones for each curve."""

    value: np.ndarray
    pair: np.ndarray


def numbers(seed, part, count):
    rng = np.random.default_rng([seed, part])
    return Numbers(rng.random(count), rng.random((count, 2)).astype(np.float32))


def numbers_late_first(seed, part, count):
    """The earlier the part the later it is done."""
    time.sleep(0.02 * max(0, 4 - part))
    return numbers(seed, part, count)


def study_of(run_part, part_size=7):
    return Study("numbers", part_size, Numbers, run_part, lambda o: [str(o.size)], lambda part: {"value": part.value})


@pytest.mark.parametrize("workers", [1, 4, None])
def test_the_number_and_the_order_of_workers_do_not_matter(workers):
    outcome = run(study_of(numbers_late_first), 40, seed=3, workers=workers)
    expected = [numbers(3, i, count) for i, count in enumerate([7, 7, 7, 7, 7, 5])]
    assert np.array_equal(outcome.results.value, np.concatenate([p.value for p in expected]))
    assert np.array_equal(outcome.results.pair, np.concatenate([p.pair for p in expected]))
    assert outcome.results.pair.dtype == np.float32
    assert not np.array_equal(outcome.results.value, run(study_of(numbers), 40, seed=4).results.value)


def test_a_larger_study_begins_with_the_whole_parts_of_a_smaller_one():
    small, large = (run(study_of(numbers), size, seed=1).results.value for size in (21, 50))
    assert np.array_equal(small, large[:21])


def test_parts_are_views_of_the_results():
    outcome = run(study_of(numbers), 16)
    parts = list(outcome.parts())
    assert [len(p.value) for p in parts] == [7, 7, 2]
    assert all(np.shares_memory(p.pair, outcome.results.pair) for p in parts)
    assert np.array_equal(parts[2].value, rows_of(outcome.results, slice(14, 16)).value)
    assert outcome.study.lines(outcome) == ["16"]


def test_progress_counts_curves_up_to_the_size():
    told = []
    run(study_of(numbers), 16, progress=lambda *words: told.append(words), workers=1)
    assert told == [("numbers", 7, 16), ("numbers", 14, 16), ("numbers", 16, 16)]


def test_few_parts_are_ahead_of_the_one_that_is_taken():
    began = []

    def counted(seed, part, count):
        began.append(part)
        return numbers(seed, part, count)

    study = study_of(counted)
    parts = run_parts(study, 0, study.parts_of(700), workers=2)
    next(parts)
    time.sleep(0.1)
    assert len(began) <= 5  # four handed out, one more in place of the first
    parts.close()
    assert len(began) < 10


def test_an_error_in_a_part_ends_the_run_and_its_threads():
    def broken(seed, part, count):
        if part == 3:
            raise ZeroDivisionError("part 3")
        return numbers(seed, part, count)

    with pytest.raises(ZeroDivisionError, match="part 3"):
        run(study_of(broken), 700, workers=2)
    assert not [t for t in threading.enumerate() if t.name.startswith("batten-numbers")]


def test_parts_of_another_shape_or_type_are_refused():
    study = study_of(numbers)
    joined = PartsJoined(study, 14)
    joined.put(1, numbers(0, 1, 7))
    with pytest.raises(InvalidInputError, match=r"part 0 .* value of shape \(6,\)"):
        joined.put(0, numbers(0, 0, 6))
    whole = numbers(0, 0, 7)
    with pytest.raises(InvalidInputError, match="float64"):
        joined.put(0, Numbers(whole.value, whole.pair.astype(np.float64)))
    joined.put(0, whole)
    assert joined.done == 14


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"size": 0}, "size ≥ 1"),
        ({"size": 3.0}, "whole numbers"),
        ({"size": 3, "seed": -1}, "seed ≥ 0"),
        ({"size": 3, "workers": 0}, "workers"),
        ({"size": 3, "workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "workers or a scheduler"),
    ],
)
def test_bad_input_is_refused_in_words(options, words):
    with pytest.raises(InvalidInputError, match=words):
        run(study_of(numbers), **options)


def test_without_the_package_distributed_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InvalidInputError, match='extra "dist"'):
        run(study_of(numbers), 3, scheduler="tcp://127.0.0.1:1")


def test_an_outcome_is_plain_data():
    outcome = Outcome(study_of(numbers), 1, 0, numbers(0, 0, 1))
    with pytest.raises(dataclasses.FrozenInstanceError):
        outcome.size = 2
