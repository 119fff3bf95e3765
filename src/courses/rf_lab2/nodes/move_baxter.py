#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Move both arms of Baxter to neutral, then one gripper to a pose that the IK service solves."""
import argparse
import sys
from concurrent.futures import ThreadPoolExecutor

import rospy
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

from baxter_interface import CHECK_VERSION, Limb, RobotEnable
from baxter_model import BASE_FRAME, SIDES
from command_line.options import number
from rf_lab2.poses import pose_difference, unit_quaternion
from rf_lab2.programs import LabProgramFailed, run

# The lab's pose of the left gripper in `base`.
LAB_POINT = (0.644, 0.0, 0.066)
LAB_QUATERNION = (-0.381, 0.923, -0.015, 0.052)
SERVICE_TIMEOUT_S = 30.0
# Poses farther away are a slip; the service says what is out of reach.
FARTHEST_M = 1e6


def parse_arguments(argv):
    parser = argparse.ArgumentParser(prog="move_baxter.py", description=__doc__,
                                     epilog="Exit status: 0 the arm is there, 1 it is not, 2 wrong options.")
    parser.add_argument("--arm", choices=SIDES, default="left", help="the arm to move (default: %(default)s)")
    parser.add_argument("--point", type=number(float, -FARTHEST_M, FARTHEST_M), nargs=3, default=LAB_POINT,
                        metavar=("X", "Y", "Z"),
                        help="position of the gripper in base [m] (default: %s %s %s)" % LAB_POINT)
    parser.add_argument("--quaternion", type=number(float, -FARTHEST_M, FARTHEST_M), nargs=4, default=LAB_QUATERNION,
                        metavar=("X", "Y", "Z", "W"),
                        help="its orientation (default: %s %s %s %s)" % LAB_QUATERNION)
    arguments = parser.parse_args(argv)
    try:
        arguments.quaternion = unit_quaternion(arguments.quaternion)
    except ValueError as error:
        parser.error(str(error))
    return arguments


def move_to_neutral(limbs):
    """Move all limbs at the same time. Raises LabProgramFailed."""
    with ThreadPoolExecutor(len(limbs)) as pool:
        arrived = list(pool.map(Limb.move_to_neutral, limbs))
    if not all(arrived):
        raise LabProgramFailed("not every arm reached neutral; the lines above say why")


def solve_ik(arm, point, quaternion):
    """Ask the robot for joint angles (dict of name to rad) that put the gripper of `arm` at a pose in `base`.

    Raises LabProgramFailed if there are none, rospy.ServiceException or rospy.ROSException if the service does not
    answer.
    """
    name = "/ExternalTools/%s/PositionKinematicsNode/IKService" % arm
    rospy.wait_for_service(name, SERVICE_TIMEOUT_S)
    pose = PoseStamped(header=Header(stamp=rospy.Time.now(), frame_id=BASE_FRAME),
                       pose=Pose(position=Point(*point), orientation=Quaternion(*quaternion)))
    response = rospy.ServiceProxy(name, SolvePositionIK)(SolvePositionIKRequest(pose_stamp=[pose]))
    if not response.isValid or not response.isValid[0]:
        raise LabProgramFailed("no joint angles put the %s gripper at %s, quaternion %s; rostopic echo -n 1 %s says why"
                               % (arm, list(point), list(quaternion), name.replace("IKService", "IKReport")))
    return dict(zip(response.joints[0].name, response.joints[0].position, strict=True))


def move_baxter(arm, point, quaternion):
    RobotEnable(CHECK_VERSION).enable()
    limbs = {side: Limb(side) for side in SIDES}
    # Both arms leave their start pose, so that the moving arm has room afterwards.
    rospy.loginfo("moving both arms to neutral")
    move_to_neutral(list(limbs.values()))

    angles = solve_ik(arm, point, quaternion)
    print(angles, flush=True)
    rospy.loginfo("moving the %s arm to the pose", arm)
    if not limbs[arm].move_to_joint_positions(angles):
        raise LabProgramFailed("the %s arm did not get to the pose; the line above says why" % arm)
    reached = limbs[arm].endpoint_pose()
    rospy.loginfo("the %s gripper is %.1f mm and %.4f rad from the pose", arm,
                  *scaled_difference(reached, point, quaternion))
    for limb in limbs.values():
        limb.exit_control_mode()


def scaled_difference(reached, point, quaternion):
    distance_m, angle_rad = pose_difference(reached["position"], reached["orientation"], point, quaternion)
    return 1000.0 * distance_m, angle_rad


def main():
    arguments = parse_arguments(rospy.myargv()[1:])
    return run("move_baxter", lambda: move_baxter(arguments.arm, arguments.point, arguments.quaternion))


if __name__ == "__main__":
    sys.exit(main())
