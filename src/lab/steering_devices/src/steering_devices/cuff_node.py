# SPDX-License-Identifier: BSD-3-Clause
"""The node for arms that people lead by hand: buttons of the robot in, grippers and marks out."""
from __future__ import annotations

import argparse
import queue

import roslib.message
import rospy

from baxter_model import SIDES
from rospy_nodes.start import end_on_signals, limit_ports
from steering_devices.hands import hands_of
from steering_devices.leader import Leader, topics_of

_LOOK_S = 0.1
_DESCRIPTION = """Teach by hand: a squeezed cuff lets the arm float, and whoever holds it moves it.

The cuff's buttons open and close the gripper; a navigator marks on /steering/mark: the wheel success, back failure, the
other button again. Parameters: ~servos and ~grippers, both for left and right; the servos are not used.
"""


def main() -> None:
    argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args(
        rospy.myargv()[1:])
    end_on_signals()
    limit_ports()
    rospy.init_node("servo_cuff", disable_signals=True)
    hands, buttons, heard = hands_of("servo_cuff", len(SIDES)), Leader(), queue.Queue()
    for topic, name in topics_of(SIDES).items():
        if not topic.endswith("joint_states"):
            rospy.Subscriber(topic, roslib.message.get_message_class(name), lambda message, topic=topic: heard.put(
                (topic, message)), queue_size=10)
    while not rospy.is_shutdown():
        try:
            topic, message = heard.get(timeout=_LOOK_S)
        except queue.Empty:
            continue
        buttons.take(topic, {name: getattr(message, name) for name in message.__slots__}, rospy.get_time())
        for side, what in buttons.presses():
            act = hands.hands[SIDES.index(side)].grip if what in ("open", "close") else hands.mark
            act(what)
