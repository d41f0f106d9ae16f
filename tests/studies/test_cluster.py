"""A study on a scheduler with worker processes on loopback: the same result, also when one of them is killed."""

import dataclasses
import logging
import os
import signal
import socket
import subprocess
import sys
import time
import types

import numpy as np
import pytest

from batten.cli.main import main
from batten.errors import InvalidInputError
from batten.studies import cluster
from batten.studies.projection import STUDY, ProjectionPart
from batten.studies.study import run

distributed = pytest.importorskip("distributed")


def _started(module, *words):
    # Loopback only, and no more than one thread for each process.
    environment = os.environ | {"OMP_NUM_THREADS": "1", "DASK_DISTRIBUTED__ADMIN__TICK__LIMIT": "1h"}
    command = [sys.executable, "-m", f"distributed.cli.{module}", *words]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


@pytest.fixture(scope="module")
def scheduler():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = _started("dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    yield f"tcp://127.0.0.1:{port}"
    process.kill()
    process.wait()


@pytest.fixture(scope="module")
def pool():
    """Worker processes of this module, alive or not."""
    processes = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def workers(scheduler, pool, kernels_compiled):
    """Two worker processes that have joined, those of the test before where they live."""
    pool[:] = [process for process in pool if process.poll() is None]
    words = ("--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--death-timeout", "60")
    pool += [_started("dask_worker", scheduler, *words) for _ in range(2 - len(pool))]
    with distributed.Client(scheduler, timeout=60, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    return pool


def same(one, other):
    names = [f.name for f in dataclasses.fields(ProjectionPart)]
    return all(np.array_equal(getattr(one, n), other[n], equal_nan=True) for n in names)


def alone(path, part_size, size, seed):
    """The results in one process of its own, on one thread."""
    code = f"""
import dataclasses, numpy
from batten.studies.projection import STUDY
from batten.studies.study import run
results = run(dataclasses.replace(STUDY, part_size={part_size}), {size}, seed={seed}, workers=1).results
numpy.savez({str(path)!r}, **{{f.name: getattr(results, f.name) for f in dataclasses.fields(results)}})
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    return np.load(path)


def test_the_command_on_a_cluster_prints_the_same(scheduler, workers, tmp_path, capsys):
    words = ["study", "projection", "--size", "11000", "--seed", "2"]
    assert main([*words, "--scheduler", scheduler, "-o", str(tmp_path)]) == 0
    there = capsys.readouterr().out
    assert main(words) == 0
    assert capsys.readouterr().out == there
    assert len(list((tmp_path / "parts").iterdir())) == 2


def test_an_error_of_a_part_comes_back(scheduler, workers):
    study = dataclasses.replace(STUDY, run_part=os.strerror)  # takes one argument, not three
    with pytest.raises(TypeError, match="argument"):
        run(study, 10, scheduler=scheduler)


def test_another_version_on_the_workers_is_refused(scheduler, workers, monkeypatch):
    monkeypatch.setattr("batten.__version__", "0.0.0")
    with pytest.raises(InvalidInputError, match=r"a worker of the cluster runs batten .*, this is 0\.0\.0"):
        run(STUDY, 10, scheduler=scheduler)


def test_one_of_two_workers_is_killed_in_the_middle(scheduler, workers, monkeypatch, tmp_path):
    study, size = dataclasses.replace(STUDY, part_size=200), 20_000
    told, tasks, submit = [], [], distributed.Client.submit

    def killing(name, done, total):
        told.append(done)
        if len(told) == 10:
            workers[0].send_signal(signal.SIGKILL)

    monkeypatch.setattr(distributed.Client, "submit", lambda *a, **k: tasks.append(len(a[4])) or submit(*a, **k))
    outcome = run(study, size, seed=5, progress=killing, scheduler=scheduler)
    assert workers[0].wait(timeout=10) == -signal.SIGKILL
    assert workers[1].poll() is None
    assert told[-1] == size
    assert told[9] < size // 2
    assert same(outcome.results, alone(tmp_path / "alone.npz", 200, size, 5))
    assert sum(tasks) == 100  # each part handed out once by us; the scheduler sees to the lost ones
    assert max(tasks) > 1  # short parts go out in bundles


def test_a_scheduler_without_workers_is_told(scheduler, pool, monkeypatch):
    for process in pool:
        process.kill()
    monkeypatch.setattr(cluster, "_WORKERS_S", 0.3)
    with distributed.Client(scheduler, timeout=60, set_as_default=False) as client:
        for _ in range(100):
            if not client.nthreads():
                break
            time.sleep(0.1)
    with pytest.raises(InvalidInputError, match="no worker"):
        run(STUDY, 10, scheduler=scheduler)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", "tcp://"])
def test_no_scheduler_there(address, monkeypatch, capsys):
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    levels = [logging.getLogger(f"distributed.{name}").level for name in ("client", "comm", "utils")]
    assert main(["study", "projection", "--size", "10", "--scheduler", address]) == 2
    assert "no scheduler answers" in capsys.readouterr().err
    assert [logging.getLogger(f"distributed.{name}").level for name in ("client", "comm", "utils")] == levels


@pytest.mark.parametrize(
    ("status", "result", "words"),
    [
        ("cancelled", None, "the scheduler ended"),
        ("error", (ModuleNotFoundError, ModuleNotFoundError("No module named 'batten'"), None), "cannot load batten"),
        (
            "error",
            (None, distributed.KilledWorker("task", types.SimpleNamespace(address="tcp://w"), 3), None),
            "several workers of the cluster died",
        ),
    ],
)
def test_what_a_failed_task_says(status, result, words):
    error = cluster._failure(distributed, types.SimpleNamespace(status=status), result)
    assert isinstance(error, InvalidInputError)
    assert words in str(error)
