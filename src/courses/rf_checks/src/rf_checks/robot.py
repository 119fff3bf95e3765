# SPDX-License-Identifier: BSD-3-Clause
"""Poses of the robot's frames for given joint values. Free of ROS."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import Chain, ChainError, NoSolution, pose_from_quaternion, solve
from baxter_model import BASE_FRAME, SIDES, poses, tip_of
from urdf_model import parse_urdf

if TYPE_CHECKING:
    from rf_checks.recording import RunRecording

# Start of inverse kinematics: the middle of the arm's usual workspace.
_START = "neutral"


class JudgedRobot:
    """The robot's kinematics, from its description."""

    def __init__(self, description_xml: str) -> None:
        self._robot = parse_urdf(description_xml)
        self._arms = {side: Chain.from_robot(self._robot, base=BASE_FRAME, tip=tip_of(side)) for side in SIDES}
        # None: no joint moves the frame.
        self._chains: dict[str, Chain | None] = {}

    @property
    def frame_names(self) -> list[str]:
        """Names of all frames that hang on `base`: list."""
        return [link for link in self._robot.links if self._hangs_on_base(link)]

    def frame(self, name: str, joints: dict[str, float]) -> np.ndarray:
        """(4, 4) pose of a frame in `base` [m]. `joints`: dict of name to rad."""
        if name in (BASE_FRAME, "world"):
            return np.eye(4)
        if name not in self._chains:
            try:
                self._chains[name] = Chain.from_robot(self._robot, base=BASE_FRAME, tip=name)
            except ChainError:
                self._chains[name] = None
        chain = self._chains[name]
        if chain is None:
            return self._fixed(name)
        return chain.fk(np.array([joints[joint] for joint in chain.joint_names]))

    def _hangs_on_base(self, link: str) -> bool:
        while link != BASE_FRAME:
            joint = self._robot.parent_joint(link)
            if joint is None:
                return False
            link = joint.parent
        return True

    def _fixed(self, name: str) -> np.ndarray:
        """Pose of a frame that no joint moves."""
        matrix = np.eye(4)
        for joint in self._robot.chain(BASE_FRAME, name):
            matrix = matrix @ joint.origin @ joint.child_offset
        return matrix

    def between(self, target: str, source: str, joints: dict[str, float]) -> np.ndarray:
        """(4, 4) pose of `source` in `target`."""
        return np.linalg.inv(self.frame(target, joints)) @ self.frame(source, joints)

    def gripper_path(self, side: str, recording: RunRecording) -> np.ndarray:
        """(n, 3) positions of one gripper in `base` [m]."""
        return np.array([self._arms[side].fk(q)[:3, 3] for q in recording.arm(side)])

    def gripper(self, side: str, recording: RunRecording, row: int = -1) -> np.ndarray:
        """(4, 4) pose of one gripper in `base` at a row of the recording."""
        return self._arms[side].fk(recording.arm(side)[row])

    def solve(self, side: str, xyz: Sequence[float], xyzw: Sequence[float]) -> np.ndarray | NoSolution:
        """Solve an IK request: returns joint values (7,), or the NoSolution."""
        try:
            start = np.array(list(poses().angles(_START, side).values()))
            return solve(self._arms[side], pose_from_quaternion(xyz, xyzw), seed=start).q
        except NoSolution as failure:
            return failure
