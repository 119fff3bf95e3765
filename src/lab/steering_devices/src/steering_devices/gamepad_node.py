# SPDX-License-Identifier: BSD-3-Clause
"""The node for gamepads: joy in, twists out."""
from __future__ import annotations

import argparse
import sys
import threading
import time

import rospy
from sensor_msgs.msg import Joy

from rospy_nodes.start import end_on_signals, limit_ports
from steering_devices.hands import hands_of
from steering_devices.steering import DeviceParameterError, Gamepad, LayoutError, Steering, number

_RATE_HZ = 50.0
_DESCRIPTION = """Steer by a gamepad. Subscribes: joy. Publishes: twists to the servos, /steering/mark.
Parameters: ~layout (config/gamepad_*.yaml), ~servos, ~grippers, ~linear_speed [m/s], ~angular_speed [rad/s],
~joy_timeout [s]: without a message for this long all counts as released.
"""


def main() -> None:
    argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args(
        rospy.myargv()[1:])
    end_on_signals()
    limit_ports()
    rospy.init_node("servo_gamepad", disable_signals=True)
    hands, lock, newest = hands_of("servo_gamepad"), threading.Lock(), [Steering(), -1e9]
    try:
        pad = Gamepad(rospy.get_param("~layout", None), len(hands))
    except LayoutError as error:
        sys.exit("servo_gamepad: ~layout: %s" % error)
    try:
        timeout = number("~joy_timeout", rospy.get_param("~joy_timeout", 0.25), 0.0)
    except DeviceParameterError as error:
        sys.exit("servo_gamepad: %s" % error)

    def on_joy(message: Joy) -> None:
        with lock:
            taken, before = pad.take(message.axes, message.buttons), newest[0]
            # What was pressed stays until it is sent.
            taken.gripper, taken.mark = taken.gripper or before.gripper, taken.mark or before.mark
            newest[:] = taken, time.monotonic()

    rospy.Subscriber("joy", Joy, on_joy, queue_size=10, tcp_nodelay=True)
    while not rospy.is_shutdown():
        with lock:
            steering, since = newest
            newest[0] = Steering(steering.twist, steering.hand, steering.in_tool)
        if time.monotonic() - since > timeout:  # of wall time, as the driver's: the radio may be gone
            steering = Steering(hand=steering.hand, gripper=steering.gripper, mark=steering.mark)
        hands.send(steering)
        time.sleep(1.0 / _RATE_HZ)
