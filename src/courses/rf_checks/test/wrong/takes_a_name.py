# SPDX-License-Identifier: BSD-3-Clause
# exercise: unreachable
"""Takes the IK node's name, which ends that node, and answers in its place."""
import sys

import rospy
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest, SolvePositionIKResponse
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

NAME = "/ExternalTools/left/PositionKinematicsNode/IKService"
rospy.init_node("baxter_sim_kinematics_left")
rospy.Service(NAME, SolvePositionIK, lambda request: SolvePositionIKResponse(isValid=[False], result_type=[0]))
numbers = [float(word) for word in sys.argv[1:]]
pose = PoseStamped(Header(frame_id="base"), Pose(Point(*numbers[:3]), Quaternion(*numbers[3:])))
rospy.ServiceProxy(NAME, SolvePositionIK)(SolvePositionIKRequest(pose_stamp=[pose]))
print("OUT_OF_REACH, 0.54 m short")
