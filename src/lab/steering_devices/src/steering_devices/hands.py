# SPDX-License-Identifier: BSD-3-Clause
"""Where steering goes: twists and joint velocities to servos, commands to grippers, marks to whoever records."""
from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy
from control_msgs.msg import JointJog
from geometry_msgs.msg import TwistStamped
from rosgraph.names import is_legal_name
from std_msgs.msg import Int8, String

from baxter_interface import Gripper
from baxter_model import SIDES
from steering_devices.steering import DeviceParameterError, number

if TYPE_CHECKING:
    from steering_devices.steering import Steering

# Of a servo's parameter command_in_type: a twist's 1 means its own full speed.
UNITLESS = "unitless"
#: Where all devices, and the page, publish success, failure and again (std_msgs/String), for recorders.
MARK_TOPIC = "/steering/mark"
# Twists of zero that end a motion.
_MAX_STOPS = 5


def _param(name: str, default: Any) -> Any:
    """A parameter; rospy has no types."""
    return rospy.get_param(name, default)


def _cached(name: str, default: Any) -> Any:
    """A parameter of a servo, which may change; where it is not of the default's type, or the master has ended, the
    default: a servo keeps to what it could use, and a device must go on."""
    try:
        value = rospy.get_param_cached(name, default)
    except OSError:
        return default
    is_one = isinstance(value, type(default)) or isinstance(default, float) and isinstance(value, int)
    return value if is_one and not isinstance(value, bool) else default


def _words(name: str, default: list[str]) -> list[str]:
    """A parameter that is a list of words, or a text of them. Raises DeviceParameterError."""
    value = _param(name, default)
    words = value.split() if isinstance(value, str) else value
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise DeviceParameterError("%s is %r; expected a list of names, or a text of them" % (name, value))
    return list(words)


def hands_of(node: str, count: int = 0) -> Hands:
    """Return the Hands of a node named ``node``, which needs ``count`` of them (0: any). Parameters that cannot be used
    end it."""
    try:
        hands = Hands()
    except DeviceParameterError as error:
        sys.exit("%s: %s" % (node, error))
    if count and len(hands) != count:
        sys.exit("%s: ~servos must name the servos of the left and the right arm, got %d" % (node, len(hands)))
    return hands


class Hand:
    """One servo and its gripper. name: of the servo's node; reason: why it holds back, "" if it does not."""

    def __init__(self, name: str, gripper: str = "") -> None:
        """Raises DeviceParameterError."""
        self.name, self.reason, self.status = name, "", 0
        # A device may be started before the servo whose parameters these are.
        #: What 1 means, of a twist's two halves [m/s, rad/s].
        self.speeds = tuple(number(name, _param(name, usual), 0.0) for name, usual in (
            ("~linear_speed", 0.2), ("~angular_speed", 0.6)))
        self._stops, self._gripper_name, self._gripper, self._gripping = _MAX_STOPS, gripper, None, threading.Lock()
        self._twists = rospy.Publisher(name + "/delta_twist_cmds", TwistStamped, queue_size=1, tcp_nodelay=True)
        self._jogs = rospy.Publisher(name + "/delta_joint_cmds", JointJog, queue_size=1, tcp_nodelay=True)
        self._kept = [rospy.Subscriber(name + "/status", Int8, self._on_status, queue_size=1),
                      rospy.Subscriber(name + "/status_reason", String, self._on_reason, queue_size=1)]

    def close(self) -> None:
        """Steer no longer; the hand must rest."""
        for end in (*self._kept, self._twists, self._jogs):
            end.unregister()

    def _on_status(self, message: Int8) -> None:
        self.status = message.data

    def _on_reason(self, message: String) -> None:
        self.reason = message.data

    @property
    def is_there(self) -> bool:
        """Whether the servo listens."""
        return self._twists.get_num_connections() > 0

    def steer(self, twist: np.ndarray, in_tool: bool) -> None:
        """Send ``twist`` (6,), -1 to 1; after a motion a few zeros, then nothing."""
        if twist.any():
            self._stops = 0
        elif self._stops >= _MAX_STOPS:
            return
        else:
            self._stops += 1
        speeds = (1.0, 1.0) if _cached(self.name + "/command_in_type", "") == UNITLESS else self.speeds
        message = TwistStamped()
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = _cached(self.name + "/ee_frame_name", "") if in_tool else ""
        values = (twist * np.repeat(speeds, 3)).tolist()
        (message.twist.linear.x, message.twist.linear.y, message.twist.linear.z, message.twist.angular.x,
         message.twist.angular.y, message.twist.angular.z) = values
        self._twists.publish(message)

    def jog(self, velocities: dict[str, float]) -> None:
        """Send {joint: velocity [rad/s]}; all zero: the joints come to rest."""
        scale = 1.0
        if _cached(self.name + "/command_in_type", "") == UNITLESS:
            # With 0 the servo makes no motion of anything.
            scale = _cached(self.name + "/scale/joint", 1.0) or 1.0
        message = JointJog(joint_names=list(velocities), velocities=[value / scale for value in velocities.values()])
        message.header.stamp = rospy.Time.now()
        self._jogs.publish(message)

    def grip(self, how: str) -> None:
        """"open" or "close" Baxter's gripper of this side, if the node has one."""
        if not self._gripper_name:
            rospy.logwarn_throttle(5.0, "%s has no gripper; set ~grippers to left, right or both" % self.name)
            return
        # A gripper that is not there is waited for; the hand must stop at once meanwhile.
        threading.Thread(target=self._grip, args=(how,), daemon=True).start()

    def _grip(self, how: str) -> None:
        with self._gripping:
            try:
                self._gripper = self._gripper or Gripper(self._gripper_name)
                (self._gripper.open if how == "open" else self._gripper.close)(block=False)
            except OSError as error:
                rospy.logwarn("%s: %s", self.name, error)


class Hands:
    """All hands of a device. Parameters: ~servos, names of servos' nodes; ~grippers, of each Baxter's side or ""."""

    def __init__(self) -> None:
        """Raises DeviceParameterError."""
        names, grippers = _words("~servos", ["servo_server"]), _words("~grippers", [])
        if not names or not all(map(is_legal_name, names)):
            raise DeviceParameterError("~servos is %r; expected names of servos' nodes" % (names,))
        if len(grippers) > len(names) or not all(side in ("", *SIDES) for side in grippers):
            raise DeviceParameterError("~grippers is %r; expected for each of ~servos %s or \"\"" % (
                grippers, ", ".join(SIDES)))
        grippers += [""] * (len(names) - len(grippers))
        self.hands = [Hand(rospy.resolve_name(name), gripper) for name, gripper in zip(names, grippers, strict=False)]
        self._marks = rospy.Publisher(MARK_TOPIC, String, queue_size=10)

    def __len__(self) -> int:
        return len(self.hands)

    def send(self, steering: Steering) -> None:
        """Carry out a Steering; hands that it is not about come to rest."""
        for index, hand in enumerate(self.hands):
            hand.steer(steering.twist if index == steering.hand else np.zeros(6), steering.in_tool)
        if steering.gripper:
            self.hands[steering.hand].grip(steering.gripper)
        if steering.mark:
            self.mark(steering.mark)

    def mark(self, what: str) -> None:
        """Publish "success", "failure" or "again"."""
        self._marks.publish(String(what))
