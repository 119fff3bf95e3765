#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Print the pose of one frame of the robot in another, as vector, quaternion and matrices."""
import argparse
import sys

import numpy as np
import rospy
import tf2_ros

from baxter_interface import startup
from baxter_interface.waiting import Condition
from command_line.options import did_you_mean
from rf_lab2.poses import homogeneous_matrix, rotation_matrix

# The lab's exercise.
LAB_PAIRS = (("base", "left_hand"), ("left_hand", "right_hand"), ("head_camera", "left_gripper_base"))
PRINT_EVERY_S = 1.0


def parse_arguments(argv):
    parser = argparse.ArgumentParser(prog="tf_listener.py", description=__doc__,
                                     epilog="Without frames: %s. Exit status: 0, or 1 if a transform does not come."
                                            % ", ".join("%s -> %s" % pair for pair in LAB_PAIRS))
    parser.add_argument("frames", nargs="*", metavar="TARGET SOURCE", help="the pose of SOURCE is given in TARGET")
    parser.add_argument("--once", action="store_true", help="print once and end, instead of every second until Ctrl-C")
    arguments = parser.parse_args(argv)
    if len(arguments.frames) not in (0, 2):
        parser.error("two frames or none, got %d: %s" % (len(arguments.frames), " ".join(arguments.frames)))
    arguments.pairs = (tuple(arguments.frames),) if arguments.frames else LAB_PAIRS
    return arguments


def transform_known(buffer, target, source):
    """Condition: tf knows the pose of `source` in `target`."""
    def explain():
        known = sorted(line.split()[1] for line in buffer.all_frames_as_string().splitlines())
        slips = [did_you_mean(frame, known) for frame in (target, source) if frame.strip("/") not in known]
        return "%s%s (known frames: %s)" % (
            buffer.can_transform_core(target, source, rospy.Time())[1].rstrip("."), "".join(slips),
            ", ".join(known) or "none")

    return Condition("the transform %s -> %s" % (target, source),
                     lambda: bool(buffer.can_transform_core(target, source, rospy.Time())[0]), explain)


def describe(target, source, transform):
    """Write out a geometry_msgs/Transform, the pose of `source` in `target`."""
    translation = np.array([getattr(transform.translation, axis) for axis in "xyz"])
    quaternion = np.array([getattr(transform.rotation, axis) for axis in "xyzw"])
    return "\n".join((
        "%s -> %s" % (target, source),
        "Translation x y z [m]:", str(translation),
        "Quaternion x y z w:", str(quaternion),
        "Rotation matrix:", str(rotation_matrix(quaternion)),
        "Homogeneous matrix:", str(homogeneous_matrix(translation, quaternion)),
        ""))


def listen(pairs, once):
    buffer = tf2_ros.Buffer()
    tf2_ros.TransformListener(buffer)
    startup.wait_for_start([transform_known(buffer, *pair) for pair in pairs])
    rate = rospy.Rate(1.0 / PRINT_EVERY_S, reset=True)
    while not rospy.is_shutdown():
        for target, source in pairs:
            print(describe(target, source, buffer.lookup_transform(target, source, rospy.Time()).transform), flush=True)
        if once:
            return
        rate.sleep()


def main():
    arguments = parse_arguments(rospy.myargv()[1:])
    np.set_printoptions(precision=6, suppress=True)
    try:
        startup.init_node("baxter_tf_listener", topic="/tf", anonymous=True)
        listen(arguments.pairs, arguments.once)
    except (KeyboardInterrupt, rospy.ROSInterruptException):
        return 0
    except (OSError, ValueError, rospy.ROSException, tf2_ros.TransformException) as error:
        print("tf_listener.py: %s" % (getattr(error, "strerror", None) or error), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
