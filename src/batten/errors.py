"""The errors that batten raises. A message says what was received, what is allowed, and what to try."""

from __future__ import annotations

from typing import Any


class BattenError(Exception):
    """Root of every error that batten raises on purpose."""


class InvalidInputError(BattenError, ValueError):
    """An argument lies outside its documented domain."""


class NoSolutionError(BattenError):
    """The problem as posed has no solution."""


class ConvergenceError(BattenError):
    """An iteration ended without meeting its tolerance.

    Attributes:
        best: the best iterate found, of the type that the caller would have received.
        residual: its residual.
        iterations: how many iterations were spent.
    """

    def __init__(self, message: str, *, best: Any = None, residual: float = float("nan"), iterations: int = 0) -> None:
        super().__init__(message)
        self.best = best
        self.residual = residual
        self.iterations = iterations


class LimitError(BattenError):
    """A fabrication limit is broken: which leaf, which limit, by how much."""


class FormatError(BattenError):
    """A file cannot be understood: the message names the file and the line or field."""
