"""Triangle meshes with a colour and a number at every vertex, as binary PLY (Turk 1994), little-endian."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from batten.errors import InvalidInputError
from batten.typing import ArrayLike


def write_ply_mesh(
    path: str | Path,
    points: ArrayLike,
    triangles: ArrayLike,
    colours: ArrayLike,
    quality: ArrayLike,
    *,
    comment: str = "",
) -> None:
    """Write a mesh.

    Parameters:
        path: the file to write, overwritten if it exists.
        points: (n, 3).
        triangles: (t, 3), indices of points from 0.
        colours: (n, 3), red, green, blue, 0 to 255.
        quality: (n,), a number at each point; MeshLab and CloudCompare show properties of this name as colours.
        comment: one line of ASCII for the head.

    Raises:
        InvalidInputError: arrays that do not match, or indices of points that are not there.

    Accuracy: coordinates are rounded to 32 bits, 6e-8 of themselves.
    """
    p, f = np.asarray(points, dtype=np.float64), np.asarray(triangles, dtype=np.int64)
    c, q = np.asarray(colours), np.asarray(quality, dtype=np.float64)
    n = len(p)
    if p.shape != (n, 3) or c.shape != (n, 3) or q.shape != (n,) or f.ndim != 2 or f.shape[1] != 3:
        raise InvalidInputError(
            f"points {p.shape}, triangles {f.shape}, colours {c.shape}, quality {q.shape}; allowed are (n, 3), (t, 3), "
            "(n, 3) and (n,)"
        )
    if f.size and (f.min() < 0 or f.max() >= n):
        raise InvalidInputError(f"triangles name points {f.min()} to {f.max()}; there are {n}, from 0")
    vertices = np.zeros(n, dtype=[("p", "<f4", 3), ("c", "u1", 3), ("q", "<f4")])
    vertices["p"], vertices["c"], vertices["q"] = p, c, q
    faces = np.zeros(len(f), dtype=[("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, f
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {' '.join(comment.encode('ascii', 'replace').decode('ascii').split())}"] if comment else []
    lines += [f"element vertex {n}", *(f"property float {axis}" for axis in "xyz")]
    lines += [*(f"property uchar {colour}" for colour in ("red", "green", "blue")), "property float quality"]
    lines += [f"element face {len(f)}", "property list uchar int vertex_indices", "end_header", ""]
    Path(path).write_bytes("\n".join(lines).encode("ascii") + vertices.tobytes() + faces.tobytes())
