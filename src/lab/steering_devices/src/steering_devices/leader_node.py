# SPDX-License-Identifier: BSD-3-Clause
"""The node for a leader robot: another Baxter's arms lead this one's."""
from __future__ import annotations

import argparse
import sys
import threading
import time
from functools import partial

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from baxter_model import JOINTS, SIDES, mirrored
from rospy_nodes.start import end_on_signals, limit_ports
from steering_devices.hands import hands_of
from steering_devices.leader import Clutch, Leader
from steering_devices.leader_sources import LeaderAddressError, follow, stamped

_PERIOD_S = 0.02
_DESCRIPTION = """Let the arms of another Baxter, physical or in a lab, lead this one's while its cuffs are squeezed.

Publishes: joint velocities to the servos, /steering/mark (the leader's navigators: the wheel success, back failure, the
other button again). The cuffs' buttons open and close the grippers. Subscribes: robot/joint_states.
Parameters: ~leader, http:// of its master or ws:// of its rosbridge; ~mirror: its left arm leads the right one, as in a
mirror; ~servos and ~grippers, both for left and right.
"""


class _Follower:
    """One arm of this robot. leads: the side of the leader's arm."""

    def __init__(self, side: str, is_mirror: bool, hand) -> None:
        self.hand, self.side = hand, side
        self.leads = SIDES[1 - SIDES.index(side)] if is_mirror else side
        self.joints = ["%s_%s" % (side, joint) for joint in JOINTS]
        self._leading = ["%s_%s" % (self.leads, joint) for joint in JOINTS]
        signs = mirrored(dict.fromkeys(JOINTS, 1.0)) if is_mirror else dict.fromkeys(JOINTS, 1.0)
        self._clutch, self._moves = Clutch(np.array([signs[joint] for joint in JOINTS])), False

    def step(self, leader: Leader, measured: dict[str, float], seconds: float) -> None:
        """Follow for a moment."""
        known = all(name in leader.position for name in self._leading) and all(name in measured for name in self.joints)
        held = known and leader.holds(self.leads, time.monotonic())
        if not (held or self._moves):
            return
        angles = [[of.get(name, 0.0) for name in names] for of, names in (
            (leader.position, self._leading), (measured, self.joints))]
        velocities = self._clutch.velocities(np.array(angles[0]), np.array(angles[1]), held, seconds)
        self._moves = held
        self.hand.jog(dict(zip(self.joints, velocities.tolist(), strict=True)))


def main() -> None:
    argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args(
        rospy.myargv()[1:])
    end_on_signals()
    limit_ports()
    rospy.init_node("servo_leader", disable_signals=True)
    hands, leader, measured, lock = hands_of("servo_leader", len(SIDES)), Leader(), {}, threading.Lock()
    is_mirror = bool(rospy.get_param("~mirror", False))
    arms = [_Follower(side, is_mirror, hand) for side, hand in zip(SIDES, hands.hands, strict=True)]

    def take(topic: str, message, now: float) -> None:
        with lock:
            leader.take(topic, message, now)

    def on_joints(message: JointState) -> None:
        measured.update(zip(message.name, message.position, strict=False))

    try:
        end = follow(str(rospy.get_param("~leader", "")), SIDES, stamped(take), partial(rospy.logwarn_throttle, 10.0))
    except LeaderAddressError as error:
        sys.exit("servo_leader: ~leader: %s" % error)
    rospy.Subscriber("robot/joint_states", JointState, on_joints, queue_size=1, tcp_nodelay=True)
    last = time.monotonic()
    while not rospy.is_shutdown():
        rospy.rostime.wallsleep(_PERIOD_S)
        now, last = time.monotonic(), time.monotonic() - last
        with lock:
            for arm in arms:
                arm.step(leader, dict(measured), last)
            pressed = leader.presses()
        last = now
        for side, what in pressed:
            hand = next(arm.hand for arm in arms if arm.leads == side)
            hand.grip(what) if what in ("open", "close") else hands.mark(what)
    end()
