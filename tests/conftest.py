"""Fixtures for all tests."""

import importlib.util
import sys
from pathlib import Path

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
