# SPDX-License-Identifier: BSD-3-Clause
"""The members of a `baxter_lab.Lab` that actions and most tasks use: what has them can take its place, such as a robot
on a ROS master."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np

    from arm_kinematics import Chain
    from baxter_lab import Mode
    from bullet_sim import Pose


class StageGripper(Protocol):
    """One hand."""

    @property
    def position(self) -> float:
        """How far it is open, 0 to 100 [%]."""
        ...

    @property
    def holds(self) -> bool:
        """Whether it holds something."""
        ...

    def command(self, command: str, **arguments: Any) -> None:
        """One command by its name on the wire, with its arguments."""


class StageArm(Protocol):
    """One arm: angles and velocities (7,) [rad], [rad/s]; pose (4, 4) of its gripper's frame in `base` [m]."""

    side: str
    chain: Chain

    @property
    def gripper(self) -> StageGripper:
        """Its hand."""
        ...

    @property
    def angles(self) -> np.ndarray:
        """(7,) [rad]."""
        ...

    @property
    def velocities(self) -> np.ndarray:
        """(7,) [rad/s]."""
        ...

    @property
    def pose(self) -> np.ndarray:
        """(4, 4)."""
        ...

    def command(self, mode: Mode, values: Sequence[float] | np.ndarray) -> object:
        """One joint command for all joints."""
        ...


class StageRobot(Protocol):
    """Both arms."""

    @property
    def arms(self) -> Mapping[str, StageArm]:
        """{side: its arm}."""
        ...

    @property
    def left(self) -> StageArm:
        """The left one."""
        ...


class StageModel(Protocol):
    """The body of a thing."""

    def base_pose(self) -> Pose:
        """Where it is, in `base`."""
        ...


class StageThing(Protocol):
    """A thing; places are in `base` [m]."""

    @property
    def model(self) -> StageModel:
        """Its body."""
        ...

    @property
    def pose(self) -> np.ndarray:
        """(4, 4) where it is."""
        ...

    @property
    def position(self) -> np.ndarray:
        """(3,) where it is."""
        ...

    def put(self, place: tuple[float, ...], yaw: float = 0.0) -> None:
        """Put it at (x, y, z), turned about the vertical [rad], at rest."""


class Stage(Protocol):
    """A robot, and things that are put up. Places are in `base` [m]."""

    @property
    def robot(self) -> StageRobot:
        """The robot."""
        ...

    def add_box(self, name: str, size: tuple[float, ...], place: tuple[float, ...], *, mass_kg: float | None = ...,
                friction: float | None = ..., colour: tuple[float, ...] = ...) -> StageThing:
        """A box, fixed unless it has a mass."""
        ...

    def add_urdf(self, name: str, description: str, place: tuple[float, ...]) -> StageThing:
        """The thing that a URDF text describes, its root's frame at `place`."""
        ...
