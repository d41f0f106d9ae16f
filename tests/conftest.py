"""Fixtures for all tests."""

import contextlib
import importlib.util
import io
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest


def load(path: str):
    """A module of the tests' own, by its path under tests/."""
    name = Path(path).stem
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parent / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up there
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def rapid_reader():
    """The module tests/io/rapid_reader.py: read_module(text), rods(left, right), RapidError."""
    return load("io/rapid_reader.py")


@pytest.fixture(scope="session")
def make_plan():
    """A function that makes up a plan and its job: make_plan(rows, columns, leaves a row, refused leaves, …)."""
    return load("io/made_up_plan.py").build_plan


@pytest.fixture(scope="session")
def made_surfaces():
    """The module tests/surfaces/made_surfaces.py: graph(f, …), patch(surface, …), cylinder(…), example_wall() …"""
    return load("surfaces/made_surfaces.py")


@pytest.fixture(scope="session")
def real_cut(tmp_path_factory):
    """`batten cut` of the example's own job, run once for all tests and all their processes: status, summary, out."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "real-cut"
    done = folder / "done.json"
    try:
        folder.mkdir()
    except FileExistsError:  # another process is at it
        for _ in range(1200):
            if done.exists():
                break
            time.sleep(0.1)
    else:
        from batten.cli.main import main

        job = Path(__file__).parents[1] / "examples/freeform-wall/wall.toml"
        said = io.StringIO()
        result = ["never ended", ""]
        try:
            with contextlib.redirect_stdout(said):
                status = main(["cut", str(job), "-o", str(folder / "out"), "--json", "--no-pictures"])
            result = [status, said.getvalue()]
        finally:
            (folder / "part.json").write_text(json.dumps(result), encoding="utf-8")
            (folder / "part.json").replace(done)
    status, text = json.loads(done.read_text(encoding="utf-8"))
    assert text, f"the run gave status {status} and no summary"
    return SimpleNamespace(status=status, summary=json.loads(text), out=folder / "out")


@pytest.fixture(scope="session")
def kernels_compiled():
    """The kernels of the study of projections lie compiled on the disk.

    A process that compiles them itself adds some sums in another order than those that load them: numbers agree to
    rounding, not bit by bit.
    """
    code = "from batten.studies.projection import STUDY; STUDY.run_part(0, 0, 300)"
    subprocess.run([sys.executable, "-c", code], check=True)
