"""Prints how far Elastica is from elastica_table.json, kind by kind, in units of 2^-53 × length.

Run from anywhere:  python tests/reference/report_elastica_errors.py

`error` counts the position's error as it is; `beyond` divides by the larger of length × 2^-53 and the sensitivity of
the curve to one unit in the last place of its numbers, so that 8 is what the contract allows where the curve is sensitive.
`jacobian` is the worst error of a column relative to its size, or to 1e9 × its one-ulp sensitivity if that is more.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from pathlib import Path

import numpy as np

from batten.curves.elastica import Elastica

TABLE = Path(__file__).with_name("elastica_table.json")


def main() -> None:
    groups: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for case in json.loads(TABLE.read_text(encoding="utf-8"))["cases"]:
        x, y, angle, curvature, force_x, force_y, length = (float.fromhex(v) for v in case["input"])
        curve = Elastica((x, y), angle, curvature, (force_x, force_y), length)
        for point in case["points"]:
            s, unit = float.fromhex(point["s"]), 2.0**-53 * length
            expected = [float(v) for v in point["xyak"][:2]]
            error = float(np.linalg.norm(curve.point_at(s) - (x, y) - expected))
            worst = math.nan
            if "jacobian" in point:
                columns = curve.jacobian_at(s)[:, 2:6].T
                moved = np.array(point.get("jacobian_sensitivity", [0.0] * 4))
                sizes = np.linalg.norm(point["jacobian"], axis=1) + 1e-6 * length ** np.array([1, 2, 3, 3])
                errors = np.linalg.norm(columns - point["jacobian"], axis=1)
                worst = float((errors / np.maximum(sizes, 1e9 * moved)).max())
            groups[case["group"]].append((error / unit, error / max(unit, point["sensitivity"][0]), worst))
    print(f"{'kind':24}{'values':>7}{'error 50%':>11}{'90%':>9}{'max':>10}{'beyond max':>12}{'jacobian':>14}{'max':>9}")
    for group, rows in groups.items():
        error, beyond, jacobian = np.array(rows).T
        fifty, ninety = np.quantile(error, (0.5, 0.9))
        print(
            f"{group:24}{len(rows):7}{fifty:11.1f}{ninety:9.1f}{error.max():10.3g}{beyond.max():12.2f}"
            f"{np.nanmedian(jacobian):14.1e}{np.nanmax(jacobian):9.1e}"
        )


if __name__ == "__main__":
    main()
