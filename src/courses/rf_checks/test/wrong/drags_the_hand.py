# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Commands the arm once where it is, then pulls its hand by the mouse's spring of the simulator's window."""
import rospy
from baxter_core_msgs.msg import JointCommand
from bullet_sim_msgs.msg import Drag
from geometry_msgs.msg import Point

import baxter_interface

rospy.init_node("student")
baxter_interface.RobotEnable().enable()
right = baxter_interface.Limb("right")
right.set_joint_positions(right.joint_angles())
# A torque command of nothing lets go of the joints.
command = rospy.Publisher("/robot/limb/right/joint_command", JointCommand, queue_size=1)
pull = rospy.Publisher("/gazebo/drag", Drag, queue_size=1)
rate = rospy.Rate(50)
for _ in range(250):
    command.publish(JointCommand(mode=JointCommand.TORQUE_MODE, names=right.joint_names(), command=[0.0] * 7))
    pull.publish(Drag(link="baxter::right_wrist", hold=True, grip=Point(), target=Point(0.3, -0.9, 1.5)))
    rate.sleep()
