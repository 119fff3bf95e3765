# SPDX-License-Identifier: BSD-3-Clause
"""Typical mistakes that can be recognized by their effect, also those in a lab sheet's own listing. Free of ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from baxter_model import joint_names
from command_line.options import counted
from rf_checks.measures import pose_error
from urdf_model.transforms import matrix_from_quaternion, rotation_angle

if TYPE_CHECKING:
    from rf_checks.robot import JudgedRobot

# Tolerance to identify a known wrong answer [m], [rad].
NEAR_M, NEAR_RAD = 0.02, 0.06
# The same, when any two of the robot's frames may be meant [m].
SAME_M = 0.005

SHEET_TF_LISTENER = "the sheet's own tf_listener listing has this slip, in the line that begins `quat = (q.x`"
SHEET_NAMES = ("Case Western's notes have this slip in the lines `right_cmd.names.push_back(...)`: right_e1 and "
               "right_w1 stand there twice, two joints are missing")
SHEET_QUERY = ("the sheet's `query_transformation` returns the fields of a message, and its `rotate_pose` takes a "
               "list: hand over [quat.x, quat.y, quat.z, quat.w]")
SHEET_ROTATE = ("the sheet's listing of rotate_pose puts w first in the line that begins `quat_t3d =` and takes a "
                "list; compare yours")


def rotation_of(w: float, x: float, y: float, z: float) -> np.ndarray:
    """(3, 3) rotation of four numbers, read as a quaternion w x y z of any length; NaN for length 0."""
    try:
        return matrix_from_quaternion((x, y, z, w))
    except ValueError:
        return np.full((3, 3), np.nan)  # too short


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """x, y, z, w with w >= 0 of a (3, 3) rotation."""
    # The eigenvector of Bar-Itzhack's matrix, which never divides by nearly zero.
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    matrix = np.array(((xx - yy - zz, xy + yx, xz + zx, zy - yz),
                       (xy + yx, yy - xx - zz, yz + zy, xz - zx),
                       (xz + zx, yz + zy, zz - xx - yy, yx - xy),
                       (zy - yz, xz - zx, yx - xy, xx + yy + zz))) / 3.0
    x, y, z, w = np.linalg.eigh(matrix)[1][:, 3]
    return np.array((x, y, z, w)) * (1.0 if w >= 0.0 else -1.0)


def about(axis: str, angle_rad: float) -> np.ndarray:
    """(3, 3) rotation about "x", "y" or "z"."""
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = math.cos(angle_rad)
    matrix[j, i], matrix[i, j] = math.sin(angle_rad), -math.sin(angle_rad)
    return matrix


def is_near(rotation: np.ndarray, other: np.ndarray) -> bool:
    """Whether two (3, 3) rotations are the same within NEAR_RAD."""
    return rotation_angle(rotation.T @ other) < NEAR_RAD


def is_xyzw_taken_as_wxyz(found: np.ndarray, true: np.ndarray) -> bool:
    """Whether a (3, 3) rotation results from reading x y z w as w x y z, once, or at both input and output."""
    x, y, z, w = quaternion_of(true)
    return is_near(found, rotation_of(x, y, z, w))


def wrong_rotations(start: np.ndarray, axis: str, angle_rad: float) -> list[tuple[str, str, np.ndarray]]:
    """Results of known mistakes in "turn `start` (3, 3) about its own axis": list of (key, description, rotation)."""
    x, y, z, w = quaternion_of(start)
    scrambled = rotation_of(x, y, z, w)
    turn = about(axis, angle_rad)
    degrees = math.degrees(angle_rad)

    def read_back(rotation: np.ndarray) -> np.ndarray:
        """The rotation if its quaternion w x y z is sent as x y z w."""
        qx, qy, qz, qw = quaternion_of(rotation)
        return rotation_of(qz, qw, qx, qy)

    order = "the quaternion's numbers are in the wrong order: ROS has x y z w, transforms3d w x y z"
    return [
        ("quaternion_order", order + ", and it was passed on unchanged", scrambled @ turn),
        ("quaternion_order", order + ", and it was passed on unchanged both ways", read_back(scrambled @ turn)),
        ("quaternion_order", order + ", and what came out was sent unchanged", read_back(start @ turn)),
        ("degrees", "the angle was %g radians: degrees where radians are meant (numpy.deg2rad turns them)" % degrees,
         start @ about(axis, degrees)),
        ("degrees", "the angle was converted to radians twice", start @ about(axis, math.radians(angle_rad))),
        ("wrong_axis", "the turn was about the axis %s of `base`, not of the gripper: multiply the other way round"
         % axis, turn @ start),
        ("wrong_direction", "the turn went the other way", start @ about(axis, -angle_rad)),
        *(("wrong_axis", "the turn was about the gripper's axis %s, not %s" % (other, axis),
           start @ about(other, angle_rad)) for other in "xyz" if other != axis),
        ("not_turned", "the gripper is where it was to be, but it was not turned", start),
    ]


def matrix_slip(found: np.ndarray, robot: JudgedRobot, joints: dict[str, float], pairs: list[tuple[str, str]],
                preferred: tuple[str, ...]) -> tuple[str, str] | None:
    """The mistake in a (4, 4) matrix that should be the pose of one of `pairs`: (key, sentence) or None.

    pairs: (target, source) each, those of the exercise that are missing. preferred: frames that are named first if
    several coincide.
    """
    if np.allclose(found, np.eye(4)):
        return "identity", ("%s -> %s: the matrix printed is the identity: rotation and translation were not filled in"
                            % pairs[0])
    for target, source in pairs:
        name, true = "%s -> %s" % (target, source), robot.between(target, source, joints)
        slip = _rotation_slip(found, true, NEAR_M)
        if slip:
            return slip[0], "%s: %s" % (name, slip[1])
        if _same(found, np.linalg.inv(true)):
            return "wrong_frame", ("%s: this is the inverse, %s -> %s: lookup_transform takes the target frame first, "
                                   "then the source" % (name, source, target))
        if np.linalg.norm(found[:3, 3] - true[:3, 3]) < NEAR_M and not is_near(found[:3, :3], true[:3, :3]):
            return "rotation", "%s: the translation is right, the rotation part is not" % name
    return _another_pair(found, robot, joints, pairs, preferred)


def _another_pair(found: np.ndarray, robot: JudgedRobot, joints: dict[str, float], pairs: list[tuple[str, str]],
                  preferred: tuple[str, ...]) -> tuple[str, str] | None:
    """The other pair of frames that the matrix belongs to, directly or with a mistake in its rotation."""
    names = [*preferred, *(name for name in robot.frame_names if name not in preferred)]
    poses = {name: robot.frame(name, joints) for name in names}
    others = []
    for target in names:
        inverse = np.linalg.inv(poses[target])
        others += [(target, source, inverse @ poses[source]) for source in names if source != target]
    wanted = " and ".join("%s -> %s" % pair for pair in pairs)
    for target, source, true in others:
        if _same(found, true):
            return "wrong_frame", ("%s: the matrix is that of %s -> %s: another frame than the exercise's"
                                   % (wanted, target, source))
    for target, source, true in others:
        slip = _rotation_slip(found, true, SAME_M)
        if slip:
            return slip[0], ("the matrix printed is that of %s -> %s, and the exercise asks for %s. Besides, %s"
                             % (target, source, wanted, slip[1]))
    return None


def _rotation_slip(found: np.ndarray, true: np.ndarray, near_m: float) -> tuple[str, str] | None:
    """The mistake in the rotation of a pose with the right position: (key, sentence) or None."""
    if np.linalg.norm(found[:3, 3] - true[:3, 3]) > near_m or is_near(found[:3, :3], true[:3, :3]):
        return None
    if is_xyzw_taken_as_wxyz(found[:3, :3], true[:3, :3]):
        return "quaternion_order", ("the rotation is that of a quaternion in the wrong order: tf gives x y z w, "
                                    "quat2mat wants w x y z (%s)" % SHEET_TF_LISTENER)
    if is_near(found[:3, :3], true[:3, :3].T):
        return "transposed", "the rotation part is transposed, the translation is right"
    return None


def _same(matrix: np.ndarray, other: np.ndarray) -> bool:
    distance, angle = pose_error(matrix, other)
    return distance < SAME_M and angle < 0.02


def command_slip(commands: list[tuple[str, int, list[str], list[float]]]) -> tuple[str, str] | None:
    """The mistake in joint commands: (key, sentence) or None. commands: (side, mode, names, values) each."""
    for _, _, names, values in commands:
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            side = repeated[0].split("_")[0]
            missing = [name for name in joint_names(side) if name not in names]
            return "repeated_names", ("the joint command names %s more than once and misses %s; %s"
                                      % (" and ".join(repeated), " and ".join(missing) or "none", SHEET_NAMES))
        if len(names) != len(values):
            return "lengths", ("the joint command has %s and %s; each joint needs one of each"
                               % (counted(len(names), "name"), counted(len(values), "value")))
    # Use the farthest of all commands, since records contain only some of them.
    value, name = max(((value, name) for _, _, names, values in commands
                       for name, value in zip(names, values, strict=True)), key=lambda pair: abs(pair[0]),
                      default=(0.0, ""))
    # No joint of the arm turns farther than 3.1 rad.
    if abs(value) > 6.3:
        return "degrees", ("%s was commanded to %.1f: angles are in radians, and this looks like degrees "
                           "(numpy.deg2rad turns them)" % (name, value))
    return None
