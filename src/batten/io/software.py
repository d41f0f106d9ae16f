"""Which batten this is, as files and reports state it."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def software_name() -> str:
    """ "batten" and its version."""
    try:
        return f"batten {version('batten')}"
    except PackageNotFoundError:  # run from a source folder that was never installed
        return "batten (not installed)"
