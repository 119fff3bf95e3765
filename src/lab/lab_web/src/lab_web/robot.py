# SPDX-License-Identifier: BSD-3-Clause
"""Baxter for :class:`lab_web.lab.PageLab`, in rospy."""
from __future__ import annotations

import json
import threading
import time
from typing import TYPE_CHECKING

import rospy
from baxter_core_msgs.msg import (
    AssemblyState,
    EndEffectorCommand,
    EndEffectorProperties,
    EndEffectorState,
    HeadPanCommand,
    JointCommand,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from baxter_interface import RobotEnable
from baxter_interface.hindrance import ask_what_holds
from baxter_interface.presence import Presence
from baxter_model import BASE_FRAME, HEAD_JOINT, SIDES, joint_names, poses, tip_of
from baxter_model.readiness import why_not_ready
from lab_web.lab import RobotError
from lab_web.motion import limits_of
from urdf_model import UrdfError, parse_urdf
from web_bridge.errors import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from urdf_model import Robot

#: Poses that both arms can go to from each other on a straight line between joint angles.
SAFE_POSES = ("neutral", "untucked")
#: Base and tip of the arms, for :class:`lab_web.hands.HandAnswers`.
ARM_LINKS = {side: (BASE_FRAME, tip_of(side)) for side in SIDES}
_ACTIONS = {"open": ("go", {"position": EndEffectorState.POSITION_OPEN}),
            "close": ("go", {"position": EndEffectorState.POSITION_CLOSED}), "calibrate": ("calibrate", {})}
_SENDER = "lab_web"
# A gripper is told to follow a recording where it has moved by more than this.
GRIPPER_STEP_PERCENT = 1.0


class BaxterTopics:
    """Advertises at once, subscribes with :meth:`listen`; what is not known yet is empty. ``told(text)``: an error of a
    switch."""

    def __init__(self, told: Callable[[str], object]) -> None:
        self._told = told
        self._positions = {}
        self._state = None
        self._heard_s = 0.0
        #: The stamp of the newest positions [s].
        self.time_s = 0.0
        self._presence = Presence("/robot/state", lambda: time.monotonic() - self._heard_s)
        self._grippers = {}
        self._grippers_of_kind = {}
        self._description = None
        self._sequence = 0
        self._switching = threading.Lock()
        self._enabler = None
        self._gripped = {}
        self.limits = {}
        #: Called with (time [s], {joint: [rad], SIDE_gripper: [%]}) for each joint_states message.
        self.heard = lambda time_s, values: None
        self._stop = rospy.Publisher("/robot/set_super_stop", Empty, queue_size=10)
        self._limbs = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1,
                                             tcp_nodelay=True) for side in SIDES}
        self._head = rospy.Publisher("/robot/head/command_head_pan", HeadPanCommand, queue_size=1)
        self._hands = {side: rospy.Publisher("/robot/end_effector/%s_gripper/command" % side, EndEffectorCommand,
                                             queue_size=10) for side in SIDES}
        self._subscriptions = []

    def listen(self) -> None:
        """Subscribe to the robot's states, which a simulator does not make for nobody. Not called
        together with :meth:`rest`."""
        self.rest()
        for topic, kind, callback in (("/robot/joint_states", JointState, self._on_joints),
                                      ("/robot/state", AssemblyState, self._on_state)):
            self._subscriptions.append(rospy.Subscriber(topic, kind, callback, queue_size=1, tcp_nodelay=True))
        for side in SIDES:
            for topic, kind, callback in (("state", EndEffectorState, self._on_gripper),
                                          ("properties", EndEffectorProperties, self._on_kind)):
                self._subscriptions.append(rospy.Subscriber(
                    "/robot/end_effector/%s_gripper/%s" % (side, topic), kind, callback, side, queue_size=1))

    def rest(self) -> None:
        """Hear nothing until the next :meth:`listen`; what was heard of states is forgotten."""
        subscriptions, self._subscriptions = self._subscriptions, []
        for subscription in subscriptions:
            subscription.unregister()
        self._state, self._positions, self._grippers = None, {}, {}
        # Its subscription, too; not during a switch.
        if self._switching.acquire(blocking=False):
            enabler, self._enabler = self._enabler, None
            self._switching.release()
            if enabler is not None:
                enabler.close()

    @property
    def poses(self) -> dict[str, dict[str, float]]:
        """{name: {joint: angle [rad]}} of both arms."""
        return {name: {joint: angle for side in SIDES for joint, angle in poses().angles(name, side).items()}
                for name in SAFE_POSES} if self.limits else {}

    @property
    def grippers(self) -> list[str]:
        """The sides with an electric gripper."""
        return [side for side in SIDES if self._grippers_of_kind.get(side) == EndEffectorProperties.ELECTRIC_GRIPPER]

    def read_description(self) -> Robot | None:
        """Read the joints' limits from robot_description, if it is there and has changed. Waits for the master.

        Returns an urdf_model.Robot if it is another one than at the last call, else None.
        """
        text = rospy.get_param("/robot_description", None)
        if text is None or text == self._description:
            return None
        self._description = text
        if not isinstance(text, str):
            rospy.logwarn("the parameter /robot_description is %s; the text of a URDF is expected", shown(text))
            return None
        try:
            robot = parse_urdf(text, source="robot_description")
        except UrdfError as error:
            rospy.logwarn("%s", error)
            return None
        self.limits = limits_of(robot.joints, [*(name for side in SIDES for name in joint_names(side)), HEAD_JOINT])
        return robot

    def look_after(self) -> None:
        """Forget the state of a robot that has gone: the next one may stand elsewhere. A paused one is still there.
        Waits for the master.
        """
        if self._state is not None and self._presence.is_gone():
            self._state, self._positions = None, {}

    def measured(self) -> dict[str, float]:
        """{joint: position [rad]}; a joint_states message may hold only some of the joints."""
        return dict(self._positions)

    def why_not_ready(self) -> str:
        """Why the robot does not move, or ""."""
        state = self._state
        return "nothing is heard of the robot" if state is None else why_not_ready(state)

    def command(self, setpoints: Mapping[str, float]) -> None:
        """Position commands [rad] to the arms and the head."""
        for side, publisher in self._limbs.items():
            names = [name for name in joint_names(side) if name in setpoints]
            if names:
                publisher.publish(JointCommand(JointCommand.POSITION_MODE, [setpoints[name] for name in names], names))
        for side in self.grippers:
            self._follow_with(side, setpoints.get(side + "_gripper"))
        if HEAD_JOINT in setpoints:
            self._head.publish(HeadPanCommand(setpoints[HEAD_JOINT], HeadPanCommand.MAX_SPEED_RATIO,
                                              HeadPanCommand.REQUEST_PAN_ENABLE))

    def explain(self, joint: str, tell: Callable[[str], object]) -> None:
        """Ask the robot what keeps a joint from moving, and ``tell(sentence)`` on a separate thread."""
        threading.Thread(target=lambda: tell(_what_holds(joint)), daemon=True).start()

    def stop(self) -> None:
        """As the stop button."""
        self._stop.publish(Empty())

    def enable(self) -> None:
        """Reset where needed, then enable; in a thread."""
        self._switch(RobotEnable.enable)

    def disable(self) -> None:
        """Switch the drives off; in a thread."""
        self._switch(RobotEnable.disable)

    def grip(self, side: str, action: str) -> None:
        """Open, close or calibrate an electric gripper. Raises RobotError."""
        if side not in self.grippers:
            raise RobotError("there is no electric gripper on the side %r" % (side,))
        if action not in _ACTIONS:
            raise RobotError("a gripper can %s, not %r" % (", ".join(_ACTIONS), action))
        state = self._grippers.get(side)
        if state is None:
            raise RobotError("nothing is heard of the %s gripper" % side)
        if action != "calibrate" and state.calibrated == EndEffectorState.STATE_FALSE:
            raise RobotError("the %s gripper is not calibrated; calibrate it first" % side)
        self._gripped.pop(side, None)
        self._send(side, *_ACTIONS[action])

    def _follow_with(self, side: str, percent: float | None) -> None:
        state = self._grippers.get(side)
        if percent is None or state is None or state.calibrated == EndEffectorState.STATE_FALSE:
            return
        if abs(percent - self._gripped.get(side, state.position)) > GRIPPER_STEP_PERCENT:
            self._gripped[side] = percent
            self._send(side, "go", {"position": percent})

    def _send(self, side: str, command: str, arguments: dict[str, Any]) -> None:
        state = self._grippers[side]
        self._sequence += 1
        self._hands[side].publish(EndEffectorCommand(id=state.id, command=command, args=json.dumps(arguments),
                                                     sender=_SENDER, sequence=self._sequence))

    def _switch(self, method: Callable[[RobotEnable], object]) -> None:
        if not self._switching.acquire(blocking=False):
            raise RobotError("the last switch of the robot has not ended yet")
        threading.Thread(target=self._switch_now, args=(method,), daemon=True).start()

    def _switch_now(self, method: Callable[[RobotEnable], object]) -> None:
        try:
            if self._enabler is None:
                # Once, because each one subscribes to the robot's state.
                self._enabler = RobotEnable()
            method(self._enabler)
        except OSError as error:
            self._told(error.strerror or str(error))
        finally:
            self._switching.release()

    def _on_joints(self, message: JointState) -> None:
        self._positions.update(zip(message.name, message.position, strict=False))
        grippers = {"%s_gripper" % side: self._grippers[side].position for side in self.grippers
                    if side in self._grippers}
        self.time_s = message.header.stamp.to_sec()
        self.heard(self.time_s, {**self._positions, **grippers})

    def _on_state(self, message: AssemblyState) -> None:
        self._state, self._heard_s = message, time.monotonic()

    def _on_gripper(self, message: EndEffectorState, side: str) -> None:
        self._grippers[side] = message

    def _on_kind(self, message: EndEffectorProperties, side: str) -> None:
        self._grippers_of_kind[side] = message.ui_type


def _what_holds(joint: str) -> str:
    side = joint.partition("_")[0]
    why = ask_what_holds(side, is_kept_away=True) if side in SIDES else ""
    return why or "something is in its way, or another program moves it"
