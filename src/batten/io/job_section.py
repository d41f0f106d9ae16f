"""What all sections of a job file share: how strictly values are taken, and the types of several fields."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

# TOML knows lists only, so a fixed number of values must be allowed to come as one; the values themselves stay strict.
Length = Annotated[float, Field(gt=0.0, le=10000.0)]
Angle = Annotated[float, Field(ge=-720.0, le=720.0)]
Pair = Annotated[tuple[Length, Length], Field(strict=False)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
SixAngles = Annotated[tuple[Angle, ...], Field(strict=False, min_length=6, max_length=6)]
SixLengths = Annotated[
    tuple[Annotated[float, Field(ge=0.0, le=10000.0)], ...], Field(strict=False, min_length=6, max_length=6)
]
SixSigns = Annotated[tuple[Literal[-1, 1], ...], Field(strict=False, min_length=6, max_length=6)]


class Section(BaseModel):
    """What every part of a job file shares: no unknown fields, no NaN, no text where a number belongs."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)
