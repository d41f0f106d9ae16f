"""Free distances of two arms and a block in 300 postures: ours against coal and python-fcl, one core, the same input.

The peers are written as a careful user would: one shape for each link, made once, one transform for each link and posture,
one call for each pair. Ours looks at all pairs here, without the bounding balls that `least_clearance` starts with. What is
compared of the results are free distances: for bodies that overlap each has its own measure of how deep.
"""

from __future__ import annotations

import importlib
import time
from typing import Any

import numpy as np

from batten.fabrication.collisions import segment_box_distance, segment_distance
from batten.fabrication.robot.cell import cell_preset
from batten.fabrication.robot.motion_clearance import ARM_CAPSULES, arm_in_work

POSTURES = 300
LOW, HIGH = np.array([-300.0, -300.0, 0.0]), np.array([300.0, 300.0, 600.0])

Ends = tuple[np.ndarray, np.ndarray, np.ndarray]


def scene() -> tuple[Ends, Ends]:
    """Both arms' capsules, (starts, ends, radii), around postures in which they hold a rod through the block."""
    cell = cell_preset("two-irb6620")
    rng = np.random.default_rng(3)
    arms = []
    for side in ("left", "right"):
        low, high = cell.arm(side).joint_limits_rad.T
        middle = 0.5 * (low + high)
        joints = middle + 0.3 * (high - low) * rng.uniform(-1.0, 1.0, (POSTURES, 6))
        found = arm_in_work(cell, side, joints, 25.0)
        arms.append((found.start, found.end, found.radius))
    return arms[0], arms[1]


def ours(left: Ends, right: Ends) -> tuple[np.ndarray, np.ndarray]:
    pairs = segment_distance(left[0][:, :, None], left[1][:, :, None], right[0][:, None], right[1][:, None])
    pairs -= left[2][:, None] + right[2]
    boxes = [segment_box_distance(a, b, LOW, HIGH) - r for a, b, r in (left, right)]
    return pairs, np.stack(boxes, axis=1)


def _frames(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations with z along the segments, and their middles."""
    z = (end - start) / np.linalg.norm(end - start, axis=-1, keepdims=True)
    aside = np.where(np.abs(z[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = np.cross(aside, z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1), 0.5 * (start + end)


def coal_distances(coal: Any, left: Ends, right: Ends) -> tuple[np.ndarray, np.ndarray]:
    def bodies(arm: Ends) -> tuple[list[Any], list[list[Any]]]:
        lengths = np.linalg.norm(arm[1][0] - arm[0][0], axis=-1)
        rotation, middle = _frames(arm[0], arm[1])
        shapes = [coal.Capsule(r, h) for r, h in zip(arm[2], lengths)]
        return shapes, [[coal.Transform3s(r, m) for r, m in zip(*rows)] for rows in zip(rotation, middle)]

    request, result = coal.DistanceRequest(), coal.DistanceResult()
    box, place = coal.Box(*(HIGH - LOW)), coal.Transform3s(np.eye(3), 0.5 * (LOW + HIGH))
    arms = [bodies(arm) for arm in (left, right)]

    def distance(*what: Any) -> float:
        result.clear()
        return float(coal.distance(*what, request, result))

    return _all(arms, lambda a, b: distance(*a, *b), (box, place))


def fcl_distances(fcl: Any, left: Ends, right: Ends) -> tuple[np.ndarray, np.ndarray]:
    def bodies(arm: Ends) -> tuple[list[Any], list[list[Any]]]:
        lengths = np.linalg.norm(arm[1][0] - arm[0][0], axis=-1)
        rotation, middle = _frames(arm[0], arm[1])
        shapes = [fcl.CollisionObject(fcl.Capsule(r, h)) for r, h in zip(arm[2], lengths)]
        return shapes, [[fcl.Transform(r, m) for r, m in zip(*rows)] for rows in zip(rotation, middle)]

    def distance(a: tuple[Any, Any], b: tuple[Any, Any]) -> float:
        for shape, transform in (a, b):
            shape.setTransform(transform)
        return float(fcl.distance(a[0], b[0]))

    box = fcl.CollisionObject(fcl.Box(*(HIGH - LOW)))
    return _all([bodies(arm) for arm in (left, right)], distance, (box, fcl.Transform(np.eye(3), 0.5 * (LOW + HIGH))))


def _all(
    arms: list[tuple[list[Any], list[list[Any]]]], distance: Any, box: tuple[Any, Any]
) -> tuple[np.ndarray, np.ndarray]:
    (one, here), (other, there) = arms
    pairs = np.empty((POSTURES, ARM_CAPSULES, ARM_CAPSULES))
    boxes = np.empty((POSTURES, 2, ARM_CAPSULES))
    for k in range(POSTURES):
        for i in range(ARM_CAPSULES):
            for j in range(ARM_CAPSULES):
                pairs[k, i, j] = distance((one[i], here[k][i]), (other[j], there[k][j]))
            boxes[k, 0, i] = distance((one[i], here[k][i]), box)
            boxes[k, 1, i] = distance((other[i], there[k][i]), box)
    return pairs, boxes


def run() -> list[dict[str, object]]:
    """Rows of the table: what, ours_s, peer, peer_s, ratio, note."""
    left, right = scene()
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        pairs, boxes = ours(left, right)
        best = min(best, time.perf_counter() - start)
    count = pairs.size + boxes.size
    rows: list[dict[str, object]] = []
    for module, name, distances in (("coal", "coal", coal_distances), ("fcl", "python-fcl", fcl_distances)):
        row = {"what": f"{count:,} free distances of capsules and a box", "ours_s": best, "peer": name}
        try:
            peer = importlib.import_module(module)
        except ImportError:
            rows.append({**row, "peer_s": None, "ratio": None, "note": f"{name} is not installed"})
            continue
        start = time.perf_counter()
        other_pairs, other_boxes = distances(peer, left, right)
        taken = time.perf_counter() - start
        off = [np.abs(a - b)[a > 0.0].max() for a, b in ((pairs, other_pairs), (boxes, other_boxes))]
        note = f"{1e6 * best / count:.1f} and {1e6 * taken / count:.1f} µs each; free distances differ by up to "
        note += f"{off[0]:.0e} mm between capsules and {off[1]:.0e} mm from the box"
        rows.append({**row, "peer_s": taken, "ratio": taken / best, "note": note})
    return rows


if __name__ == "__main__":
    for row in run():
        print(row)
