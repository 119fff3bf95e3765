# SPDX-License-Identifier: BSD-3-Clause
"""The commands that have come, and which of them is in force. Time is an argument; free of ROS, and of threads."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from command_line.options import counted
from moveit_servo.settings import UNITLESS

if TYPE_CHECKING:
    from moveit_servo.settings import ServoSettings


#: Of a twist: a link or the model's frame by its name, "" where the settings say; or a pose (4, 4) in the latter.
Frame = str | np.ndarray
# Any number may come. More than this [m, rad or per s] is taken for as much: no robot is faster or reaches further, and
# sums and squares stay finite; a part of a twist or of joint velocities that is less than the second is none.
_MOST, _LEAST = 1e3, 1e-9


class CommandIgnored(ValueError):
    """A command that is not carried out, with the reason."""


@dataclass
class _Newest:
    """The newest command of one kind. since [s]: when it was sent, -inf if it came too late; value None: no motion is
    wanted; is_new: no step has been made since it came."""

    since: float = -np.inf
    value: Any = None
    frame: Frame = ""
    is_new: bool = True


@dataclass
class Commands:
    """Of twists, joint velocities and poses the newest one each. As in MoveIt, twists go before joint velocities; both
    go before poses.

    control, drift (6,) bool: the components of twists that count, and the directions of the planning frame that do not
    matter.
    """

    joints: tuple[str, ...]
    control: np.ndarray = field(default_factory=lambda: np.ones(6, dtype=bool))
    drift: np.ndarray = field(default_factory=lambda: np.zeros(6, dtype=bool))

    def __post_init__(self) -> None:
        self._twist, self._jog, self._pose = _Newest(), _Newest(), _Newest()

    def take_twist(self, values: Any, frame: Frame, since: float, settings: ServoSettings) -> None:
        """A twist (6,) in the axes of ``frame``, "": the command frame. Raises CommandIgnored; then nothing moves."""
        self._twist = _Newest(since)
        twist = np.array(values, dtype=float)
        if not np.isfinite(twist).all():
            raise CommandIgnored("a twist is not finite: %s" % twist.tolist())
        if settings.command_in_type == UNITLESS:
            if np.abs(twist).max() > 1.0:
                raise CommandIgnored("a twist has a component beyond -1 to 1: %s; command_in_type is %s"
                                     % (twist.tolist(), UNITLESS))
            twist *= np.repeat((settings.linear_scale, settings.rotational_scale), 3)
        twist = _bounded(np.where(self.control, twist, 0.0))
        self._twist = _Newest(since, twist if twist.any() else None, frame)

    def take_jog(self, names: Any, velocities: Any, since: float, settings: ServoSettings) -> str:
        """Velocities of joints; return what of them is not carried out, or "". Raises CommandIgnored; then nothing
        moves."""
        self._jog = _Newest(since)
        names, values = list(names), np.array(velocities, dtype=float)
        if not np.isfinite(values).all():
            raise CommandIgnored("joint velocities are not finite: %s" % values.tolist())
        if len(values) < len(names):
            raise CommandIgnored("a joint command has %s but %s" % _counts(names, values))
        scale = settings.joint_scale if settings.command_in_type == UNITLESS else 1.0
        wanted, foreign = np.zeros(len(self.joints)), []
        for name, value in zip(names, values, strict=False):
            if name in self.joints:
                wanted[self.joints.index(name)] = value
            else:
                foreign.append(name)
        # A command without a known joint is one, too: MoveIt publishes set-points for it.
        self._jog = _Newest(since, scale * _bounded(wanted) if values.any() else None)
        if len(values) > len(names):
            return "a joint command has %s but %s; those without a name are ignored" % _counts(names, values)
        if foreign:
            return "joint commands name %s; the arm's joints are %s" % (
                ", ".join(name or "''" for name in foreign), ", ".join(self.joints))
        return ""

    def take_pose(self, pose: np.ndarray, since: float) -> None:
        """A pose (4, 4) of the tip in the model's frame."""
        self._pose = _Newest(since, pose)

    def newest(self, now: float, settings: ServoSettings) -> tuple[str, Any, Frame]:
        """Return (kind, value, frame) of the command in force for a step at ``now`` [s]: "twist", "joints" or "pose";
        "" if there is none.

        Each counts for one step, however late that is made: on a busy machine simulated time may jump by more than the
        time-out between a command and its step, and the arm would stand still.
        """
        found: tuple[str, Any, Frame] = ("", None, "")
        for kind, newest, timeout in (("twist", self._twist, settings.incoming_command_timeout),
                                      ("joints", self._jog, settings.incoming_command_timeout),
                                      ("pose", self._pose, settings.target_pose_timeout or np.inf)):
            is_new, newest.is_new = newest.is_new and newest.since > -np.inf, False
            if found[0] == "" and newest.value is not None and (is_new or now - newest.since < timeout):
                found = kind, newest.value, newest.frame
        if found[0] in ("twist", "joints"):
            self.forget_pose()  # a hand on the stick ends a pursuit
        return found

    def forget_pose(self) -> None:
        """Pursue no pose any longer."""
        self._pose = _Newest()

    def clear(self) -> None:
        """Forget all: time has gone back."""
        self._twist, self._jog, self._pose = _Newest(), _Newest(), _Newest()


def sent_at(stamp: float, arrived: float) -> float:
    """The time [s] from which a command counts, by its ``stamp`` (0: none) and when it ``arrived``: a stamp in the
    future, of a clock that is ahead, must not keep an arm moving."""
    return min(stamp, arrived) if stamp > 0.0 else arrived


def bounded_pose(pose: np.ndarray) -> np.ndarray:
    """Return ``pose`` (4, 4), not further away than any robot reaches, in the same direction."""
    pose = pose.copy()
    pose[:3, 3] = _bounded(pose[:3, 3])
    return pose


def _counts(names: list, values: np.ndarray) -> tuple[str, str]:
    return counted(len(names), "name"), counted(len(values), "velocity", "velocities")


def _bounded(values: np.ndarray) -> np.ndarray:
    """``values``, all finite, made smaller by one factor if need be; without those that are next to nothing."""
    greatest = np.abs(values).max(initial=0.0)
    if greatest > _MOST:
        values = values * (_MOST / greatest)
    return np.where(np.abs(values) < _LEAST, 0.0, values)
