"""One six-axis arm: its dimensions, limits, place and tool, with its analytic kinematics in batches.

The geometry is the ortho-parallel basis with a spherical wrist of Brandstötter, Angerer and Hofbaur (2014), "An analytical
solution of the inverse kinematics problem of industrial serial manipulators with an ortho-parallel basis and a spherical
wrist": a1, a2, b, c1, c2, c3, c4. The closed form itself is py-opw-kinematics'; tests hold it against a product of
exponentials written from the dimensions alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from py_opw_kinematics import KinematicModel, RigidTransform, Robot

from batten.errors import InvalidInputError
from batten.typing import ArrayLike, FloatArray, IntArray

_METRE = 1000.0
_NO_LIMITS_MET = np.tile([10.0, 10.0], (6, 1))  # no joint is within these: the solver then skips all singular values


class InverseKinematics(NamedTuple):
    """All eight solutions for each pose.

    `joints_rad`: (…, 8, 6), within (−π, π], NaN where a branch does not exist. The slots are stable over poses: slot
    = 4·wrist + 2·shoulder + elbow. `extension_mm`: (…), how far the wrist centre lies within what the arm can reach,
    negative if it is out of reach.
    """

    joints_rad: FloatArray
    extension_mm: FloatArray


def rigid_pose(name: str, value: ArrayLike) -> FloatArray:
    """A read-only rigid 4 × 4 pose, or an error that says what is wrong."""
    pose = np.array(value, dtype=np.float64)
    ok = pose.shape == (4, 4) and bool(np.isfinite(pose).all())
    if ok:
        r = pose[:3, :3]
        ok = bool(np.abs(r.T @ r - np.eye(3)).max() < 1e-9 and np.linalg.det(r) > 0.0)
        ok = ok and bool(np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0]))
    if not ok:
        raise InvalidInputError(
            f"{name} must be a finite 4 × 4 pose (a rotation and a position in mm); got {np.asarray(value).tolist()}"
        )
    pose.setflags(write=False)
    return pose


def _vector(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    v = np.array(value, dtype=np.float64)
    if v.shape != shape or not np.isfinite(v).all():
        raise InvalidInputError(f"{name} must hold finite numbers of shape {shape}; got {np.asarray(value).tolist()}")
    v.setflags(write=False)
    return v


@dataclass(frozen=True, eq=False)
class RobotArm:
    """A six-axis robot with an ortho-parallel basis and a spherical wrist, at its place, with its tool.

    Parameters:
        name: for people, for example "ABB IRB 6620-150/2.2".
        dimensions_mm: shape (7,), (a1, a2, b, c1, c2, c3, c4) of the ortho-parallel basis: a1 from axis 1 forward to axis
            2, c1 from the base up to axis 2, c2 from axis 2 to axis 3, c3 from axis 3 along axis 4 to the wrist centre, a2
            across it (negative where the forearm lies above axis 3), b sideways, c4 from the wrist centre to the flange.
        joint_limits_rad: shape (6, 2), lowest and highest angle of each joint in the maker's own counting.
        joint_speeds_rad_s: shape (6,), greatest speeds, positive.
        joint_offsets_rad: shape (6,), θ = ±q − offset takes the maker's angles q to those of the closed form.
        flip_axes: six flags, true where the maker turns the other way.
        base: (4, 4), the robot's base in the cell frame, mm.
        tool: (4, 4), the tool centre point in the flange frame, mm.
        link_radii_mm: shape (6,), radii of the capsules that hold base, shoulder, upper arm, elbow, forearm and wrist
            (`batten.fabrication.robot.links`).

    Raises:
        InvalidInputError: numbers that are not finite, limits in the wrong order, speeds or lengths that are not positive,
            poses that are not rigid.

    Example:
        >>> arm = arm_preset("irb-6620-150-2.2")
        >>> arm.forward(np.zeros(6))[:3, 3].round(6).tolist()
        [1407.0, 0.0, 1855.0]
    """

    name: str
    dimensions_mm: FloatArray
    joint_limits_rad: FloatArray
    joint_speeds_rad_s: FloatArray
    joint_offsets_rad: FloatArray = field(default_factory=lambda: np.zeros(6))
    flip_axes: tuple[bool, ...] = (False,) * 6
    base: FloatArray = field(default_factory=lambda: np.eye(4))
    tool: FloatArray = field(default_factory=lambda: np.eye(4))
    link_radii_mm: FloatArray = field(default_factory=lambda: np.full(6, 150.0))

    def __post_init__(self) -> None:
        d = _vector(f"{self.name}: dimensions_mm", self.dimensions_mm, (7,))
        limits = _vector(f"{self.name}: joint_limits_rad", self.joint_limits_rad, (6, 2))
        speeds = _vector(f"{self.name}: joint_speeds_rad_s", self.joint_speeds_rad_s, (6,))
        offsets = _vector(f"{self.name}: joint_offsets_rad", self.joint_offsets_rad, (6,))
        if not (d[4] > 0.0 and np.hypot(d[1], d[5]) > 0.0):
            raise InvalidInputError(f"{self.name}: c2 and the forearm (a2, c3) must be longer than 0; got {d.tolist()}")
        if not (limits[:, 0] < limits[:, 1]).all():
            raise InvalidInputError(
                f"{self.name}: each joint's lowest angle must be less than its highest; got {limits.tolist()} rad"
            )
        if not (speeds > 0.0).all():
            raise InvalidInputError(f"{self.name}: joint speeds must be positive; got {speeds.tolist()} rad/s")
        radii = _vector(f"{self.name}: link_radii_mm", self.link_radii_mm, (6,))
        if not (radii >= 0.0).all():
            raise InvalidInputError(f"{self.name}: link_radii_mm must be 0 or more; got {radii.tolist()}")
        if len(self.flip_axes) != 6:
            raise InvalidInputError(f"{self.name}: flip_axes needs six flags; got {self.flip_axes!r}")
        object.__setattr__(self, "dimensions_mm", d)
        object.__setattr__(self, "joint_limits_rad", limits)
        object.__setattr__(self, "joint_speeds_rad_s", speeds)
        object.__setattr__(self, "joint_offsets_rad", offsets)
        object.__setattr__(self, "link_radii_mm", radii)
        object.__setattr__(self, "base", rigid_pose(f"{self.name}: base", self.base))
        object.__setattr__(self, "tool", rigid_pose(f"{self.name}: tool", self.tool))

    def placed(self, *, base: ArrayLike | None = None, tool: ArrayLike | None = None) -> RobotArm:
        """The same arm with another base or tool pose, each (4, 4) in mm; what is not given stays."""
        return replace(
            self,
            base=self.base if base is None else np.asarray(base, dtype=np.float64),
            tool=self.tool if tool is None else np.asarray(tool, dtype=np.float64),
        )

    @cached_property
    def _solver(self) -> Any:
        a1, a2, b, c1, c2, c3, c4 = (float(v) / _METRE for v in self.dimensions_mm)
        offsets = tuple(float(v) for v in self.joint_offsets_rad)
        model = KinematicModel(a1, a2, b, c1, c2, c3, c4, offsets=offsets, flip_axes=tuple(map(bool, self.flip_axes)))
        return Robot(model, degrees=False)

    @cached_property
    def wraps(self) -> tuple[bool, ...]:
        """For each joint, whether it can turn by more than a full turn, so that an angle and the same plus 2π differ."""
        return tuple(bool(v) for v in np.diff(self.joint_limits_rad, axis=1)[:, 0] >= 2.0 * np.pi)

    def forward(self, joints_rad: ArrayLike) -> FloatArray:
        """The tool centre point's pose in the cell frame.

        Parameters:
            joints_rad: shape (…, 6).

        Returns:
            Shape (…, 4, 4), mm; rows with NaN give NaN.

        Accuracy: 1e-9 mm for an arm of a few metres.
        """
        q = np.asarray(joints_rad, dtype=np.float64)
        flat = np.ascontiguousarray(q.reshape(-1, 6))
        bad = np.asarray(~np.isfinite(flat).all(axis=1))
        flange = np.array(self._solver.batch_forward(np.where(bad[:, None], 0.0, flat)).as_matrix()).reshape(-1, 4, 4)
        flange[:, :3, 3] *= _METRE
        flange[bad] = np.nan
        return np.asarray(self.base @ flange @ self.tool).reshape((*q.shape[:-1], 4, 4))

    def _flange(self, poses: FloatArray) -> FloatArray:
        """Poses of the tool in the cell as flange poses in the base frame, lengths in metres, shape (n, 4, 4)."""
        flange = np.linalg.inv(self.base) @ poses.reshape(-1, 4, 4) @ np.linalg.inv(self.tool)
        flange[:, :3, 3] /= _METRE
        return np.asarray(flange)

    def inverse(self, poses: ArrayLike) -> InverseKinematics:
        """Every way to bring the tool centre point to each pose, whatever the joint limits say.

        Parameters:
            poses: shape (…, 4, 4), rigid, in the cell frame, mm.

        Returns:
            All eight branches (see `InverseKinematics`); a pose with NaN gives NaN throughout.

        Accuracy: `forward` of a solution meets its pose to 1e-6 mm and 1e-9 rad.
        """
        p = np.asarray(poses, dtype=np.float64)
        flange = self._flange(p)
        bad = ~np.isfinite(flange).all(axis=(1, 2))
        if bad.any():
            flange[bad] = np.eye(4)
        found = self._solver.reach(RigidTransform.from_matrix(flange), joint_limits=_NO_LIMITS_MET)
        joints, extension = np.array(found.joints), found.extension * _METRE
        joints[bad] = np.nan
        extension[bad] = np.nan
        return InverseKinematics(joints.reshape((*p.shape[:-2], 8, 6)), extension.reshape(p.shape[:-2]))

    def conditioning(self, joints_rad: ArrayLike) -> FloatArray:
        """The least singular value of the flange's Jacobian; zero at any singularity.

        Parameters:
            joints_rad: shape (n, 6).

        Returns:
            Shape (n,). Translation counts in metres per radian, rotation in radians per radian. NaN where joints are NaN.
        """
        q = np.asarray(joints_rad, dtype=np.float64).reshape(-1, 6)
        flange = self._flange(self.forward(q))
        bad = np.asarray(~np.isfinite(flange).all(axis=(1, 2)))
        flange[bad] = np.eye(4)
        found = self._solver.reach(RigidTransform.from_matrix(flange))
        turn = np.array(found.joints) - np.where(bad[:, None], 0.0, q)[:, None]
        away = np.abs(turn - 2.0 * np.pi * np.round(turn / (2.0 * np.pi))).max(axis=-1)
        branch = np.where(np.isnan(away), np.inf, away).argmin(axis=-1)
        sigma = np.array(found.sigma_min[np.arange(len(q)), branch])
        sigma[bad] = np.nan
        return sigma

    def joint_margin(self, joints_rad: ArrayLike) -> FloatArray:
        """Distance of the worst joint from its nearer limit, rad, shape (…) for joints (…, 6); negative outside."""
        q = np.asarray(joints_rad, dtype=np.float64)
        low, high = self.joint_limits_rad[:, 0], self.joint_limits_rad[:, 1]
        return np.minimum(q - low, high - q).min(axis=-1)

    def best_turn_margin(self, joints_rad: FloatArray) -> FloatArray:
        """As `joint_margin`, but each joint that can turn further than 2π takes its most favourable full turn."""
        worst = np.full(joints_rad.shape[:-1], np.inf)
        for k in range(6):  # joint by joint: many times as fast as a reduction over an axis of six
            low, high = self.joint_limits_rad[k]
            off = joints_rad[..., k] - 0.5 * (low + high)
            if self.wraps[k]:
                off -= 2.0 * np.pi * np.rint(off / (2.0 * np.pi))
            np.minimum(worst, 0.5 * (high - low) - np.abs(off), out=worst)
        return worst

    def _arm_plane(self, joints_rad: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """θ₅; the wrist centre's distance ahead of axis 1, mm; the elbow's bend, 0 where the arm is stretched."""
        a1, a2, _, _, c2, c3, _ = self.dimensions_mm
        sign = np.where(self.flip_axes, -1.0, 1.0)
        theta2, theta3, theta5 = (sign[k] * joints_rad[..., k] - self.joint_offsets_rad[k] for k in (1, 2, 4))
        bend = theta3 + np.arctan2(a2, c3)
        return theta5, a1 + c2 * np.sin(theta2) + np.hypot(a2, c3) * np.sin(theta2 + bend), bend

    def singularity(self, joints_rad: ArrayLike) -> FloatArray:
        """How far the arm is from being singular: 0 at a singularity, at most 1.

        The least of three sines, one for each way in which an ortho-parallel arm with a spherical wrist loses a degree of
        freedom: |sin θ₅| (axes 4 and 6 in line), the sine of the elbow's bend (arm stretched or folded), and the wrist
        centre's distance from axis 1 over the arm's length (wrist above the base), cut at 1.

        Parameters:
            joints_rad: shape (…, 6).

        Returns:
            Shape (…); NaN for joints that are NaN.
        """
        theta5, ahead, bend = self._arm_plane(np.asarray(joints_rad, dtype=np.float64))
        _, a2, _, _, c2, c3, _ = self.dimensions_mm
        measure = np.minimum(np.abs(np.sin(theta5)), np.abs(np.sin(bend)))
        return np.minimum(measure, np.abs(ahead) / (c2 + np.hypot(a2, c3)))

    def configuration(self, joints_rad: ArrayLike) -> IntArray:
        """ABB's confdata [cf1, cf4, cf6, cfx] for an arm without a parallel rod.

        cf1, cf4 and cf6 number the quarter turn of axes 1, 4 and 6: 0 for [0°, 90°), 1 for [90°, 180°), −1 for
        [−90°, 0°) … cfx = 4·(wrist centre behind axis 1) + 2·(wrist centre behind the lower arm) + (axis 5 negative).
        Rows with NaN give zeros.

        Parameters:
            joints_rad: shape (…, 6).

        Returns:
            Shape (…, 4), integers.
        """
        q = np.asarray(joints_rad, dtype=np.float64)
        bad = ~np.isfinite(q).all(axis=-1, keepdims=True)
        q = np.where(bad, 0.0, q)
        theta5, ahead, bend = self._arm_plane(q)
        cfx = 4 * (ahead < 0.0) + 2 * (np.sin(bend) < 0.0) + 1 * (theta5 < 0.0)
        quarters = np.floor(q[..., [0, 3, 5]] / (0.5 * np.pi)).astype(np.int64)
        out = np.concatenate([quarters, cfx[..., None].astype(np.int64)], axis=-1)
        return np.where(bad, 0, out)


def _degrees(*rows: tuple[float, float]) -> FloatArray:
    return np.radians(np.array(rows))


# ABB IRB 6620-150/2.2. Dimensions and working ranges: ABB product specification 3HAC025861-001; the same numbers stand in
# the open preset of RobotComponents (IRB6620_150_220). They add up to the reach that ABB prints, 2.20 m from axis 1 to the
# wrist centre: 320 + 975 + hypot(887, 200) = 2204 mm. Axis 3 counts from a horizontal forearm, hence the offset. The axis
# speeds are those of ABB's data sheet as usually quoted; compare them with the plate of your own robot. The radii are not
# ABB's: round numbers for a robot of this size, dress pack not included, to be replaced by what is measured on one's own.
_PRESETS: dict[str, RobotArm] = {
    "irb-6620-150-2.2": RobotArm(
        name="ABB IRB 6620-150/2.2",
        dimensions_mm=np.array([320.0, -200.0, 0.0, 680.0, 975.0, 887.0, 200.0]),
        joint_limits_rad=_degrees((-170, 170), (-65, 140), (-180, 70), (-300, 300), (-130, 130), (-300, 300)),
        joint_speeds_rad_s=np.radians([100.0, 90.0, 90.0, 150.0, 120.0, 190.0]),
        joint_offsets_rad=np.array([0.0, 0.0, -0.5 * np.pi, 0.0, 0.0, 0.0]),
        link_radii_mm=np.array([350.0, 300.0, 180.0, 250.0, 150.0, 130.0]),
    ),
}


def arm_preset(name: str) -> RobotArm:
    """A robot by name, at the cell's origin and without a tool; `placed` puts it where it stands.

    Parameters:
        name: "irb-6620-150-2.2".

    Raises:
        InvalidInputError: no such robot.

    Example:
        >>> arm_preset("irb-6620-150-2.2").name
        'ABB IRB 6620-150/2.2'
    """
    if name not in _PRESETS:
        raise InvalidInputError(f"no robot is called {name!r}; there is {', '.join(sorted(_PRESETS))}")
    return _PRESETS[name]
