"""A curve as the writers of drawings take it: an elastica, whether it is stable, and what is said about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from batten.curves.elastica import Elastica

Unit: TypeAlias = Literal["mm"] | None
"""The unit of a drawing's coordinates; None where none is known."""

LAYERS = ("stable", "unstable")
"""The two layers of a drawing."""

PALETTE = (
    (31, 95, 168),
    (214, 98, 20),
    (38, 132, 82),
    (128, 72, 160),
    (186, 44, 52),
    (20, 140, 150),
    (148, 104, 36),
    (196, 72, 136),
)
"""Colours of curves, red, green, blue; the ninth curve has the first again."""


@dataclass(frozen=True)
class DrawnCurve:
    """One curve of a drawing.

    Attributes:
        number: from 1, as it is called in tables and pictures.
        elastica: the curve.
        stable: whether it is drawn full and lies on the layer "stable", or dashed and on "unstable".
        texts: what else is known of it, by name; shown as user text or as a title.

    Example:
        >>> curve = DrawnCurve(2, Elastica((0, 0), 0.0, 1.0, (0, 0), 3.0), False, {"energy": "3"})
        >>> curve.name, curve.layer, curve.title
        ('curve 2', 'unstable', 'curve 2: energy = 3')
    """

    number: int
    elastica: Elastica
    stable: bool
    texts: Mapping[str, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """ "curve 2"."""
        return f"curve {self.number}"

    @property
    def layer(self) -> str:
        """ "stable" or "unstable"."""
        return LAYERS[0] if self.stable else LAYERS[1]

    @property
    def colour(self) -> tuple[int, int, int]:
        """Red, green, blue, 0 … 255, by its number."""
        return PALETTE[(self.number - 1) % len(PALETTE)]

    @property
    def title(self) -> str:
        """Its name and its texts in one line."""
        return self.name + (": " if self.texts else "") + ", ".join(f"{k} = {v}" for k, v in self.texts.items())
