# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Sends the pose in the frame of the head."""
import rospy
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

import baxter_interface

rospy.init_node("student")
baxter_interface.RobotEnable().enable()
left = baxter_interface.Limb("left")
service = rospy.ServiceProxy("/ExternalTools/left/PositionKinematicsNode/IKService", SolvePositionIK)
pose = PoseStamped(header=Header(frame_id="head"),
                   pose=Pose(Point(0.644, 0.0, 0.066), Quaternion(-0.381, 0.923, -0.015, 0.052)))
answer = service(SolvePositionIKRequest(pose_stamp=[pose]))
left.move_to_joint_positions(dict(zip(answer.joints[0].name, answer.joints[0].position, strict=True)))
