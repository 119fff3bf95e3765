# SPDX-License-Identifier: BSD-3-Clause
"""plan_sequence_path, and the action sequence_move_group."""
from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import actionlib
import rospy
from moveit_msgs.msg import (
    MotionSequenceResponse,
    MoveGroupSequenceAction,
    MoveGroupSequenceFeedback,
    MoveGroupSequenceResult,
    MoveItErrorCodes,
)
from moveit_msgs.srv import GetMotionSequence, GetMotionSequenceResponse

from moveit_ros_move_group.capabilities.motion import failed, finish, show
from moveit_ros_move_group.context import RequestError
from moveit_ros_move_group.convert.scene_out import state_message
from moveit_ros_move_group.planning import scene_with_diff
from moveit_ros_move_group.rest_of_the_way import RestOfTheWay
from moveit_ros_move_group.texts import result_text

if TYPE_CHECKING:
    from moveit_msgs.msg import MotionSequenceItem, MoveGroupSequenceGoal, PlanningOptions
    from moveit_msgs.srv import GetMotionSequenceRequest

    from motion_planning.pipeline import Plan
    from motion_planning.scene import Scene
    from moveit_ros_move_group.context import Context
    from moveit_ros_move_group.planning import Planner

# Time limit [s] for a joint state newer than the goal.
_STATE_TIMEOUT_S = 1.0


class SequenceService:
    """``plan_sequence_path``"""

    def __init__(self, context: Context, planner: Planner) -> None:
        self.context, self._planner = context, planner
        self._service = rospy.Service("plan_sequence_path", GetMotionSequence, self._serve)

    def _serve(self, request: GetMotionSequenceRequest) -> GetMotionSequenceResponse:
        response, begin = MotionSequenceResponse(), time.monotonic()
        try:
            items = request.request.items
            scene = self.context.scene_from(items[0].req.start_state, "plan_sequence_path") if items else (
                self.context.monitor.scene())
            _planned(self.context, self._planner, items, scene, response)
            response.error_code.val = MoveItErrorCodes.SUCCESS
        except Exception as error:  # the node must survive any error of a request
            response.error_code.val = failed(self.context, "plan_sequence_path", error)[0]
        response.planning_time = time.monotonic() - begin
        return GetMotionSequenceResponse(response)


class SequenceAction:
    """The action ``sequence_move_group``: plan a sequence, or plan and execute it."""

    def __init__(self, context: Context, planner: Planner, may_execute: bool) -> None:
        self.context, self._planner, self._may_execute = context, planner, may_execute
        self._changed = threading.Event()
        context.monitor.on_change(self._changed.set)
        self._server = actionlib.SimpleActionServer("sequence_move_group", MoveGroupSequenceAction, self._run,
                                                    auto_start=False)
        self._server.start()

    def _run(self, goal: MoveGroupSequenceGoal) -> None:
        result, begin, reason = MoveGroupSequenceResult(), time.monotonic(), ""
        response = result.response
        plan_only = goal.planning_options.plan_only or not self._may_execute or self.context.executor is None
        try:
            self._server.publish_feedback(MoveGroupSequenceFeedback("PLANNING"))
            reason = self._done(goal, plan_only, response)
        except Exception as error:  # the node must survive any error of a request
            response.error_code.val, reason = failed(self.context, "sequence_move_group", error)
        response.planning_time = response.planning_time or time.monotonic() - begin
        self._server.publish_feedback(MoveGroupSequenceFeedback("IDLE"))
        empty = not any(len(one.joint_trajectory.points) > 1 for one in response.planned_trajectories)
        code = response.error_code.val
        finish(self._server, result, result_text(code, reason, empty=empty and not (
            plan_only and code == MoveItErrorCodes.SUCCESS), plan_only=plan_only), code)

    def _done(self, goal: MoveGroupSequenceGoal, plan_only: bool, response: MotionSequenceResponse) -> str:
        """Fill the response; return the reason if it fails."""
        context, options, items = self.context, goal.planning_options, goal.request.items
        begin = time.monotonic()
        joints = [joint for item in items for joint in context.group(item.req.group_name).joints]
        late = context.monitor.wait_for_state(rospy.Time.now(), _STATE_TIMEOUT_S, joints,
                                              self._server.is_preempt_requested)
        if late:
            rospy.logwarn("sequence_move_group: %s", late)
        self._changed.clear()
        if plan_only and items:
            scene = context.scene_from(items[0].req.start_state, "sequence_move_group")
        else:
            scene = context.monitor.scene()
            if items and items[0].req.start_state.joint_state.name and not items[0].req.start_state.is_diff:
                rospy.logwarn("sequence_move_group: the start state is for planning alone; the robot starts "
                              "where it is")
        scene = scene_with_diff(context, scene, options.planning_scene_diff, "sequence_move_group",
                                keep_robot=not plan_only)
        plans = _planned(context, self._planner, items, scene, response, self._server.is_preempt_requested)
        response.planning_time = time.monotonic() - begin
        response.error_code.val = MoveItErrorCodes.SUCCESS
        return "" if plan_only else self._execute(plans, response, options)

    def _execute(self, plans: Sequence[tuple[str, Plan]], response: MotionSequenceResponse,
                 options: PlanningOptions) -> str:
        context = self.context
        self._server.publish_feedback(MoveGroupSequenceFeedback("MONITOR"))
        for (group, plan), trajectory in zip(plans, response.planned_trajectories, strict=True):
            if len(plan.timed.times) < 2:
                continue
            watch = RestOfTheWay(context.exact, context.model.groups[group], plan.timed, lambda: self._news(options))
            outcome = context.require_executor().execute(trajectory, self._server.is_preempt_requested, watch.hit)
            if outcome.code != MoveItErrorCodes.SUCCESS:
                response.error_code.val = outcome.code
                context.failures.tell("sequence_move_group", outcome.code, outcome.text, group, watch.contacts,
                                      outcome.joints)
                return outcome.text
        return ""

    def _news(self, options: PlanningOptions) -> Scene | None:
        """The scene if it has changed since the last call, else None."""
        if not self._changed.is_set():
            return None
        self._changed.clear()
        return scene_with_diff(self.context, self.context.monitor.scene(), options.planning_scene_diff,
                               "sequence_move_group", keep_robot=True)


def _planned(context: Context, planner: Planner, items: Sequence[MotionSequenceItem], scene: Scene,
             response: MotionSequenceResponse, stop: Callable[[], bool] = lambda: False) -> list[tuple[str, Plan]]:
    """Return [(group name, Plan), ...] of MotionSequenceItems from the state of ``scene``; fill the response."""
    if not items:
        raise RequestError(MoveItErrorCodes.INVALID_MOTION_PLAN, "the sequence has no items")
    response.sequence_start = state_message(context.model, scene.state, rospy.Time.now())
    plans = planner.plan_sequence(items, scene, stop)
    response.planned_trajectories = [show(context, group, plan) for group, plan in plans]
    return plans
