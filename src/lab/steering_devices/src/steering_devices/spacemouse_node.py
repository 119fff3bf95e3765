# SPDX-License-Identifier: BSD-3-Clause
"""The node for a SpaceMouse without a driver: HID reports in, twists out."""
from __future__ import annotations

import argparse
import contextlib
import sys
import time

import rospy

from rospy_nodes.start import end_on_signals, limit_ports
from steering_devices.hands import Hands, hands_of
from steering_devices.spacemouse import Cap, SpaceMouseDevice, SpaceMouseLost
from steering_devices.steering import Gamepad, LayoutError, Steering

# Between two messages; a cap that is pushed reports more often than the second [s]; between two looks for a device.
_PERIOD_S, _SILENT_S, _LOOK_S = 0.02, 0.1, 1.0
_DESCRIPTION = """Steer by a SpaceMouse, read from its hidraw device. Publishes: twists to the servos, /steering/mark.
Parameters: ~dev (default: the first SpaceMouse), ~layout (config/gamepad_spacemouse.yaml), ~servos, ~grippers,
~linear_speed [m/s], ~angular_speed [rad/s].
"""


def main() -> None:
    argparse.ArgumentParser(description=_DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args(
        rospy.myargv()[1:])
    end_on_signals()
    limit_ports()
    rospy.init_node("servo_spacemouse", disable_signals=True)
    hands = hands_of("servo_spacemouse")
    try:
        pad = Gamepad(rospy.get_param("~layout", None), len(hands))
    except LayoutError as error:
        sys.exit("servo_spacemouse: ~layout: %s" % error)
    told = ""
    while not rospy.is_shutdown():
        try:
            with contextlib.closing(SpaceMouseDevice(str(rospy.get_param("~dev", "")))) as device:
                rospy.loginfo("the SpaceMouse %s is there", device.path)
                told = ""
                _follow(device, pad, hands)
        except SpaceMouseLost as lost:
            hands.send(Steering())
            if str(lost) != told:
                told = str(lost)
                rospy.logwarn("%s; waiting for it", lost)
            rospy.rostime.wallsleep(_LOOK_S)


def _follow(device: SpaceMouseDevice, pad: Gamepad, hands: Hands) -> None:
    """Steer by what the device reports until the node ends. Raises SpaceMouseLost."""
    cap, heard = Cap(), time.monotonic()
    while not rospy.is_shutdown():
        begin = time.monotonic()
        for report in device.read(_PERIOD_S):
            cap.take(report)
            heard = time.monotonic()
            steering = pad.take(cap.axes, cap.buttons)
            if steering.gripper or steering.mark:
                hands.send(steering)
        # A radio that is gone must not leave the arm moving: a cap that is held goes on reporting.
        if time.monotonic() - heard > _SILENT_S:
            cap.axes = [0.0] * 6
        hands.send(pad.take(cap.axes, cap.buttons))
        rospy.rostime.wallsleep(max(0.0, _PERIOD_S - (time.monotonic() - begin)))
