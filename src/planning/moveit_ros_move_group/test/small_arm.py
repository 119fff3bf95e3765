# SPDX-License-Identifier: BSD-3-Clause
"""A small arm of six joints that is quickly made ready, boxes without meshes, and the parameters of its move_group."""
import rospy
from good_requests import Robot
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from motion_planning.model import PlanningModel
from moveit_ros_move_group.convert.geometry import pose_of

AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
URDF = "<robot name='six'><link name='base'/>%s</robot>" % "".join("""
  <link name="l%d"><collision><origin xyz="0.07 0 0"/><geometry><box size="0.1 0.04 0.04"/></geometry></collision>
  </link>
  <joint name="j%d" type="revolute"><origin xyz="%s"/><parent link="%s"/><child link="l%d"/><axis xyz="%s"/>
    <limit lower="-2.5" upper="2.5" effort="1" velocity="2"/></joint>""" % (
    k, k, "0.14 0 0" if k else "0 0 0.3", "l%d" % (k - 1) if k else "base", k, axis) for k, axis in enumerate(AXES))
SRDF = "<robot name='six'><group name='arm'><chain base_link='base' tip_link='l5'/></group>%s</robot>" % "".join(
    "<disable_collisions link1='l%d' link2='l%d' reason='Adjacent'/>" % (k, k + 1) for k in range(5))
JOINTS = tuple("j%d" % k for k in range(6))
FREE, ASIDE = (0.1, 0.3, 0.4, 0.1, 0.6, 0.0), (1.2, 0.3, 0.4, 0.1, 0.6, 0.5)
MODEL = PlanningModel.from_xml(URDF, SRDF)
PLACE = pose_of(MODEL.frame_of(MODEL.state(dict(zip(JOINTS, ASIDE, strict=True))).q, "l5"))
SIX = Robot("arm", JOINTS, (2.5,) * 6, FREE, ASIDE, "l5", tuple(
    getattr(part, name) for part, names in ((PLACE.position, "xyz"), (PLACE.orientation, "xyzw")) for name in names),
    "base")


def parameters(kind="last point"):
    """The parameters of a node for it. kind: how its fake controller moves."""
    return {"robot_description": URDF, "robot_description_semantic": SRDF, "~": {
        "moveit_controller_manager": "moveit_fake_controller_manager/MoveItFakeControllerManager",
        "controller_list": [{"name": "fake", "joints": list(JOINTS), "type": kind, "rate": 100.0}],
        "trajectory_execution": {"wait_for_trajectory_completion": False}}}


def joint_state(values=FREE):
    return JointState(Header(stamp=rospy.Time.now()), JOINTS, values, (), ())
