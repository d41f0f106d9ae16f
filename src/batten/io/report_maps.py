"""Maps of the wall, blocks × leaves, as small PNG pictures, and the report's ramp of colours. Needs numpy alone."""

from __future__ import annotations

import base64
import math
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from batten.fabrication.plan import CheckResult, CutPlan
from batten.io.report_numbers import WallOrder, use_of_limit
from batten.typing import FloatArray

RAMP = ((0xDC, 0xEA, 0xF5), (0x7F, 0xB2, 0xDA), (0x2C, 0x6F, 0xA8), (0x0B, 0x33, 0x5E))
"""From nothing of the limit used to all of it: one hue, light to dark, so that it is read in grey print as well."""
BROKEN = (0xD2, 0x4A, 0x12)
ABSENT = (0xEC, 0xEC, 0xE8)


def ramp_colours(use: FloatArray) -> NDArray[np.uint8]:
    """Colours (…, 3) of 0 … 255 for shares (…) of a limit: the ramp up to 1, one colour beyond, another for NaN."""
    known = np.nan_to_num(np.clip(use, 0.0, 1.0))
    stops = np.linspace(0.0, 1.0, len(RAMP))
    colours = np.stack([np.interp(known, stops, [c[i] for c in RAMP]) for i in range(3)], axis=-1)
    colours[use > 1.0] = BROKEN
    colours[np.isnan(use)] = ABSENT
    return np.rint(colours).astype(np.uint8)


def check_map(plan: CutPlan, order: WallOrder, check: CheckResult) -> str:
    """One check over the wall in plan, x to the right and y up, as the address of an embedded PNG."""
    cell_across = max(2, min(12, 320 // max(order.leaves, 1)))
    cell_along = max(12, 320 // max(order.width, 1))
    picture = np.full((order.leaves, order.width, 3), 255, dtype=np.uint8)
    if math.isfinite(check.limit):
        use = use_of_limit(check)
    else:  # no limit: relative to the greatest value
        size = np.abs(check.values)
        use = size / max(float(np.nanmax(size, initial=0.0)), 1e-300)
    picture[order.ranks, order.columns] = ramp_colours(use)
    large = picture.repeat(cell_across, axis=0).repeat(cell_along, axis=1)
    for border in range(1, order.width):  # a white line between blocks
        large[:, border * cell_along - 1 : border * cell_along + 1] = 255
    upright = large[::-1] if plan.blade_axis == "x" else large.transpose(1, 0, 2)[::-1]
    return png_address(upright)


def png_address(pixels: NDArray[np.uint8]) -> str:
    """A picture (height, width, 3) of 0 … 255 as `data:image/png;base64,…`; the same pixels give the same text."""
    rows = np.ascontiguousarray(pixels)
    height, width, _ = rows.shape
    raw = np.concatenate([np.zeros((height, 1), np.uint8), rows.reshape(height, -1)], axis=1).tobytes()
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(raw, 6)), (b"IEND", b""))
    data = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks
    )
    return "data:image/png;base64," + base64.b64encode(data).decode("ascii")
