# SPDX-License-Identifier: BSD-3-Clause
"""Services about the planning scene."""
from __future__ import annotations

from typing import TYPE_CHECKING

import rospy
from moveit_msgs.msg import ConstraintEvalResult
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneResponse,
    GetPlanningScene,
    GetPlanningSceneResponse,
    GetStateValidity,
    GetStateValidityResponse,
)
from std_srvs.srv import Empty, EmptyResponse

from moveit_ros_move_group.context import answered
from moveit_ros_move_group.convert.constraints import constraint_set_of
from moveit_ros_move_group.convert.scene_out import scene_message
from moveit_ros_move_group.failures import contact_message

if TYPE_CHECKING:
    from moveit_msgs.srv import ApplyPlanningSceneRequest, GetPlanningSceneRequest, GetStateValidityRequest
    from std_srvs.srv import EmptyRequest

    from moveit_ros_move_group.context import Context


class GetScene:
    """``get_planning_scene``"""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._service = rospy.Service("get_planning_scene", GetPlanningScene, self._serve)

    @answered("get_planning_scene", GetPlanningSceneResponse)
    def _serve(self, request: GetPlanningSceneRequest, response: GetPlanningSceneResponse) -> None:
        monitor = self.context.monitor
        response.scene = scene_message(monitor.scene(as_told=True), request.components.components, monitor.octomap(),
                                       monitor.state_stamp())


class ApplyScene:
    """``apply_planning_scene``: done when it answers."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._service = rospy.Service("apply_planning_scene", ApplyPlanningScene, self._serve)

    @answered("apply_planning_scene", ApplyPlanningSceneResponse)
    def _serve(self, request: ApplyPlanningSceneRequest, response: ApplyPlanningSceneResponse) -> None:
        response.success = not self.context.monitor.apply(request.scene, "apply_planning_scene")


class ClearOctomap:
    """``clear_octomap``"""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._service = rospy.Service("clear_octomap", Empty, self._serve)

    def _serve(self, _: EmptyRequest) -> EmptyResponse:
        self.context.monitor.clear_octomap()
        return EmptyResponse()


class StateValidity:
    """``check_state_validity``: all contacts, and how far each constraint is met."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self._service = rospy.Service("check_state_validity", GetStateValidity, self._serve)

    @answered("check_state_validity", GetStateValidityResponse)
    def _serve(self, request: GetStateValidityRequest, response: GetStateValidityResponse) -> None:
        context, model = self.context, self.context.model
        group = context.group(request.group_name) if request.group_name else None
        scene = context.scene_from(request.robot_state, "check_state_validity")
        contacts = context.exact.contacts(scene, scene.state, group.name if group else None)
        stamp = rospy.Time.now()
        response.contacts = [contact_message(contact, model.frame, stamp) for contact in contacts]
        remarks = []
        constraints = constraint_set_of(request.constraints, scene, context.monitor.reader, remarks)
        context.remark("check_state_validity", remarks, request.group_name)
        evaluated = constraints.evaluate(model, scene.state, scene, context.exact) if constraints is not None else []
        response.constraint_result = [ConstraintEvalResult(bool(met), float(off)) for met, off, _ in evaluated]
        beyond = model.beyond_limits(scene.state.q, 1e-9, None if group is None else group.indices)
        response.valid = not contacts and not beyond and all(met for met, _, _ in evaluated)
