# SPDX-License-Identifier: BSD-3-Clause
"""Which topics a recorder needs, and what their messages say."""
from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorState
from cv_bridge import CvBridge
from gazebo_msgs.msg import ModelStates
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from baxter_model import SIDES, joint_names

from ..watching import JOINT_ANGLES, MODEL, OPENING, SET_POINTS, TOLD

#: {camera: topic}
CAMERAS = {name: "/cameras/%s_camera/image" % name for name in ("head", *("%s_hand" % side for side in SIDES))}
MARKS_TOPIC = "/steering/mark"
_ARMS = [name for side in SIDES for name in joint_names(side)]
_OPENING = {EndEffectorCommand.CMD_GRIP: 0.0, EndEffectorCommand.CMD_RELEASE: 100.0}

#: (key, value, stamp or None) of `watching.WatchingRecorder.take`
Said = Iterable[tuple[str, Any, float | None]]


class Heard(NamedTuple):
    """A topic: its type, and what a message of it says."""

    kind: Any
    says: Callable[[Any], Said]


def joints(message: JointState) -> list[float] | None:
    """(14,) of both arms, left before right [rad]; None of a message of other joints."""
    at = dict(zip(message.name, message.position, strict=False))
    return [at[name] for name in _ARMS] if all(name in at for name in _ARMS) else None


def opening_told(message: EndEffectorCommand) -> float | None:
    """How far open a gripper is told to be, 0 to 100; None of a command that does not move it."""
    if message.command != EndEffectorCommand.CMD_GO:
        return _OPENING.get(message.command)
    try:
        return min(max(float(json.loads(message.args)["position"]), 0.0), 100.0)
    except (ValueError, KeyError, TypeError):
        return None


def topics(cameras: Sequence[str] = (), models: Sequence[str] = ()) -> Mapping[str, Heard]:
    """{topic: Heard} for frames with these cameras and models."""
    def angles(message: JointState) -> Said:
        found = joints(message)
        return [] if found is None else [(JOINT_ANGLES, found, message.header.stamp.to_sec())]

    def set_points(message: JointState) -> Said:
        found = joints(message)
        return [] if found is None else [(SET_POINTS, found, None)]

    def poses(message: ModelStates) -> Said:
        return [(MODEL % name, _pose(pose), None) for name, pose in zip(message.name, message.pose, strict=True)
                if name in models]

    found = {"/robot/joint_states": Heard(JointState, angles), "/robot/ref_joint_states": Heard(JointState, set_points)}
    for side in SIDES:
        name = "/robot/end_effector/%s_gripper/" % side
        found[name + "state"] = Heard(EndEffectorState, lambda message, key=OPENING % side: [
            (key, message.position, None)])
        found[name + "command"] = Heard(EndEffectorCommand, lambda message, key=TOLD % side: [
            (key, opening, None) for opening in [opening_told(message)] if opening is not None])
    bridge = CvBridge()
    for camera in cameras:
        found[CAMERAS[camera]] = Heard(Image, lambda message, key=camera: [
            (key, bridge.imgmsg_to_cv2(message, "rgb8"), None)])
    if models:
        found["/gazebo/model_states"] = Heard(ModelStates, poses)
    found[MARKS_TOPIC] = Heard(String, lambda message: [(MARKS_TOPIC, message.data, None)])
    return found


def _pose(pose):
    place, turn = pose.position, pose.orientation
    return np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w])
