#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Serves what moveit_commander asks of move_group: a robot that is at once where it is sent.

The requested planner decides the result of a goal: "wait" waits until it is cancelled, "refuse" rejects it, "die" ends
this process.
"""
import os

import actionlib
import rospy
from moveit_msgs.msg import (
    ExecuteTrajectoryAction,
    ExecuteTrajectoryResult,
    MoveGroupAction,
    MoveGroupResult,
    MoveItErrorCodes,
    PlanningScene,
    RobotTrajectory,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneResponse,
    GetPlanningScene,
    GetPlanningSceneResponse,
)
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint


class FakeMoveGroup:
    def __init__(self):
        self._joints = {"joint_%d" % number: 0.0 for number in range(1, 7)}
        self._scene = PlanningScene()
        self._waiting = []
        self._heard = rospy.Publisher("heard", String, queue_size=10, latch=True)
        rospy.Subscriber("trajectory_execution_event", String, self._heard.publish)
        rospy.Service("get_planning_scene", GetPlanningScene, self._get_scene)
        rospy.Service("apply_planning_scene", ApplyPlanningScene, self._apply)
        self._servers = [
            actionlib.ActionServer("move_group", MoveGroupAction, self._plan, self._cancel, auto_start=False),
            actionlib.ActionServer("execute_trajectory", ExecuteTrajectoryAction, self._execute, self._cancel,
                                   auto_start=False)]
        for server in self._servers:
            server.start()

    def _get_scene(self, request):
        self._scene.robot_state.joint_state.name = list(self._joints)
        self._scene.robot_state.joint_state.position = list(self._joints.values())
        return GetPlanningSceneResponse(self._scene)

    def _apply(self, request):
        self._scene.world.collision_objects.extend(request.scene.world.collision_objects)
        return ApplyPlanningSceneResponse(True)

    def _plan(self, handle):
        request, options = handle.get_goal().request, handle.get_goal().planning_options
        if request.planner_id == "die":
            os._exit(0)
        if request.planner_id == "refuse":
            handle.set_rejected(None, "this planner refuses")
            return
        handle.set_accepted()
        if request.planner_id == "wait":
            self._waiting.append(handle)
            return
        wanted = {one.joint_name: one.position for one in request.goal_constraints[0].joint_constraints}
        result = MoveGroupResult(error_code=MoveItErrorCodes(MoveItErrorCodes.SUCCESS))
        result.planned_trajectory = self._way_to(wanted)
        if not options.plan_only:
            self._joints.update(wanted)
        handle.set_succeeded(result, "Solution was found and executed.")

    def _way_to(self, wanted):
        made = RobotTrajectory()
        made.joint_trajectory.joint_names = list(wanted)
        for time, values in ((0.0, [self._joints[name] for name in wanted]), (1.0, list(wanted.values()))):
            made.joint_trajectory.points.append(
                JointTrajectoryPoint(positions=values, time_from_start=rospy.Duration(time)))
        return made

    def _execute(self, handle):
        handle.set_accepted()
        trajectory = handle.get_goal().trajectory.joint_trajectory
        self._joints.update(zip(trajectory.joint_names, trajectory.points[-1].positions, strict=True))
        handle.set_succeeded(ExecuteTrajectoryResult(error_code=MoveItErrorCodes(MoveItErrorCodes.SUCCESS)))

    def _cancel(self, handle):
        if handle in self._waiting:
            self._waiting.remove(handle)
            handle.set_canceled(MoveGroupResult(error_code=MoveItErrorCodes(MoveItErrorCodes.PREEMPTED)), "cancelled")


if __name__ == "__main__":
    rospy.init_node("fake_move_group")
    fake = FakeMoveGroup()
    rospy.spin()
