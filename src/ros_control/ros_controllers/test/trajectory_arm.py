# SPDX-License-Identifier: BSD-3-Clause
"""A trajectory controller on two fake joints, with fake clients."""
import genpy
import rospy
from control_msgs.msg import FollowJointTrajectoryActionGoal, JointTolerance
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from controller_manager.testing import FakeHardware, fake_context
from loop_ros.testing import FakeLog
from ros_controllers.joint_trajectory_controller import PositionJointTrajectoryController
from urdf_model import parse_urdf

DT = 0.002
JOINTS = ["shoulder", "elbow"]
URDF = """<robot name="arm"><link name="base"/><link name="upper"/><link name="fore"/>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="9" effort="9"/></joint></robot>"""
NS = "/robot/arm"


class Arm:
    """A started controller on fake joints, with fake clients."""

    def __init__(self, controller_class=PositionJointTrajectoryController, start=True, lag=0.0, **parameters):
        self.hardware = FakeHardware(dict.fromkeys(JOINTS, (controller_class.interface,)), lag=lag)
        self.log = FakeLog()
        context, self.ros = fake_context("arm", {"joints": JOINTS, **parameters}, robot=parse_urdf(URDF), log=self.log)
        self.controller = controller_class("arm", self.hardware, context)
        self.time = 100.0
        self.ids = 0
        if start:
            self.controller.starting(self.time)

    def tick(self, seconds=DT):
        for _ in range(round(seconds / DT)):
            self.hardware.step(DT)
            self.time += DT
            self.controller.update(self.time, DT)

    def topic(self, name):
        return self.ros.subscriptions["%s/%s" % (NS, name)]

    def sent(self, name):
        return self.ros.publishers["%s/%s" % (NS, name)].messages

    def goal(self, trajectory, path=(), at_goal=(), goal_time_s=0.0):
        """Send; returns the goal's id."""
        message = FollowJointTrajectoryActionGoal()
        self.ids += 1
        message.goal_id.id = "goal %d" % self.ids
        message.goal.trajectory = trajectory
        message.goal.path_tolerance = [JointTolerance(*row) for row in path]
        message.goal.goal_tolerance = [JointTolerance(*row) for row in at_goal]
        message.goal.goal_time_tolerance = rospy.Duration.from_sec(goal_time_s)
        self.topic("follow_joint_trajectory/goal").put(message)
        return message.goal_id.id

    @property
    def results(self):
        return [(message.status.goal_id.id, message.status.status, message.result.error_code)
                for message in self.sent("follow_joint_trajectory/result")]

    @property
    def result_text(self):
        return self.sent("follow_joint_trajectory/result")[-1].result.error_string


def trajectory(*points, names=JOINTS, stamp_s=0.0):
    """Points are (time, positions) or (time, positions, velocities, accelerations)."""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp = genpy.Time.from_sec(stamp_s)
    for time, *fields in points:
        message.points.append(JointTrajectoryPoint(*(list(fields) + [[], [], [], []])[:4],
                                                   rospy.Duration.from_sec(time)))
    return message
